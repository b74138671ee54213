"""Doors from sweeps: leaves at all angles, from many places, with noise and things in the way."""

from __future__ import annotations

import itertools
import math

import numpy as np
import pytest

from indoor_watch.doors import DoorState, read_door

WALL = 0.0
DOOR = (-0.45, WALL, 0.45, WALL)


def sweep(
    sensor: tuple[float, float],
    lines: list[tuple[float, float, float, float]],
    noise: float = 0.02,
    beams: int = 360,
    seed: int = 1,
    farthest: float = 12.0,
) -> np.ndarray:
    """Return where beams end that meet segments; exact geometry, written without the module."""
    generator = np.random.default_rng(seed)
    angles = np.linspace(-math.pi, math.pi, beams, endpoint=False)
    rays = np.stack([np.cos(angles), np.sin(angles)], axis=1)
    # Each ray with each segment: sensor + distance * ray = start + part * along.
    start, end = np.split(np.array(lines), 2, axis=1)
    along, apart = end - start, start - sensor
    determinant = rays[:, [1]] * along[:, 0] - rays[:, [0]] * along[:, 1]
    with np.errstate(divide='ignore', invalid='ignore'):
        distance = (along[:, 0] * apart[:, 1] - along[:, 1] * apart[:, 0]) / determinant
        part = (rays[:, [0]] * apart[:, 1] - rays[:, [1]] * apart[:, 0]) / determinant
    meets = (abs(determinant) >= 1e-12) & (distance > 0) & (part >= 0) & (part <= 1)
    nearest = np.where(meets, distance, farthest).min(axis=1)
    met = nearest < farthest
    nearest[met] += generator.normal(0, noise, np.count_nonzero(met))
    return np.asarray(sensor + rays * nearest[:, None])


def rooms(
    angle: float | None, hinge: int = 0, side: int = 1
) -> list[tuple[float, float, float, float]]:
    """Return two rooms with a door between them, its leaf at an angle, degrees; None: none."""
    lines = [
        (-4.0, WALL, DOOR[0], WALL),
        (DOOR[2], WALL, 4.0, WALL),
        (-4.0, -3.0, 4.0, -3.0),
        (-4.0, 4.0, 4.0, 4.0),
        (-4.0, -3.0, -4.0, 4.0),
        (4.0, -3.0, 4.0, 4.0),
    ]
    if angle is not None:
        start = DOOR[:2] if hinge == 0 else DOOR[2:]
        direction = 0.0 if hinge == 0 else math.pi
        turned = direction + side * math.radians(angle)
        end = (start[0] + 0.9 * math.cos(turned), start[1] + 0.9 * math.sin(turned))
        lines.append((*start, *end))
    return lines


SENSORS = [(0.0, -1.5), (1.2, -1.0), (-1.5, -2.0), (0.6, 2.5), (-2.0, 1.5)]


@pytest.mark.parametrize('sensor', SENSORS)
@pytest.mark.parametrize(
    ('angle', 'state'), [(0.0, 'closed'), (2.0, 'closed'), (85.0, 'open'), (None, 'open')]
)
def test_open_and_closed_doors_are_told_from_both_rooms(sensor, angle, state):
    for hinge, side, seed in itertools.product((0, 1), (1, -1), range(3)):
        reading = read_door(DOOR, sensor, sweep(sensor, rooms(angle, hinge, side), seed=seed))
        assert reading is not None
        assert reading.state == state
        assert reading.confidence > 0.8


def test_a_door_ajar_is_never_closed_and_mostly_told():
    """A leaf that is seen along its edge cannot be told from one that stands open."""
    told = []
    for sensor, angle, hinge, side in itertools.product(SENSORS, (25.0, 40.0), (0, 1), (1, -1)):
        reading = read_door(DOOR, sensor, sweep(sensor, rooms(angle, hinge, side)))
        assert reading is not None
        assert reading.state != DoorState.CLOSED
        told.append(reading.state == DoorState.AJAR)
    assert sum(told) >= 0.75 * len(told)


def test_a_door_behind_something_is_not_judged():
    sensor = (0.0, -2.0)
    shelf = (-1.5, -1.6, 1.5, -1.6)
    assert read_door(DOOR, sensor, sweep(sensor, [*rooms(0.0), shelf])) is None


def test_a_door_out_of_range_or_out_of_sight_is_not_judged():
    far = (0.0, -40.0)
    assert read_door(DOOR, far, sweep(far, rooms(0.0))) is None
    flat = (-3.9, -0.02)
    reading = read_door(DOOR, flat, sweep(flat, rooms(0.0)))
    assert reading is None or reading.confidence < 0.9


def test_no_beams_are_no_reading():
    assert read_door(DOOR, (0.0, -1.0), np.zeros((0, 2))) is None
    assert read_door(DOOR, (0.0, -1.0), np.full((9, 2), np.nan)) is None


def test_a_pose_that_is_off_by_a_hand_still_tells_open_from_closed():
    sensor = (0.3, -1.8)
    for angle, state in ((0.0, DoorState.CLOSED), (None, DoorState.OPEN)):
        ends = sweep(sensor, rooms(angle)) + np.array([0.03, 0.05])
        reading = read_door(DOOR, (sensor[0] + 0.03, sensor[1] + 0.05), ends)
        assert reading is not None
        assert reading.state == state
