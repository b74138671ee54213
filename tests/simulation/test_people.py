"""People who walk in a place, around a robot that stands in their way."""

from __future__ import annotations

import math

import numpy as np
import pytest

from surveillance_simulation.robot.robot import Robot
from surveillance_simulation.world.people import People, PeopleModel
from surveillance_simulation.world.world import World, read_world

from .places import CONFIG, two_rooms

FAR_AWAY = (100.0, 100.0)


def people_in(world: World, seed: int = 1, **model: object) -> People:
    return People(world.plan, PeopleModel(**model), np.random.default_rng(seed))  # type: ignore[arg-type]


def test_they_walk_from_room_to_room_and_through_no_wall() -> None:
    world = read_world(CONFIG / 'seven_rooms.yaml')
    people = people_in(world, count=3)
    before, entered, walked = people.discs, set(), 0.0
    for _ in range(2400):
        people.step(0.1, [FAR_AWAY], 0.22)
        after = people.discs
        walked += float(np.hypot(*(after - before)[:, :2].T).max())
        for x, y, radius in after:
            assert world.is_free(x, y, radius)
            entered.add(world.place_at(x, y))
        before = after
    assert len(entered) >= 5
    assert walked < 240 * 1.2 + 1


@pytest.mark.parametrize(('manner', 'kept'), [('polite', 0.6), ('pushy', 0.05)])
def test_nobody_walks_into_a_robot_that_stands_in_the_door(manner: str, kept: float) -> None:
    world = two_rooms()
    door = world.plan.doors['D']
    people = people_in(world, count=4, manner=manner, shortest_rest=0.0, longest_rest=1.0)
    nearest = math.inf
    for _ in range(1200):
        people.step(0.1, [(door.x, door.y)], 0.22)
        for x, y, radius in people.discs:
            nearest = min(nearest, math.dist((x, y), (door.x, door.y)) - radius - 0.22)
    assert kept - 1e-6 <= nearest < kept + 0.3


def test_the_lidar_sees_them_and_the_robot_runs_into_them() -> None:
    world = two_rooms()
    people = people_in(world, count=1, longest_rest=0.0, shortest_rest=0.0)
    robot = Robot(world, people=people)
    robot.advance(0.05)
    (x, y, radius), pose = world.discs[0], robot.base.pose
    bearing = math.atan2(y - pose[1], x - pose[0])
    ray = int(np.argmin(np.abs(robot.lidar.angles - math.remainder(bearing - pose[2], math.tau))))
    assert robot.scan()[ray] == pytest.approx(math.dist((x, y), pose[:2]) - radius, abs=0.02)


def test_the_same_seed_gives_the_same_people() -> None:
    world = two_rooms()
    first, second = people_in(world, count=2), people_in(world, count=2)
    for _ in range(100):
        first.step(0.1, [FAR_AWAY], 0.22)
        second.step(0.1, [FAR_AWAY], 0.22)
    assert (first.discs == second.discs).all()
