"""The base: limits, collisions, odometry, pushes."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from surveillance_simulation.robot.base import PUSH_GAP, Base, BaseModel
from surveillance_simulation.world.simulated_place import SimulatedPlace
from tests.places import seven_rooms, two_rooms

DT = 0.05


def drive(base: Base, speed: float, turn_speed: float, seconds: float) -> None:
    for _ in range(round(seconds / DT)):
        base.command(speed, turn_speed)
        base.step(DT)


def test_it_accelerates_to_the_wanted_speed_and_no_further() -> None:
    base = Base(two_rooms(), (0.5, 1.0, 0.0), BaseModel(acceleration=1.0))
    drive(base, 5.0, 0.0, 0.3)
    assert base.speed == pytest.approx(0.3)
    drive(base, 5.0, 0.0, 1.0)
    assert base.speed == pytest.approx(0.6)


@pytest.mark.parametrize('way', [1.0, -1.0])
def test_it_brakes_harder_than_it_speeds_up(way: float) -> None:
    model = BaseModel(acceleration=1.0, deceleration=2.0)
    base = Base(two_rooms(), (1.5, 1.0, 0.0), model)
    drive(base, 0.4 * way, 0.0, 0.5)
    assert base.speed == pytest.approx(0.4 * way)
    drive(base, 0.2 * way, 0.0, DT)
    assert base.speed == pytest.approx(0.3 * way)
    drive(base, -0.5 * way, 0.0, 0.15)
    assert base.speed == pytest.approx(0.0), 'to a stand first'
    drive(base, -0.5 * way, 0.0, 3 * DT)
    assert 0.05 < -base.speed * way <= 0.15 + 1e-9


def test_a_turn_follows_the_exact_arc() -> None:
    radius = 0.5
    base = Base(two_rooms(), (1.5, 0.5, 0.0), BaseModel(acceleration=1e6, turn_acceleration=1e6))
    drive(base, 0.25, 0.25 / radius, 2.0)
    angle = 1.0
    expected = (1.5 + radius * math.sin(angle), 0.5 + radius * (1 - math.cos(angle)), angle)
    assert base.pose == pytest.approx(expected, abs=1e-9)


def test_it_stops_without_commands() -> None:
    base = Base(two_rooms(), (1.0, 1.0, 0.0))
    drive(base, 0.2, 0.0, 0.5)
    for _ in range(40):
        base.step(DT)
    assert base.speed == 0.0
    assert not base.is_moving


def test_a_wall_stops_it_and_it_can_turn_and_back_away() -> None:
    base = Base(two_rooms(), (1.0, 1.0, math.pi))
    drive(base, 0.6, 0.0, 5.0)
    assert base.pose[0] == pytest.approx(0.05 + 0.22, abs=0.003)
    assert base.collisions == 1
    assert base.odometry == pytest.approx(base.pose, abs=1e-6)
    drive(base, 0.0, 1.0, 0.5)
    assert abs(math.remainder(base.pose[2] - math.pi, math.tau)) > 0.3
    drive(base, -0.3, 0.0, 1.0)
    assert base.pose[0] > 0.4


def test_a_door_that_closes_stops_it() -> None:
    world = two_rooms()
    base = Base(world, (2.0, 1.0, 0.0))
    world.set_door('D', False)
    drive(base, 0.6, 0.0, 4.0)
    assert base.pose[0] < 3.0 - 0.05 - 0.22


def test_an_obstacle_dropped_onto_the_robot_lets_it_out() -> None:
    world = two_rooms()
    base = Base(world, (1.5, 1.0, 0.0))
    world.place_obstacle('box', 1.3, 1.0, 0.2)
    drive(base, 0.3, 0.0, 2.0)
    assert base.pose[0] > 1.8


def test_a_push_is_not_seen_by_the_wheels_and_ends_at_the_wall() -> None:
    base = Base(two_rooms(), (1.0, 1.0, 0.0))
    gone = base.push(0.0, 5.0, 0.3)
    assert 0.5 < gone < 0.8
    assert base.odometry == (1.0, 1.0, 0.0)
    assert base.pose[1] + 0.22 <= 1.95 - PUSH_GAP
    assert base.pose[2] == pytest.approx(0.3)


def test_a_pushed_robot_stands_until_the_next_command() -> None:
    base = Base(two_rooms(), (1.0, 1.0, 0.0))
    drive(base, 0.5, 0.0, 0.5)
    base.push(0.0, 5.0, math.pi / 2)
    pushed = base.pose
    base.step(DT)
    assert base.pose == pushed
    drive(base, 0.0, 0.5, 0.5)
    assert base.pose != pushed
    assert base.collisions == 0


def test_a_slip_moves_the_odometry_in_the_robots_frame() -> None:
    base = Base(two_rooms(), (1.0, 1.0, math.pi / 2))
    base.slip(0.5, 0.0, 0.1)
    assert base.odometry == pytest.approx((1.0, 1.5, math.pi / 2 + 0.1))
    assert base.pose == (1.0, 1.0, math.pi / 2)


def test_odometry_drifts_a_little_and_repeatably() -> None:
    def drifted() -> tuple[float, float, float]:
        base = Base(two_rooms(), (0.6, 1.0, 0.0), rng=np.random.default_rng(4))
        drive(base, 0.3, 0.0, 5.0)
        return tuple(np.subtract(base.odometry, base.pose).tolist())

    assert drifted() == drifted()
    assert 0.0 < math.hypot(*drifted()[:2]) < 0.05


def test_a_command_that_is_no_number_stops_it() -> None:
    base = Base(two_rooms(), (1.0, 1.0, 0.0))
    base.command(math.nan, math.inf)
    base.step(DT)
    assert base.pose == (1.0, 1.0, 0.0)


@pytest.fixture(scope='module')
def crowded() -> SimulatedPlace:
    world = seven_rooms()
    world.set_door('D7', False)
    world.place_obstacle('box', 6.0, 9.0, 0.3)
    return world


@settings(max_examples=25)
@given(
    st.lists(st.tuples(st.floats(-0.6, 0.6), st.floats(-1.5, 1.5), st.integers(1, 60)), max_size=12)
)
def test_no_commands_ever_drive_it_into_something(
    crowded: SimulatedPlace, commands: list[tuple[float, float, int]]
) -> None:
    base = Base(crowded, crowded.plan.start)
    for speed, turn_speed, steps in commands:
        for _ in range(steps):
            base.command(speed, turn_speed)
            base.step(DT)
            assert crowded.clearance(*base.pose[:2]) >= base.model.radius


def test_a_base_begins_at_rest_with_nothing_behind_it_and_counts_its_way() -> None:
    base = Base(two_rooms(), (1.0, 1.0, 0.0))
    assert (base.travelled, base.collisions, base.speed, base.turn_speed) == (0.0, 0, 0.0, 0.0)
    assert base.odometry == base.pose == (1.0, 1.0, 0.0)
    drive(base, 0.4, 0.0, 2.0)
    assert base.travelled == pytest.approx(base.pose[0] - 1.0)
    before = base.travelled
    drive(base, -0.4, 0.0, 3.0)
    assert base.travelled > before + 0.5, 'backwards is a way, too'
    driven = base.travelled
    base.push(0.3, 0.0, 0.0)
    assert base.travelled == driven, 'who is pushed does not drive'
    turned = Base(two_rooms(), (1.0, 1.0, 0.0))
    drive(turned, 0.0, 1.0, 1.0)
    assert turned.travelled == 0.0
