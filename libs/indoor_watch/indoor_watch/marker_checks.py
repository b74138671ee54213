"""From where the spots of markers are to be seen that a person's rules are about.

A marker is called gone only where its spot was in view from near, so the robot is told where to
stand. What was told stays the same while the spot does: how a spot looks is kept by side and
distance (`hung_markers`), and a stand that changed with each reading would be a new one each time.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

from indoor_watch.hung_markers import HungSpot
from indoor_watch.observations import Kind
from indoor_watch.viewpoints import Spot, Viewpoints
from indoor_watch.visit import Rooms
from indoor_watch.watch_rules import WatchRule

SAME_SPOT = 0.3
"""A spot that is so near to where it was, metres, is looked at from the same point, as long as it
can be read from there."""
IN_FRONT = 0.3
"""A marker hangs in the place that is so far before it, metres."""
MARKER_SIDE = 0.2
"""The side of the markers that `Viewpoints.of_panel` knows distances for, metres."""


@dataclass(frozen=True)
class MarkerCheck:
    """How the spot of a marker is to be looked at.

    Attributes:
        name: `marker 21`.
        place: Where it hangs.
        at: Where on the map, metres.
        look_from: From where it is read; None: from the place's own point, or as well as may be.
        is_open: Whether it was looked at and not read, and what that means is not settled.
    """

    name: str
    place: str
    at: Spot
    look_from: Spot | None
    is_open: bool = False


class MarkerChecks:
    """The checks of markers.

    Args:
        rules: What matters; those about markers count.
        rooms: Which place is where.
        points: The places' own points, map frame, metres.
    """

    def __init__(self, rules: Sequence[WatchRule], rooms: Rooms, points: Mapping[str, Any]) -> None:
        self._rules = [each for each in rules if each.kind == Kind.MARKER]
        self._rooms, self._points = rooms, points
        self._viewpoints: Viewpoints | None = None
        self._checks: dict[int, tuple[HungSpot, MarkerCheck]] = {}

    def use(self, viewpoints: Viewpoints) -> None:
        """Take a map; what was chosen on another one is chosen anew."""
        self._viewpoints, self._checks = viewpoints, {}

    def of(self, spots: Sequence[HungSpot]) -> list[MarkerCheck]:
        """Return how some markers are to be looked at, those that a rule asks for."""
        found = {}
        for spot in spots:
            known = self._checks.get(spot.number)
            if known is not None and known[0] == spot:
                found[spot.number] = known
                continue
            check = self._check_of(spot)
            if known is not None and check is not None and self._is_good(known[1], check, spot):
                check = known[1]
            if check is not None:
                found[spot.number] = spot, replace(check, is_open=spot.is_open)
        self._checks = found
        return [check for _, check in found.values()]

    def _is_good(self, known: MarkerCheck, now: MarkerCheck, spot: HungSpot) -> bool:
        """Tell whether a check that was told before serves for a spot as it is known now."""
        at = spot.position[0], spot.position[1]
        if known.place != now.place or math.dist(known.at, at) >= SAME_SPOT:
            return False
        if known.look_from is None or self._viewpoints is None:
            return now.look_from is None
        scale = (spot.side or MARKER_SIDE) / MARKER_SIDE
        return self._viewpoints.reads_panel(known.look_from, at, spot.facing, scale)

    def _check_of(self, spot: HungSpot) -> MarkerCheck | None:
        x, y, _ = spot.position
        angle = 0.0 if spot.facing is None else spot.facing
        ahead = 0.0 if spot.facing is None else IN_FRONT
        place = self._rooms.place_at((x + ahead * math.cos(angle), y + ahead * math.sin(angle)))
        if place is None or self._viewpoints is None or place not in self._points:
            return None
        if not any(each.is_about(str(spot.number), place) for each in self._rules):
            return None
        floor = self._rooms.cells_of(place)
        if floor is None:
            return None
        px, py = self._points[place][:2]
        first, scale = (float(px), float(py)), (spot.side or MARKER_SIDE) / MARKER_SIDE
        best = self._viewpoints.of_panel(floor, first, (x, y), spot.facing, scale)
        look_from = None if best == first else best
        return MarkerCheck(f'marker {spot.number}', place, (x, y), look_from)
