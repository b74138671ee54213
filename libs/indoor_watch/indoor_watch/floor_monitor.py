"""What stands on the floor where nothing stood, what is gone, and which passages that blocks.

What the first look at each part of the floor shows is normal; what of it the map does not show is
told once, so that a person accepts it. A thing must be seen in two assessments before it is told,
and what moves often is told no more (`movables`).
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from floor_plans import Grid
from floor_plans.occupancy_grid import distance_to
from indoor_watch import floor_layers
from indoor_watch.events import Event
from indoor_watch.evidence import sweep_picture
from indoor_watch.floor import (
    Change,
    FloorView,
    FloorVisit,
    ObjectChange,
    changes,
    unmapped,
)
from indoor_watch.movables import Movables
from indoor_watch.observations import Kind, Observation
from indoor_watch.passages import Passages
from indoor_watch.persons import Picture
from indoor_watch.visit import LidarSweep, Pictured, Visit

Points = NDArray[np.float64]
Mask = NDArray[np.bool_]

FEWEST_SWEEPS = 5
"""With fewer nothing is compared: who walks by is in most of them."""
SAME_THING = 0.4
"""Two assessments mean one thing up to here, metres."""
SPOT, SPOT_FREE = 0.15, 0.8
"""A thing is gone when so many cells are free so far around where it stood, metres."""
OTHER_SIDES = 0.6
"""What is hidden so near to a new thing may be its other sides, metres."""
BEHIND = 0.3
"""Depth of what stands in a passage, metres."""


class FloorMonitor:
    """Compares each visit's floor with what is normal; owned by whoever calls it, one thread.

    Args:
        may_be_leaf: Tells of points (n, 2) whether they may be a door's leaf.
        passages_of: Returns the passages of a map; None: none is looked at.

    Attributes:
        grid: The map; None before it came.
        normal: What stands there normally; None: nothing is known.
        movables: What moves often.
    """

    def __init__(
        self,
        may_be_leaf: Callable[[Points], bool],
        passages_of: Callable[[Grid], Passages] | None = None,
    ) -> None:
        self._may_be_leaf, self._passages_of = may_be_leaf, passages_of
        self._passages: Passages | None = None
        self._kept: Mapping[str, Any] = {}
        self.grid: Grid | None = None
        self.normal: FloorView | None = None
        self.movables = Movables()
        # Cells that are normal since a first look, and of which nothing was told yet.
        self._untold: Mask | None = None

    def use_map(self, grid: Grid) -> bool:
        """Take the map; tell whether it is another one: what was normal before is forgotten."""
        if self.grid is not None and floor_layers.same_map(self.grid, grid):
            return False
        self.grid, self.normal, self._untold = grid, None, None
        self._passages = None if self._passages_of is None else self._passages_of(grid)
        if self._kept:
            self.normal = floor_layers.unpacked(self._kept, grid)
        return True

    def begin(self, visit: Visit) -> None:
        """Have a visit gather its sweeps, once there is a map."""
        if self.grid is not None and visit.floor is None:
            visit.floor = FloorVisit(self.grid)

    def take(self, sweep: LidarSweep, visit: Visit) -> None:
        """Take a sweep."""
        if visit.floor is not None:
            visit.floor.add(sweep.sensor, sweep.ends, sweep.met, sweep.stamp, sweep.doubt)

    def compare(self, visit: Visit, stamp: float) -> list[Pictured]:
        """Return what of a visit so far differs from what is normal, in two comparisons."""
        now = self._view(visit)
        if now is None or self.normal is None:
            return []
        found = [each for each in changes(self.normal, now) if not self._may_be_leaf(each.points)]
        again = [each for each in found if _was_there(each, visit.things)]
        placed = [(visit.place_of(each.position), each) for each in again]
        news, movable = self.movables.take(placed, stamp)
        told = [
            Observation(
                Kind.OBJECT, 'movable', each.place, position=each.spots[-1][:2], stamp=stamp
            )
            for each in movable
        ]
        told += [
            Observation(
                Kind.OBJECT,
                str(each.change),
                # A thing seen through a doorway is where it lies.
                visit.place_of(each.position),
                position=each.position,
                confidence=each.confidence,
                stamp=stamp,
                compared_with='' if each.before is None else '{:.2f} {:.2f}'.format(*each.before),
            )
            for each in news
        ]
        told += self._blocked(now, again, visit, stamp)
        visit.things = found
        return [Pictured(each) for each in told if visit.is_due(each)]

    def _blocked(
        self, now: FloorView, things: Sequence[ObjectChange], visit: Visit, stamp: float
    ) -> list[Observation]:
        """Return the passages that are blocked by what was seen in two comparisons."""
        new = [each.points for each in things if each.change != Change.REMOVED]
        if self._passages is None or self.grid is None or self.normal is None or not new:
            return []
        there = self.normal.occupied.copy()
        before = {(each.door, each.place) for each in self._passages.blocked(there)}
        cells = self.grid.cells_of(np.concatenate(new))
        there[cells[:, 0], cells[:, 1]] = True
        # Of a thing its front alone is seen: what lies hidden just behind it is taken for it, too.
        away = distance_to(there, self.grid.resolution)
        there |= (away < BEHIND) & ~now.free
        return [
            Observation(
                Kind.WAY,
                'blocked',
                each.place or visit.place_of(each.position),
                each.door,
                each.position,
                0.9,
                stamp,
            )
            for each in self._passages.blocked(there)
            if (each.door, each.place) not in before
        ]

    def gone(self, current: Iterable[Event], visit: Visit) -> list[int]:
        """Return the events of things whose spot was in view, and is as before."""
        now = self._view(visit)
        if now is None or self.normal is None:
            return []
        over = []
        for event in current:
            at = event.position
            if event.kind not in (Kind.OBJECT, Kind.WAY) or at is None:
                continue
            if event.seen == 'movable':
                continue
            if any(math.dist(each.position, at) < 2 * SAME_THING for each in visit.things):
                continue
            if event.seen == Change.REMOVED:
                is_over = bool(now.grid.at(now.occupied, *at))
            else:
                is_over = self.is_as_before(at, now)
            if is_over:
                over.append(event.number)
        return over

    def is_as_before(self, position: tuple[float, float], now: FloorView) -> bool:
        """Tell whether a spot is free, and nothing stands around it that never did.

        A beam that grazes a thing passes through a cell of it, and its other sides may look like
        little.
        """
        return is_free(now, position) and not self._stands_anew(now, position)

    def _stands_anew(self, now: FloorView, position: tuple[float, float]) -> bool:
        """Tell whether beams ended near a point where nothing is normal."""
        assert self.normal is not None
        rows, columns = np.nonzero(now.occupied & ~self.normal.occupied)
        if not len(rows):
            return False
        centres = now.grid.centres_of(np.column_stack([rows, columns]))
        return bool((np.hypot(*(centres - position).T) < SAME_THING).any())

    def learn(self, visit: Visit, current: Iterable[Event]) -> None:
        """Take what was in view for the first time as normal.

        Args:
            visit: The visit.
            current: The events that go on.
        """
        now = self._view(visit)
        if now is None:
            return
        if self._untold is None:
            self._untold = np.zeros_like(now.occupied)
        if self.normal is None:
            self.normal = now
            self._untold |= now.occupied
            return
        new = ~self.normal.seen
        there = [each.points for each in visit.things if each.change != Change.REMOVED]
        there += [
            np.array([event.position])
            for event in current
            if event.kind == Kind.OBJECT and event.position
        ]
        # The other sides of what is new are seen for the first time, too, and are not normal.
        things = np.zeros_like(new)
        if there:
            # Events outlive the map that they were seen on.
            cells = now.grid.cells_of(np.concatenate(there))
            cells = cells[now.grid.contains(cells)]
            things[cells[:, 0], cells[:, 1]] = True
        if things.any():
            away = distance_to(things, now.grid.resolution)
            new &= away > OTHER_SIDES
        self._untold |= now.occupied & new
        self.normal = replace(
            self.normal,
            occupied=self.normal.occupied | (now.occupied & new),
            free=self.normal.free | (now.free & new),
            moving=np.zeros_like(now.moving),
        )

    def baseline(self, visit: Visit, stamp: float) -> list[Pictured]:
        """Return what a first look showed and the map does not, once.

        Args:
            visit: The visit, after it was learned from.
            stamp: When, seconds since 1970.
        """
        if self._untold is None or self.normal is None or not self._untold.any():
            return []
        found = unmapped(self.normal, self._untold)
        self._untold = None
        return [
            Pictured(
                Observation(
                    Kind.OBJECT,
                    'unmapped',
                    visit.place_of(each.position),
                    position=each.position,
                    confidence=each.confidence,
                    stamp=stamp,
                )
            )
            for each in found
            if not self._may_be_leaf(each.points)
        ]

    def drawn(
        self, middle: tuple[float, float], visit: Visit
    ) -> tuple[Picture, Picture | None] | None:
        """Return the map around a point with what beams met, and with what stands there normally.

        None: there is no map; the second None: nothing is known.
        """
        if self.grid is None:
            return None
        sensor, ends = (0.0, 0.0), np.zeros((0, 2))
        if visit.sweep is not None:
            sensor, ends = visit.sweep.sensor, visit.sweep.points
        if visit.floor is not None:
            ends = np.concatenate([ends, _middles(visit.floor.view().occupied, self.grid)])
        before = None
        if self.normal is not None:
            before = sweep_picture(
                self.grid, middle, sensor, _middles(self.normal.occupied, self.grid)
            )
        return sweep_picture(self.grid, middle, sensor, ends), before

    def state(self) -> dict[str, Any]:
        """Return what is normal as plain values, for `restore`."""
        return dict(self._kept) if self.normal is None else floor_layers.packed(self.normal)

    def restore(self, kept: Mapping[str, Any]) -> None:
        """Take what `state` gave.

        Raises:
            ValueError, KeyError, TypeError: It is something else; nothing is changed then.
        """
        normal = dict(kept)
        if normal:
            floor_layers.check(normal)
        known = None
        if self.grid is not None and normal:
            known = floor_layers.unpacked(normal, self.grid)
        self._kept, self.normal = normal, known

    @staticmethod
    def _view(visit: Visit) -> FloorView | None:
        """Return what a visit saw; None: too little."""
        if visit.floor is None or visit.floor.sweeps < FEWEST_SWEEPS:
            return None
        return visit.floor.view()


def is_free(now: FloorView, position: tuple[float, float]) -> bool:
    """Tell whether beams passed through nearly all of a thing's spot."""
    row, column = now.grid.cell_of(*position)
    reach = max(1, round(SPOT / now.grid.resolution))
    if not now.grid.contains(np.array([[row, column]]))[0]:
        return False  # of an event that was seen on another map
    spot = now.free[max(row - reach, 0) : row + reach + 1, max(column - reach, 0) :][
        :, : 2 * reach + 1
    ]
    return bool(spot.size and spot.mean() >= SPOT_FREE)


def _was_there(thing: ObjectChange, before: Sequence[ObjectChange]) -> bool:
    """Tell whether the comparison before found a thing, too."""
    return any(
        each.change == thing.change and math.dist(each.position, thing.position) < SAME_THING
        for each in before
    )


def _middles(mask: Mask, grid: Grid) -> Points:
    """Return the middles of the cells of a mask, (n, 2), map frame, metres."""
    cells = np.argwhere(mask)
    return grid.centres_of(cells) if len(cells) else np.zeros((0, 2))
