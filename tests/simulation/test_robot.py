"""Paths and drives against the geometry itself, not against the grid they were planned on."""

from __future__ import annotations

import sys

import numpy as np
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st

from lidar_navigation import Drive, DriveState, GridPlanner, Navigator, NoPathError, geometry
from lidar_navigation.geometry import Scan
from surveillance_simulation.robot.robot import Robot
from surveillance_simulation.world.people import PeopleModel
from surveillance_simulation.world.simulated_place import SimulatedPlace
from tests.places import CONFIG, seven_rooms

sys.path.insert(0, str(CONFIG.parent / 'benchmarks'))

import navigation

pytestmark = pytest.mark.early

RADIUS = 0.22
DOORS = ('D1', 'D2', 'D3', 'D4', 'D5', 'D6', 'D7')
PLAN = seven_rooms().plan
points = st.tuples(st.floats(2.0, 18.0), st.floats(2.0, 18.0))


@pytest.fixture(scope='module')
def planner() -> GridPlanner:
    drawn = PLAN.grid()
    return GridPlanner(drawn)


@settings(max_examples=40)
@given(start=points, goal=points, closed=st.sets(st.sampled_from(DOORS), max_size=4))
def test_a_path_never_touches_a_wall_or_a_closed_door(
    planner: GridPlanner,
    start: tuple[float, float],
    goal: tuple[float, float],
    closed: set[str],
) -> None:
    world = SimulatedPlace(PLAN)
    for door in closed:
        world.set_door(door, False)
    planner.set_closed(
        {name: door.segment for name, door in world.plan.doors.items() if name in closed}
    )
    assume(world.is_free(*start, RADIUS + 0.05))
    try:
        path = planner.plan(start, goal)
    except NoPathError:
        return
    for x, y in geometry.equally_spaced(path, 0.02):
        assert world.is_free(float(x), float(y), RADIUS)


def driven(world: SimulatedPlace, seed: int, goals: list[str]) -> tuple[Robot, float]:
    """Drive through places on cores alone; return the robot and how far it left its paths."""
    robot = Robot(world, rng=np.random.default_rng(seed))
    drawn = world.plan.grid()
    grid = drawn
    planner, navigator = GridPlanner(grid), Navigator()
    navigator.set_map(grid)
    furthest = 0.0
    for goal in goals:
        path = planner.plan(robot.base.pose[:2], world.plan.place.positions[goal][:2])
        drive = navigator.task = Drive(path)
        line = geometry.equally_spaced(path, 0.02)
        navigator.move(robot.base.odometry)
        for _ in range(1200):
            if drive.state.ended:
                break
            scan = Scan(robot.lidar.angles, robot.scan().astype(float), robot.lidar.range_max)
            navigator.move(robot.base.odometry)
            velocity = navigator.see(scan, robot.time)
            assert velocity is not None
            robot.base.command(velocity.speed, velocity.turn)
            robot.advance(0.1)
            here = np.array(robot.base.pose[:2])
            furthest = max(furthest, float(np.hypot(*(line - here).T).min()))
        assert drive.state is DriveState.ARRIVED, drive.reason
    return robot, furthest


@pytest.mark.parametrize('seed', [1, 2, 3])
def test_a_drive_stays_in_the_corridor_around_its_path_and_arrives(seed: int) -> None:
    world = SimulatedPlace(PLAN)
    goals = [['R1', 'R4', 'E'], ['R3', 'C1', 'R2'], ['C2', 'E', 'R1']][seed - 1]
    robot, furthest = driven(world, seed, goals)
    assert robot.base.collisions == 0
    assert furthest < 0.2
    x, y, _ = world.plan.place.positions[goals[-1]]
    assert np.hypot(robot.base.pose[0] - x, robot.base.pose[1] - y) < 0.2


@pytest.mark.parametrize('manner', ['polite', 'pushy'])
def test_among_people_the_robot_touches_nobody_and_arrives(manner: str) -> None:
    did = navigation.among_people(PeopleModel(5, manner=manner), 90.0, 2, 'seven_rooms.yaml')
    assert did.contacts == 0
    assert did.drives >= 2
    assert did.arrived >= did.drives - 1
