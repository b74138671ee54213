"""The lidar against distances known by hand and by walking along the ray."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from surveillance_simulation.robot.lidar import LidarModel, scan
from surveillance_simulation.world.simulated_place import SimulatedPlace
from tests.places import seven_rooms, two_rooms

EXACT = LidarModel(noise=0.0)


def ahead(world: SimulatedPlace, x: float, y: float, yaw: float) -> float:
    return float(scan(world, (x, y, yaw), EXACT)[EXACT.rays // 2])


def test_rays_start_backwards_and_go_round_anticlockwise() -> None:
    ranges = scan(two_rooms(), (1.0, 1.2, 0.0), EXACT)
    assert ranges[0] == pytest.approx(0.95)
    assert ranges[90] == pytest.approx(1.15)
    assert ranges[270] == pytest.approx(0.75)


def test_it_sees_through_an_open_door_and_not_through_a_closed_one() -> None:
    world = two_rooms()
    assert ahead(world, 1.0, 1.0, 0.0) == pytest.approx(4.95)
    world.set_door('D', False)
    assert ahead(world, 1.0, 1.0, 0.0) == pytest.approx(1.95)


def test_it_sees_obstacles_in_front_and_not_behind() -> None:
    world = two_rooms()
    world.place_obstacle('box', 2.0, 1.0, 0.25)
    assert ahead(world, 1.0, 1.0, 0.0) == pytest.approx(0.75)
    assert ahead(world, 1.0, 1.0, math.pi) == pytest.approx(0.95)


def test_beyond_its_range_it_measures_infinity() -> None:
    short = LidarModel(range_max=2.0, noise=0.0)
    assert scan(two_rooms(), (1.0, 1.0, 0.0), short)[180] == np.inf


def test_noise_is_repeatable_and_of_the_size_given() -> None:
    world, noisy = two_rooms(), LidarModel(noise=0.02)
    first = scan(world, (1.0, 1.0, 0.0), noisy, np.random.default_rng(1))
    again = scan(world, (1.0, 1.0, 0.0), noisy, np.random.default_rng(1))
    assert (first == again).all()
    error = first - scan(world, (1.0, 1.0, 0.0), EXACT)
    assert 0.015 < float(error.std()) < 0.025


@pytest.fixture(scope='module')
def furnished() -> SimulatedPlace:
    world = seven_rooms()
    world.set_door('D5', False)
    world.place_obstacle('box', 10.0, 9.0, 0.3)
    return world


@settings(max_examples=40)
@given(x=st.floats(7.3, 17.7), y=st.floats(6.8, 9.7), angle=st.integers(0, 359))
def test_a_ray_ends_where_walking_along_it_meets_something(
    furnished: SimulatedPlace, x: float, y: float, angle: int
) -> None:
    if furnished.clearance(x, y) < EXACT.range_min:
        return
    distance = float(scan(furnished, (x, y, 0.0), EXACT)[angle])
    direction = -math.pi + math.radians(angle)
    walked = 0.0
    # Sphere tracing: a step as long as the clearance never goes through a surface.
    while walked <= EXACT.range_max:
        here = (x + walked * math.cos(direction), y + walked * math.sin(direction))
        step = furnished.clearance(*here)
        if step < 1e-5:
            break
        walked += step
    if distance < np.inf:
        assert walked == pytest.approx(distance, abs=0.01)
    else:
        assert walked > EXACT.range_max - 0.01
