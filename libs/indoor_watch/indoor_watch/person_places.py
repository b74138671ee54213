"""Where in the room somebody stands whom a picture shows, by what the lidar meets there.

Whoever stands on the floor has legs, and a lidar near the floor meets them, or a thing that hides
them. Of what it meets in the direction of a find, and is no wall, that is taken which is as large
as a person at its distance, and the nearest of these.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from indoor_watch.hung_markers import CameraView
from indoor_watch.persons import Person

Array = NDArray[np.float64]

SLACK = 0.05
"""The direction of a find may be off by so much to each side, rad."""
LEAST_HEIGHT, MOST_HEIGHT = 0.4, 2.4
"""What a picture shows of a person is so tall, metres; somebody may sit, or reach out of it."""
HIGHEST_FOOT = 1.3
"""And begins at most so high above the floor, metres: a table may hide the rest."""
FEWEST_BEAMS, BEYOND = 3, (0.5, 1.3)
"""So many beams have to go so far beyond a person's feet: metres, and a factor of their distance,
as a degree of the camera's pitch is a third of it at 4 m and 0.9 m of height."""
TOGETHER, FEWEST = 0.4, 2
"""Ends so near to each other, metres, are of one thing, which has so many."""


def place_of(person: Person, camera: CameraView, met: Array) -> tuple[float, float] | None:
    """Return where a person stands, map frame, metres; None where that is not known.

    Args:
        person: What was found in the picture.
        camera: From where it was taken.
        met: Where the beams of a sweep at that time ended, without walls, (n, 2), map frame.
    """
    left, top, width, height = person.box
    x = left + width / 2
    pixels = [[x, top + height, 1.0], [x, top, 1.0], [left, top, 1.0], [left + width, top, 1.0]]
    lines = np.array(pixels) @ np.linalg.inv(camera.matrix).T @ camera.pose[:3, :3].T
    flat = np.hypot(lines[:, 0], lines[:, 1])
    if (flat < 0.2 * np.linalg.norm(lines, axis=1)).any() or not len(met):
        return None  # the camera looks up, or down
    bearings = np.arctan2(lines[:, 1], lines[:, 0])
    half = abs(math.remainder(float(bearings[2] - bearings[3]), math.tau)) / 2.0
    offsets = met - camera.at[:2]
    turned = np.arctan2(offsets[:, 1], offsets[:, 0]) - bearings[0]
    away = np.abs((turned + math.pi) % math.tau - math.pi)
    found = []
    for thing in _things(met[away <= half + SLACK]):
        distance = float(np.median(np.hypot(*(thing - camera.at[:2]).T)))
        foot, head = (camera.at[2] + distance * lines[:2, 2] / flat[:2]).tolist()
        if LEAST_HEIGHT <= head - foot <= MOST_HEIGHT and foot <= HIGHEST_FOOT:
            spot = thing.mean(axis=0)
            found.append((distance, float(spot[0]), float(spot[1])))
    return min(found)[1:] if found else None


def is_passed(person: Person, camera: CameraView, ends: Array, rows: int) -> bool:
    """Tell whether the lidar saw through where a person would stand: then nobody does.

    Feet that a picture shows stand on the floor, where a lidar near the floor meets legs. Beams
    that go on far beyond them say that it is a picture on a wall, a reflection, or no person. What
    is nearer may hide legs, and says nothing.

    Args:
        person: What was found in the picture.
        camera: From where it was taken.
        ends: Where the beams of a sweep at that time ended, (n, 2), map frame.
        rows: Of the picture: of who is cut off at its lower edge the feet are not known.
    """
    left, top, width, height = person.box
    if top + height >= rows - 2 or not len(ends):
        return False
    pixels = [[left + width / 2, top + height, 1.0], [left, top, 1.0], [left + width, top, 1.0]]
    lines = np.array(pixels) @ np.linalg.inv(camera.matrix).T @ camera.pose[:3, :3].T
    if lines[0, 2] >= -1e-6:
        return False  # the feet are above the horizon
    distance = float(camera.at[2] / -lines[0, 2] * np.hypot(*lines[0, :2]))
    bearings = np.arctan2(lines[:, 1], lines[:, 0])
    half = abs(math.remainder(float(bearings[1] - bearings[2]), math.tau)) / 4.0
    offsets = ends - camera.at[:2]
    turned = np.arctan2(offsets[:, 1], offsets[:, 0]) - bearings[0]
    away = np.abs((turned + math.pi) % math.tau - math.pi)
    through = np.hypot(*offsets[away <= half].T)
    return bool(len(through) >= FEWEST_BEAMS and through.min() > BEYOND[0] + BEYOND[1] * distance)


def _things(points: Array) -> list[Array]:
    """Return groups of ends that lie together, in the order of the beams, which begin anywhere."""
    if len(points) < FEWEST:
        return []
    steps = np.hypot(*np.diff(points, axis=0).T)
    groups = np.split(points, np.flatnonzero(steps > TOGETHER) + 1)
    if len(groups) > 1 and math.dist(points[0], points[-1]) <= TOGETHER:
        groups = [np.concatenate([groups[-1], groups[0]]), *groups[1:-1]]
    return [each for each in groups if len(each) >= FEWEST]
