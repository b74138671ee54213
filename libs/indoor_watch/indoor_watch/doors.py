"""Whether a door is open, closed or ajar, from one sweep of a lidar.

A door is a leaf that turns about one of its two jambs. For each hinge and each angle it is known
what a beam would measure: the leaf, or what lies behind the opening. The angle that explains the
beams best is the door's. Beams that end well before the door say nothing: something else is in the
way. A door of which too little was in view is not judged.

The model of a beam is that of a likelihood field (Thrun, Burgard and Fox, Probabilistic Robotics,
chapter 6.3): an error that is normal near what is expected, and a floor for everything else.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from enum import StrEnum
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

Points = NDArray[np.float64]
Segment = tuple[float, float, float, float]

DEVIATION = 0.05
"""Of a measured end from where it is expected, metres: noise, the pose's error, a leaf's depth."""
FLOOR = 0.05
"""Likelihood of a beam that fits no state of the door; 1 is that of a beam that fits."""
CLOSE_BEHIND = 0.2
"""Likelihood that something stands within a leaf's reach behind the opening."""
LEAST_BEAMS = 6
"""Beams on the opening without which nothing is said."""
CLOSED_BELOW, OPEN_FROM = math.radians(7.0), math.radians(60.0)
"""Angles of the leaf, radians; between them it is ajar."""
STEP = math.radians(3.0)
"""Between the angles that are tried: the edge of a leaf of 1 m moves by `DEVIATION` then, rad."""
WIDEST = math.radians(120.0)
"""A leaf farther open stands at the wall, and is taken for a door without one, rad."""
_ANGLES = np.arange(0.0, WIDEST + STEP / 2, STEP)


class DoorState(StrEnum):
    """What a door looks like."""

    OPEN = 'open'
    CLOSED = 'closed'
    AJAR = 'ajar'


@dataclass(frozen=True)
class DoorReading:
    """What a sweep says of a door.

    Attributes:
        state: The state that explains the beams best.
        confidence: Its probability among the three, 0.33 to 1.
        angle: Of the leaf from the closed position, radians; inf where no leaf is to be seen.
        beams: How many beams there were to judge by.
    """

    state: DoorState
    confidence: float
    angle: float
    beams: int


def read_door(door: Segment, sensor: tuple[float, float], ends: Points) -> DoorReading | None:
    """Return what a sweep says of a door; None where too little of it was in view.

    Args:
        door: The opening between the jambs: x1, y1, x2, y2, map frame, metres.
        sensor: Where the lidar was, same frame.
        ends: Where its beams ended, (n, 2), same frame; a beam that met nothing ends at its
            greatest range.
    """
    first, second = np.asarray(door[:2], float), np.asarray(door[2:], float)
    width = float(np.linalg.norm(second - first))
    origin = np.asarray(sensor, float)
    rays = np.asarray(ends, float) - origin
    ranges = np.linalg.norm(rays, axis=1)
    usable = np.isfinite(ranges) & (ranges > 1e-3)
    rays, ranges = rays[usable] / ranges[usable, None], ranges[usable]
    to_line, along = _crossings(origin, rays, first, second)
    # The outermost tenth on either side belongs to the jambs.
    through = np.isfinite(to_line) & (along > 0.1) & (along < 0.9)
    # What ends farther before the opening than the leaf can reach is hidden by something else.
    seen = through & (ranges > to_line - width)
    if seen.sum() < LEAST_BEAMS or np.ptp(along[seen]) < 0.4:
        return None
    # Also beams beside the opening may meet an open leaf: all that come as near as it reaches.
    near = seen | (_passes(origin, rays, ranges, first, width) & (ranges > 0.3))
    measured = Beams(rays[near], ranges[near], to_line[near], seen[near], width)
    fits: dict[DoorState, list[tuple[float, float]]] = {state: [] for state in DoorState}
    for hinge, other in ((first, second), (second, first)):
        for side in (1.0, -1.0):
            worths = measured.fits(hinge - origin, _turned(other - hinge, side * _ANGLES))
            for angle, worth in zip(_ANGLES.tolist(), worths.tolist(), strict=True):
                fits[_state(angle)].append((worth, angle))
    # A door without a leaf, or one that is folded away: as likely as all open leaves together.
    none = float(measured.without_leaf.sum()), math.inf
    fits[DoorState.OPEN] += [none] * len(fits[DoorState.OPEN])
    # Each state is worth the mean over its angles, not the best of them: nearly every sweep fits
    # some leaf that is seen along its edge. Neighbouring beams share errors: two of three count.
    best = max(fit for state in DoorState for fit, _ in fits[state])
    worth = np.array(
        [np.mean([math.exp((fit - best) / 1.5) for fit, _ in fits[state]]) for state in DoorState]
    )
    state = list(DoorState)[int(worth.argmax())]
    angle = max(fits[state], key=lambda each: each[0])[1]
    return DoorReading(state, float(worth.max() / worth.sum()), angle, int(seen.sum()))


