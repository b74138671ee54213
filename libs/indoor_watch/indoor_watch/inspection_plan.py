"""From where each place is to be looked at, on a map: its viewpoints, what the rules ask for, and
again from another side.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from floor_plans.occupancy_grid import Grid
from indoor_watch.doors import Segment
from indoor_watch.events import Event
from indoor_watch.hung_markers import HungSpot
from indoor_watch.marker_checks import MarkerCheck, MarkerChecks
from indoor_watch.observations import Kind
from indoor_watch.viewpoints import Spot, Viewpoints
from indoor_watch.visit import Rooms
from indoor_watch.watch_rules import WatchRule

NEAR_DOOR = 4
"""A door belongs to a room whose floor is within so many cells of its middle."""


class InspectionPlan:
    """From where to look; owned by whoever calls it, one thread.

    Args:
        rules: What matters: the doors and markers that they name are looked at.
        rooms: Which place is where.
        points: The places' own points, map frame, metres.
        doors: The doors' openings by name, map frame, metres.
        radius: Of the robot, metres.
    """

    def __init__(
        self,
        rules: Sequence[WatchRule],
        rooms: Rooms,
        points: Mapping[str, Any],
        doors: Mapping[str, Segment],
        radius: float,
    ) -> None:
        self._rooms, self._points, self._doors = rooms, points, doors
        self._radius = radius
        self._named = {each.subject for each in rules if each.kind == Kind.DOOR}
        self._markers = MarkerChecks(rules, rooms, points)
        self._viewpoints: Viewpoints | None = None

    def use_map(self, grid: Grid) -> dict[str, list[Spot]]:
        """Take a map; return from where else than its own point each place is to be looked at."""
        self._viewpoints = chosen = Viewpoints(grid, self._radius)
        self._markers.use(chosen)
        found = {}
        for place, point in self._points.items():
            floor = self._rooms.cells_of(place)
            if floor is not None:
                first = float(point[0]), float(point[1])
                found[place] = list(chosen.of_room(floor, first, self._doors_of(floor, grid)))
        return found

    def checks(self, spots: Sequence[HungSpot]) -> list[MarkerCheck]:
        """Return how the markers are to be looked at that a rule is about."""
        return self._markers.of(spots)

    def again_from(self, event: Event) -> Spot | None:
        """Return from where to look again at an event; None: from anywhere in its place."""
        floor = self._rooms.cells_of(event.place)
        chosen, thing, origin = self._viewpoints, event.position, event.seen_from
        if floor is None or chosen is None or thing is None or origin is None:
            return None
        return chosen.aside(floor, thing, origin)

    def _doors_of(self, floor: NDArray[np.bool_], grid: Grid) -> list[Spot]:
        """Return the doors of a room that the rules name."""
        found = []
        for name, (x1, y1, x2, y2) in self._doors.items():
            middle = (x1 + x2) / 2, (y1 + y2) / 2
            row, column = grid.cell_of(*middle)
            near = floor[
                max(0, row - NEAR_DOOR) : row + NEAR_DOOR + 1,
                max(0, column - NEAR_DOOR) : column + NEAR_DOOR + 1,
            ]
            if (name in self._named or '' in self._named) and near.any():
                found.append(middle)
        return found
