"""From where a room is to be looked at, so that its floor is in view: a cover by few viewpoints.

Each candidate is a point where the robot can stand, and what is in view from it follows from beams
that end at walls. The viewpoint that shows most of what no other shows comes first, and so on: for
covering that greedy choice is never much worse than the best one (Chvatal 1979). What a person's
rules ask for weighs more than floor.
"""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray
from scipy import ndimage

from floor_plans import Grid
from floor_plans.occupancy_grid import distance_to
from floor_plans.visibility import in_view

Mask = NDArray[np.bool_]
Spot = tuple[float, float]

RANGE = 6.0
"""So far a viewpoint shows the floor, metres."""
ENOUGH = 0.95
"""When this part of the floor is covered, no further viewpoint is needed."""
LEAST_GAIN = 0.04
"""A viewpoint that adds less, as a part of the floor, is left out."""
MOST_VIEWPOINTS = 4
"""Beside a room's own point: more there is no time for in a stay."""
SPACING = 0.6
"""Between candidates, metres."""
MOST_CANDIDATES = 40
"""Bounds the work in a hall: the candidates are spaced wider until they are so few."""
BEAMS = 240
"""Of what a candidate sees: at `RANGE` they are 16 cm apart, less than a thing's side."""
CHECK_WEIGHT = 0.1
"""A check of this room weighs as much as this part of its floor."""
CHECK_RANGE = 3.0
"""A check is looked at from so near, metres."""
READ_FROM, READ_UP_TO, READ_WITHIN = 0.8, 2.2, 1.05
"""A marker of 0.2 m is read from so near up to so far, metres, and so far from straight ahead,
rad: so it can also be called gone (`hung_markers`)."""
BEST_READ = 1.5
"""From here it is read best, metres."""
ASIDE = 1.0
"""A second look is taken from so far from the first one, metres, at least."""