def _state(angle: float) -> DoorState:
    if angle < CLOSED_BELOW:
        return DoorState.CLOSED
    return DoorState.OPEN if angle >= OPEN_FROM else DoorState.AJAR


def _turned(vector: Points, angles: Points) -> Points:
    """Return a vector turned by each of some angles, (angles, 2)."""
    cosine, sine = np.cos(angles), np.sin(angles)
    return np.stack(
        [cosine * vector[0] - sine * vector[1], sine * vector[0] + cosine * vector[1]], axis=1
    )


def _crossings(origin: Points, rays: Points, start: Points, end: Points) -> tuple[Points, Points]:
    """Return how far along each ray a line is met, inf behind it, and where along the line."""
    line, offset = end - start, start - origin
    cross = rays[:, 0] * line[1] - rays[:, 1] * line[0]
    with np.errstate(divide='ignore', invalid='ignore'):
        distance = (offset[0] * line[1] - offset[1] * line[0]) / cross
        part = (offset[0] * rays[:, 1] - offset[1] * rays[:, 0]) / cross
    ahead = np.isfinite(distance) & (distance > 0.0)
    return np.where(ahead, distance, np.inf), np.where(ahead, part, np.inf)


def _passes(
    origin: Points, rays: Points, ranges: Points, centre: Points, radius: float
) -> NDArray[np.bool_]:
    """Tell which beams come nearer to a point than a radius."""
    along = np.clip((centre - origin) @ rays.T, 0.0, ranges)
    nearest = origin + rays * along[:, None]
    return np.asarray(np.linalg.norm(nearest - centre, axis=1) < radius)


@dataclass(frozen=True)
class Beams:
    """What was measured near a door.

    Attributes:
        rays: The beams' directions, (n, 2), of length 1.
        ranges: What was measured, (n,), metres.
        to_line: How far the opening's line is along each beam, (n,), metres.
        through: Whether a beam goes through the opening, (n,).
        width: Of the leaf, metres.
    """

    rays: Points
    ranges: Points
    to_line: Points
    through: NDArray[np.bool_]
    width: float

    @cached_property
    def without_leaf(self) -> Points:
        """The logarithm of the likelihood of each beam if it meets no leaf, (n,)."""
        beyond = self.ranges - np.where(np.isfinite(self.to_line), self.to_line, 0.0)
        # What stands just behind the opening may be a leaf, or a shelf: a leaf that fits wins.
        passed = np.where(beyond > self.width, 1.0, CLOSE_BEHIND)
        free = np.where(self.through, np.where(beyond > 2 * DEVIATION, passed, 0.0), 1.0)
        return np.asarray(np.log(FLOOR + (1.0 - FLOOR) * free))

    def fits(self, hinge: Points, leaves: Points) -> Points:
        """Return the logarithm of the likelihood of all beams for each leaf, (leaves,).

        Args:
            hinge: Where the leaves turn, from the lidar, metres.
            leaves: From the hinge to their other ends, (leaves, 2), metres.
        """
        # Where beams cross the leaves' lines: row per leaf, column per beam.
        cross = np.outer(leaves[:, 1], self.rays[:, 0]) - np.outer(leaves[:, 0], self.rays[:, 1])
        beside = hinge[0] * self.rays[:, 1] - hinge[1] * self.rays[:, 0]
        with np.errstate(divide='ignore', invalid='ignore'):
            expected = (hinge[0] * leaves[:, 1] - hinge[1] * leaves[:, 0])[:, None] / cross
            part = beside / cross
        meets = np.isfinite(expected) & (expected > 0.0) & (part >= 0.0) & (part <= 1.0)
        # The exponential is worth its time only for the few beams that meet a leaf.
        leaf, beam = np.nonzero(meets)
        error = self.ranges[beam] - expected[meets]
        hit = np.exp(-0.5 * np.square(error / DEVIATION))
        # Something nearer may hide the leaf: no more likely and no less than without it.
        likelihood = np.where(error < -4 * DEVIATION, 0.0, hit)
        gain = np.log(FLOOR + (1.0 - FLOOR) * likelihood) - self.without_leaf[beam]
        gains = np.bincount(leaf, gain, minlength=len(leaves))
        return np.asarray(self.without_leaf.sum() + gains)
