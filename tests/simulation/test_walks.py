"""Who walks a given way."""

from __future__ import annotations

import math

import pytest

from floor_plans import PlaceError
from surveillance_simulation.robot.robot import Robot
from surveillance_simulation.world.simulated_place import SimulatedPlace
from surveillance_simulation.world.walks import Walks
from tests.places import two_rooms

NOBODY: list[tuple[float, float]] = []


def spot(world: SimulatedPlace) -> tuple[float, float, int]:
    """Return where the only person is, and where they look, degrees."""
    (person,) = world.people
    return round(person.x, 3), round(person.y, 3), round(math.degrees(person.yaw)) % 360


def test_a_bent_way_is_walked_there_and_back_again() -> None:
    world = two_rooms()
    walks = Walks(world)
    walks.begin('p', ((0.5, 0.5), (1.5, 0.5), (1.5, 1.5)))
    assert len(walks) == 1
    assert spot(world) == (0.5, 0.5, 0)
    seen = []
    for _ in range(9):
        walks.step(0.5, NOBODY)
        seen.append(spot(world))
    assert seen[:3] == [(1.0, 0.5, 0), (1.5, 0.5, 0), (1.5, 1.0, 90)]
    assert seen[4:] == [
        (1.5, 1.0, 270),
        (1.5, 0.5, 180),
        (1.0, 0.5, 180),
        (0.5, 0.5, 0),
        (1.0, 0.5, 0),
    ]
    assert seen[3][:2] == (1.5, 1.5)
    walks.end('p')
    walks.end('nobody')
    walks.step(0.5, NOBODY)
    assert len(walks) == 0
    assert spot(world) == (1.0, 0.5, 0)


def test_who_walks_waits_before_a_robot_and_may_leave_one() -> None:
    world = two_rooms()
    walks = Walks(world)
    walks.begin('p', ((0.5, 1.0), (2.5, 1.0)))
    for _ in range(20):
        walks.step(0.1, [(2.0, 1.0)])
    assert spot(world)[0] == pytest.approx(1.2)
    for _ in range(5):
        walks.step(0.1, NOBODY)
    assert spot(world)[0] == pytest.approx(1.7)
    # Nearer than they would come by themselves: away from it they go.
    walks.step(0.1, [(1.4, 1.0)])
    assert spot(world)[0] == pytest.approx(1.8)
    walks.step(0.1, [(2.1, 1.0)])
    assert spot(world)[0] == pytest.approx(1.8)


@pytest.mark.parametrize(
    ('points', 'text'),
    [
        (((0.5, 0.5),), "person 'p': expected two different points or more"),
        (((0.5, 0.5), (0.5, 0.5)), "person 'p': expected two different points or more"),
        (
            ((2.0, 0.3), (4.0, 0.3)),
            "person 'p': a wall or a leaf is in the way at (2.8, 0.3)",
        ),
        (((0.5, 0.15), (1.0, 0.15)), 'in the way at (0.5, 0.1)'),
    ],
)
def test_a_way_that_nobody_can_walk_is_refused(
    points: tuple[tuple[float, float], ...], text: str
) -> None:
    world = two_rooms()
    with pytest.raises(PlaceError) as found:
        Walks(world).begin('p', points)
    assert text in str(found.value)
    assert not world.people


@pytest.mark.parametrize(
    ('seconds', 'steps'), [(0.01, 1), (0.05, 1), (0.051, 2), (0.1, 2), (0.15, 3), (0.0, 1)]
)
def test_time_goes_on_in_steps_of_a_twentieth_of_a_second(
    monkeypatch: pytest.MonkeyPatch, seconds: float, steps: int
) -> None:
    robot, passed = Robot(two_rooms()), list[float]()
    monkeypatch.setattr(robot.base, 'step', passed.append)
    robot.advance(seconds)
    assert passed == pytest.approx([seconds / steps] * steps)
    assert robot.time == pytest.approx(seconds)
