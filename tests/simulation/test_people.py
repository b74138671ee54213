"""People who walk in a place, around a robot that stands in their way."""

from __future__ import annotations

import math

import numpy as np
import pytest
from scipy.sparse.csgraph import dijkstra

from surveillance_simulation.robot.robot import Robot
from surveillance_simulation.world.people import People, PeopleModel, _WalkingPaths
from surveillance_simulation.world.simulated_place import SimulatedPlace
from tests.places import seven_rooms, two_rooms

FAR_AWAY = (100.0, 100.0)


def people_in(world: SimulatedPlace, seed: int = 1, **model: object) -> People:
    return People(world.plan, PeopleModel(**model), np.random.default_rng(seed))  # type: ignore[arg-type]


def test_they_walk_from_room_to_room_and_through_no_wall() -> None:
    world = seven_rooms()
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


def straight_costs(world: SimulatedPlace, reach: float) -> tuple[np.ndarray, np.ndarray]:
    """Return which cells of .1 m people may be in, and the cost of each: the plain way."""
    rows, columns = 20, 60
    free, cost = np.zeros((rows, columns), bool), np.full((rows, columns), np.inf)
    for row in range(rows):
        for column in range(columns):
            clear = world.wall_clearance((column + 0.5) * 0.1, (row + 0.5) * 0.1)
            free[row, column] = clear >= reach
            cost[row, column] = 1.0 + 2.0 * min(max(1.0 - (clear - reach) / 0.5, 0.0), 1.0)
    return free, cost


def test_the_way_that_is_left_is_the_shortest_one_that_keeps_off_the_walls() -> None:
    """Beside Dijkstra's search of SciPy over the cells of the two rooms."""
    world = two_rooms()
    paths = _WalkingPaths(world.plan, 0.28)
    free, cost = straight_costs(world, 0.28)
    number = np.arange(free.size).reshape(free.shape)
    edges: list[tuple[int, int, float]] = []
    for down, right in ((0, 1), (1, 0), (1, 1), (1, -1)):
        for row in range(free.shape[0] - down):
            for column in range(max(0, -right), free.shape[1] - max(0, right)):
                here, there = (row, column), (row + down, column + right)
                if free[here] and free[there]:
                    length = math.hypot(down, right) * (cost[here] + cost[there]) / 2.0
                    edges.append((int(number[here]), int(number[there]), length))
    graph = np.zeros((free.size, free.size))
    for start, end, length in edges:
        graph[start, end] = length
    for goal in ('A', 'B'):
        x, y = paths.point(goal)
        cell = int(number[int(y / 0.1 + 1e-9), int(x / 0.1 + 1e-9)])
        expected = dijkstra(graph, directed=False, indices=np.array([cell]))[0].reshape(free.shape)
        for row, column in np.argwhere(np.isfinite(expected))[::7]:
            at = (column + 0.5) * 0.1, (row + 0.5) * 0.1
            assert paths.is_free(at)
            assert paths.left(goal, at) == pytest.approx(0.1 * expected[row, column], rel=1e-3)
        for row, column in np.argwhere(~free)[::11]:
            assert not paths.is_free(((column + 0.5) * 0.1, (row + 0.5) * 0.1))
    assert not paths.is_free((-1.0, 1.0))


def test_who_follows_the_way_comes_nearer_with_each_step_and_ends_at_the_point() -> None:
    paths = _WalkingPaths(two_rooms().plan, 0.3)
    at, before = (0.6, 1.6), math.inf
    for _ in range(60):
        ahead = paths.direction('B', at)
        at = at[0] + 0.1 * math.cos(ahead), at[1] + 0.1 * math.sin(ahead)
        assert paths.is_free(at)
        if math.dist(at, (5.0, 1.0)) < 0.1:
            break
        left = paths.left('B', at)
        assert left < before + 0.02
        before = left
    assert math.dist(at, (5.0, 1.0)) < 0.1
    assert paths.direction('B', (5.04, 1.0)) == pytest.approx(math.pi, abs=0.8)


@pytest.mark.parametrize(('speed', 'dt'), [(1.2, 0.1), (0.5, 0.05)])
def test_they_walk_at_their_speed_and_rest_as_long_as_they_are_told(
    speed: float, dt: float
) -> None:
    people = people_in(
        two_rooms(), count=1, speed=speed, shortest_rest=3.0, longest_rest=4.0, radius=0.2
    )
    assert people.discs[0, 2] == 0.2
    before, still, rests = people.poses[0], 0.0, []
    for _ in range(round(90.0 / dt)):
        people.step(dt, [FAR_AWAY], 0.22)
        after = people.poses[0]
        gone = math.dist(after[:2], before[:2])
        if gone:
            assert gone == pytest.approx(speed * dt)
            turned = math.atan2(after[1] - before[1], after[0] - before[0])
            assert math.remainder(turned - after[3], math.tau) == pytest.approx(0.0, abs=1e-6)
            if still > 1.0:
                rests.append(still)
            still = 0.0
        else:
            still += dt
        before = after
    assert len(rests) >= 5
    assert all(3.0 - 2 * dt <= each <= 4.0 + 2 * dt for each in rests)


@pytest.mark.parametrize(('manner', 'patience'), [('polite', 2.0), ('pushy', 6.0)])
def test_who_cannot_go_on_turns_to_another_room_after_a_while(manner: str, patience: float) -> None:
    world = two_rooms()
    door = world.plan.doors['D']
    people = people_in(world, count=1, manner=manner, shortest_rest=500.0, longest_rest=500.0)
    x = float(people.discs[0, 0])
    assert math.dist((x, 1.0), world.plan.start[:2]) > 1.5, 'nobody begins at the robot'
    (person,) = people._people
    person.goal, person.at, person.stop_before = 'A', (4.5, 1.0), 0.1
    person.nearest, person.rest = math.inf, 0.0
    held, steps = 0.0, 0
    while person.goal == 'A' and steps < 400:
        people.step(0.1, [(door.x, door.y)], 0.22)
        held, steps = max(held, person.held_up), steps + 1
    assert person.goal == 'B'
    assert held == pytest.approx(patience - 0.1, abs=0.21)
    assert person.held_up == 0.0
    assert 0.3 <= person.stop_before <= 1.5


def test_people_have_as_many_rows_as_there_are_people() -> None:
    nobody = people_in(two_rooms(), count=0)
    nobody.step(0.1, [FAR_AWAY], 0.22)
    assert nobody.discs.shape == (0, 3)
    assert nobody.poses.shape == (0, 4)
    some = people_in(two_rooms(), count=3)
    assert some.discs.shape == (3, 3)
    assert (some.poses[:, :3] == some.discs).all()
