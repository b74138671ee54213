"""Who walks a given way, and places whose lamp is not as by day."""

from __future__ import annotations

import math

import numpy as np
import pytest

from floor_plans import PlaceError
from surveillance_simulation.camera.lamps import LampLight
from surveillance_simulation.camera.model import Array, Camera
from surveillance_simulation.robot.robot import Robot
from surveillance_simulation.world.simulated_place import SimulatedPlace
from surveillance_simulation.world.walks import Walks

from .places import TWO_ROOMS, two_rooms

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


def looking_down(x: float, y: float) -> Array:
    """Return the pose of a camera 2 m above the floor that looks down; its top is the north."""
    pose = np.eye(4)
    pose[:3, :3] = [[1.0, 0.0, 0.0], [0.0, -1.0, 0.0], [0.0, 0.0, -1.0]]
    pose[:3, 3] = x, y, 2.0
    return pose


def seen_light(light: LampLight, x: float, y: float) -> np.ndarray:
    """Return how bright a floor of brightness 1 is in a picture of 3 x 3 pixels, 0.1 m each."""
    camera = Camera(3, 3, 20.0)
    floor = np.ones((3, 3, 3), np.float32)
    nearness = np.full((3, 3), 0.5, np.float32)
    return light.shine(floor, nearness, camera, looking_down(x, y))[..., 0]


def test_each_place_has_the_light_of_its_own_lamp() -> None:
    world = SimulatedPlace.from_parameters(TWO_ROOMS)
    assert LampLight.of(world, None) is None
    world.set_lamp('A', 0.3)
    world.set_door('D', is_open=False)
    light = LampLight.of(world, None)
    assert light is not None
    assert LampLight.of(world, light) is light
    assert seen_light(light, 1.0, 1.0) == pytest.approx(np.full((3, 3), 0.3), abs=1e-4)
    assert seen_light(light, 5.0, 1.0) == pytest.approx(np.ones((3, 3)), abs=1e-4)
    assert seen_light(light, 90.0, 1.0) == pytest.approx(np.ones((3, 3)), abs=1e-4)
    world.set_lamp('A', 0.0)
    dark = LampLight.of(world, light)
    assert dark is not None
    assert dark is not light
    assert seen_light(dark, 1.0, 1.0) == pytest.approx(np.full((3, 3), 0.02)), 'some is left'


def test_through_an_open_door_light_comes_as_far_as_a_metre() -> None:
    world = SimulatedPlace.from_parameters(TWO_ROOMS)
    world.set_lamp('A', 0.2)
    world.set_door('D', is_open=False)
    closed = LampLight.of(world, None)
    assert closed is not None
    beside, away, bright = (2.8, 1.0), (1.5, 1.0), (3.2, 1.0)
    assert seen_light(closed, *beside)[1, 1] == pytest.approx(0.2, abs=0.01)
    world.set_door('D', is_open=True)
    open_door = LampLight.of(world, closed)
    assert open_door is not None
    assert open_door is not closed
    assert 0.22 < seen_light(open_door, *beside)[1, 1] < 0.6
    assert 0.6 < seen_light(open_door, *bright)[1, 1] < 0.95
    assert seen_light(open_door, *away)[1, 1] == pytest.approx(0.2, abs=0.01)
    assert seen_light(open_door, 2.4, 1.0)[1, 1] == pytest.approx(0.2, abs=1e-4)
    assert seen_light(open_door, 2.8, 0.2)[1, 1] < 0.3, 'beside the door the wall keeps it out'