class Viewpoints:
    """Chooses viewpoints on a map.

    Args:
        grid: The map with its doors open.
        radius: Of the robot, metres.
    """

    def __init__(self, grid: Grid, radius: float) -> None:
        self._grid = grid
        walls = distance_to(grid.occupied, grid.resolution)
        self._standable = np.asarray(grid.free & (walls > radius + 0.1), np.bool_)

    def of_room(self, floor: Mask, first: Spot, checks: Sequence[Spot] = ()) -> list[Spot]:
        """Return from where else than its point a room is to be looked at, the best first.

        Args:
            floor: The room's cells.
            first: Its point, from which it is looked at anyway, map frame, metres.
            checks: What a person wants to know of in it, same frame; seen from the first points.
        """
        total = max(1, int(floor.sum()))
        covered = self.seen_from(first) & floor
        open_checks = [each for each in checks if not self._shows(first, each)]
        shown = [(each, self.seen_from(each) & floor) for each in self._candidates(floor)]
        found: list[Spot] = []
        while len(found) < MOST_VIEWPOINTS and shown:
            gains = [
                float((seen & ~covered).sum()) / total
                + CHECK_WEIGHT * sum(self._shows(spot, each) for each in open_checks)
                for spot, seen in shown
            ]
            best = int(np.argmax(gains))
            is_enough = float(covered.sum()) >= ENOUGH * total
            if gains[best] < LEAST_GAIN or (is_enough and not open_checks):
                break
            spot, seen = shown[best]
            if is_enough and gains[best] < CHECK_WEIGHT:
                break
            found.append(spot)
            covered |= seen
            open_checks = [each for each in open_checks if not self._shows(spot, each)]
        return found

    def of_panel(
        self, floor: Mask, first: Spot, panel: Spot, facing: float | None, scale: float = 1.0
    ) -> Spot | None:
        """Return from where in a room a panel on its wall is to be read; None: from nowhere.

        Args:
            floor: The room's cells.
            first: Its point, which is as good as any from where the panel can be read.
            panel: Where it hangs, map frame, metres.
            facing: Where it looks to, same frame, rad; None: nobody knows.
            scale: How much larger it is than a marker of 0.2 m.
        """

        def reads(spot: Spot) -> bool:
            return self.reads_panel(spot, panel, facing, scale)

        if reads(first):
            return first

        def cost(spot: Spot) -> float:
            turn = (
                0.0 if facing is None else math.remainder(_bearing(panel, spot) - facing, math.tau)
            )
            return abs(math.dist(spot, panel) - BEST_READ * scale) + abs(turn)

        return min(filter(reads, self._candidates(floor)), key=cost, default=None)

    def reads_panel(
        self, spot: Spot, panel: Spot, facing: float | None, scale: float = 1.0
    ) -> bool:
        """Tell whether a panel can be read from a point, and called gone; see `of_panel`."""
        near, far = READ_FROM * min(1.0, scale), READ_UP_TO * scale
        turn = 0.0 if facing is None else _bearing(panel, spot) - facing
        return (
            near <= math.dist(spot, panel) <= far
            and abs(math.remainder(turn, math.tau)) <= READ_WITHIN
            and self._shows(spot, panel, far)
        )

    def aside(self, floor: Mask, thing: Spot, seen_from: Spot) -> Spot | None:
        """Return from where to look again at a thing; None where there is no other such place.

        Args:
            floor: The cells of the room to stand in.
            thing: What is looked at, map frame, metres.
            seen_from: From where it was seen first.
        """
        best: tuple[float, Spot] | None = None
        for spot in self._candidates(floor):
            away, near = math.dist(spot, seen_from), math.dist(spot, thing)
            if away < ASIDE or not 0.6 <= near <= RANGE or not self._shows(spot, thing, RANGE):
                continue
            # Another direction is worth a way; a near one is better than a far one.
            turn = abs(math.remainder(_bearing(thing, spot) - _bearing(thing, seen_from), math.tau))
            worth = turn - 0.15 * away - 0.15 * abs(near - 1.5)
            if best is None or worth > best[0]:
                best = worth, spot
        return None if best is None else best[1]

    def seen_from(self, spot: Spot) -> Mask:
        """Return the cells that are in view from a point."""
        seen = in_view(self._grid, spot, RANGE, beams=BEAMS)
        rows, columns = np.nonzero(seen)
        if not len(rows):
            return seen
        # Beams far out are a few cells apart.
        around = slice(rows.min(), rows.max() + 1), slice(columns.min(), columns.max() + 1)
        seen[around] |= ndimage.binary_closing(seen[around], np.ones((3, 3), np.bool_))
        return seen

    def _candidates(self, floor: Mask) -> list[Spot]:
        rows, columns = np.nonzero(floor & self._standable)
        if not len(rows):
            return []
        spacing = max(1, round(SPACING / self._grid.resolution))
        while True:
            chosen = (rows % spacing == 0) & (columns % spacing == 0)
            if chosen.sum() <= MOST_CANDIDATES:
                break
            spacing += max(1, spacing // 4)
        spots = self._grid.centres_of(np.stack([rows[chosen], columns[chosen]], axis=1))
        return [(float(x), float(y)) for x, y in spots.tolist()]

    def _shows(self, spot: Spot, thing: Spot, reach: float = CHECK_RANGE) -> bool:
        """Tell whether nothing stands between a point and a thing, up to its last 0.3 m."""
        away = math.dist(spot, thing)
        if away > reach:
            return False
        parts = np.arange(0.0, max(0.0, away - 0.3), self._grid.resolution / 2) / max(away, 1e-9)
        line = np.asarray(spot) + parts[:, None] * (np.asarray(thing) - np.asarray(spot))
        cells = self._grid.cells_of(line)
        return bool(self._grid.contains(cells).all()) and bool(
            self._grid.free[cells[:, 0], cells[:, 1]].all()
        )


def _bearing(origin: Spot, other: Spot) -> float:
    return math.atan2(other[1] - origin[1], other[0] - origin[0])
