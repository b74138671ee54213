"""A place is an area: what of its floor was in view, when, and from where to see the rest.

`SeenFloor` keeps for each cell when it was in view last. `SweepPlanner` chooses viewpoints that
show what is to be seen, as art galleries are guarded: the one that shows most of what no other
shows comes first, which is never much worse than the best choice (Chvatal 1979). They are put in
the order of a short way: the nearest next, then improved by 2-opt (Croes 1958).

    floor = SeenFloor(grid, reach=6.0)
    planner = SweepPlanner(floor.grid, radius=0.22, reach=6.0)
    for spot in planner.sweep(cells, here, cells & ~floor.seen_since(began)):
        ...                                   # drive there, and tell `floor.see` on the way

Cells are at least `SIDE` wide: a cell is floor where all of the map's cells in it are free. So
walls are a little thicker, and a speck of the mapper hides nothing.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from floor_plans import Grid
from floor_plans.occupancy_grid import FREE, OCCUPIED, UNKNOWN, distance_to
from floor_plans.visibility import in_view

if TYPE_CHECKING:
    from scipy import sparse

Mask = NDArray[np.bool_]
Spot = tuple[float, float]

SIDE = 0.1
"""Of a cell at least, metres."""
WAY_SIDE = 0.3
"""Of the blocks of cells on which ways are measured, metres. A wall with the room that the robot
leaves beside it is wider than that, so that no way leads through one."""
MOST_CANDIDATES = 300
BESIDE = 0.1
"""A viewpoint is so much farther from walls than the robot's radius, metres."""
LEAST_GAIN = 0.2
"""A viewpoint shows at least so much that no other one shows, square metres."""
ENOUGH = 0.97
"""When this part of what can be seen at all is seen, no further viewpoint is needed."""
UNSEEN = -math.inf
"""The time of a cell that was never in view."""


def coarse(grid: Grid, side: float = SIDE) -> Grid:
    """Return a map in cells of at least a side, metres; what is not free in a cell makes it so."""
    size = max(1, round(side / grid.resolution))
    if size == 1:
        return grid
    rows, columns = (math.ceil(each / size) for each in grid.cells.shape)
    padding = (rows * size - grid.cells.shape[0], columns * size - grid.cells.shape[1])
    occupied = _blocks(grid.occupied, size, padding)
    unknown = _blocks(grid.cells < 0, size, padding, beyond=True)
    cells = np.where(occupied, OCCUPIED, np.where(unknown, UNKNOWN, FREE)).astype(np.int8)
    return Grid(cells, grid.resolution * size, grid.origin)


class SeenFloor:
    """When each cell of a map was in view last.

    Args:
        grid: The map, with its doors open.
        reach: The floor is seen within so far, metres.
        camera: How far the camera shows it, metres, and how much of the horizon, rad; None: no
            camera counts.

    Attributes:
        grid: The map in cells of at least `SIDE`.
    """

    def __init__(self, grid: Grid, reach: float, camera: tuple[float, float] | None = None) -> None:
        self.grid = coarse(grid)
        self._reach, self._camera = reach, camera
        self._lidar_at = np.full(self.grid.cells.shape, UNSEEN)
        self._camera_at = self._lidar_at.copy() if camera else None

    @property
    def counts_camera(self) -> bool:
        """Whether what the camera shows counts."""
        return self._camera is not None

    def see(self, spot: Spot, heading: float, now: float) -> None:
        """Note what is in view from a point.

        Args:
            spot: Where the robot is, map frame, metres.
            heading: To where it looks, same frame, rad.
            now: Seconds.
        """
        self._lidar_at[in_view(self.grid, spot, self._reach)] = now
        if self._camera is not None and self._camera_at is not None:
            far, angle = self._camera
            shown = in_view(self.grid, spot, far, ahead=heading, angle=angle)
            self._camera_at[shown] = now

    def seen_since(self, since: float | NDArray[np.float64], *, camera: bool = False) -> Mask:
        """Return the cells that were in view since a time, seconds; or since one for each cell."""
        if camera and self._camera_at is not None:
            return np.asarray(self._camera_at >= since)
        return np.asarray(self._lidar_at >= since)


@dataclass(frozen=True)
class SeenFraction:
    """How much of a place was in view.

    Attributes:
        seen: Part of its floor, 0 to 1.
        area: Of that part, square metres.
        shown: The same part for the camera; nan: none counts.
    """

    seen: float
    area: float
    shown: float

    @property
    def counted(self) -> float:
        """The part that was in view of all that counts."""
        return self.seen if math.isnan(self.shown) else min(self.seen, self.shown)


class PlaceFloors:
    """The floor of each place on a map.

    Args:
        grid: The map of a `SeenFloor`.
        floors: The cells of each place on it.

    Attributes:
        names: The places.
    """

    def __init__(self, grid: Grid, floors: Mapping[str, Mask]) -> None:
        self._side = grid.resolution
        self.names = list(floors)
        self._labels = np.zeros(grid.cells.shape, np.int32)
        for number, cells in enumerate(floors.values(), start=1):
            self._labels[cells] = number
        self._sizes = self._counted(np.ones(grid.cells.shape, np.bool_))

    def of(self, place: str) -> Mask | None:
        """Return the cells of a place; None where it has none."""
        if place not in self.names:
            return None
        cells = np.asarray(self._labels == self.names.index(place) + 1)
        return cells if cells.any() else None

    def fractions(self, floor: SeenFloor, since: Mapping[str, float]) -> dict[str, SeenFraction]:
        """Return how much of each place was in view since a time of its own, seconds."""
        times = np.array([math.inf, *(since[name] for name in self.names)])[self._labels]
        seen = self._counted(floor.seen_since(times))
        shown = np.full(len(seen), math.nan)
        if floor.counts_camera:
            shown = self._counted(floor.seen_since(times, camera=True)).astype(float)
        return {
            name: SeenFraction(
                float(seen[number] / size),
                float(seen[number] * self._side**2),
                float(shown[number] / size),
            )
            for number, name in enumerate(self.names, start=1)
            if (size := self._sizes[number])
        }

    def _counted(self, cells: Mask) -> NDArray[np.intp]:
        return np.bincount(self._labels[cells], minlength=len(self.names) + 1)


class SweepPlanner:
    """Chooses from where to see a floor.

    Args:
        grid: The map, in cells of `coarse`.
        radius: Of the robot, metres.
        reach: The floor is seen within so far, metres.
    """

    def __init__(self, grid: Grid, radius: float, reach: float) -> None:
        self._grid, self._reach = grid, reach
        self._clearance = distance_to(~grid.free, grid.resolution)
        self._standable = self._clearance > radius + BESIDE
        size = max(1, round(WAY_SIDE / grid.resolution))
        self._size = size
        rows, columns = grid.cells.shape
        padding = (-rows % size, -columns % size)
        self._ways = _blocks(self._standable, size, padding)
        self._of_floor: dict[bytes, tuple[list[Spot], sparse.csr_array]] = {}

    def reachable(self, floor: Mask, start: Spot) -> Mask:
        """Return the part of a floor that is connected with a point without leaving it."""
        import cv2  # Only where a floor is swept.

        _, parts = cv2.connectedComponents(floor.astype(np.uint8), connectivity=4)
        row, column = self._nearest(floor, start)
        return np.asarray(parts == parts[row, column])

    def sweep(self, floor: Mask, start: Spot, wanted: Mask) -> list[Spot]:
        """Return viewpoints in the order of a short way that show what is wanted of a floor.

        Args:
            floor: The cells of a place.
            start: Where the robot is, map frame, metres.
            wanted: Which of them are to be seen.
        """
        spots, views = self._candidates(floor)
        if not spots:
            return []
        # Nobody sees what no candidate shows.
        left = (wanted & floor).ravel() & (np.asarray(views.sum(axis=0)).ravel() > 0)
        total, chosen = int(left.sum()), []
        least = LEAST_GAIN / self._grid.resolution**2
        while left.sum() > (1.0 - ENOUGH) * total:
            gains = views @ left.astype(np.float32)
            best = int(np.argmax(gains))
            if gains[best] < least:
                break
            chosen.append(best)
            left[views.indices[views.indptr[best] : views.indptr[best + 1]]] = False
        return self._in_order(start, [spots[each] for each in chosen])

    def view(self, spot: Spot) -> Mask:
        """Return the cells that are in view from a viewpoint."""
        return in_view(self._grid, spot, self._reach)

    def shows(self, spot: Spot, wanted: Mask) -> bool:
        """Tell whether a viewpoint shows enough of what is wanted to be driven to."""
        seen = self.view(spot) & wanted
        return bool(seen.sum() * self._grid.resolution**2 >= LEAST_GAIN)

    def bearings(self, spot: Spot, wanted: Mask, angle: float) -> list[float]:
        """Return to where a camera is turned at a point to show what is wanted, map frame, rad.

        Args:
            spot: Where it stands, metres.
            wanted: What is to be seen.
            angle: How much of the horizon it shows, rad.
        """
        cells = np.argwhere(self.view(spot) & wanted)
        if len(cells) * self._grid.resolution**2 < LEAST_GAIN:
            return []
        x, y = (self._grid.centres_of(cells) - spot).T
        count = math.ceil(math.tau / angle)
        sector = np.floor(np.arctan2(y, x) % math.tau / (math.tau / count)).astype(int) % count
        found = np.bincount(sector, minlength=count) * self._grid.resolution**2
        return [
            math.tau * (each + 0.5) / count
            for each in range(count)
            if found[each] >= LEAST_GAIN / 2
        ]

    def metres(self, start: Spot, spots: Sequence[Spot]) -> float:
        """Return how long the way from a point over viewpoints is, metres."""
        stops = [start, *spots]
        away = self._distances(stops)
        return float(sum(away[each, each + 1] for each in range(len(stops) - 1)))

    def _candidates(self, floor: Mask) -> tuple[list[Spot], sparse.csr_array]:
        """Return where the robot may stand on a floor, and which cells it sees there."""
        key = np.packbits(floor).tobytes()
        if key in self._of_floor:
            return self._of_floor[key]
        cells = np.argwhere(floor & self._standable)
        side = self._grid.resolution
        spacing = max(0.6, self._reach / 6)
        while True:
            block = np.maximum(1, round(spacing / side))
            number = cells // block
            # The cell of each block that is farthest from walls.
            order = np.argsort(-self._clearance[cells[:, 0], cells[:, 1]], kind='stable')
            keys = number[:, 0] * (self._grid.cells.shape[1] + 1) + number[:, 1]
            _, first = np.unique(keys[order], return_index=True)
            if len(first) <= MOST_CANDIDATES:
                break
            spacing *= 1.3
        taken = cells[order[first]]
        spots = [(float(x), float(y)) for x, y in self._grid.centres_of(taken)]
        from scipy import sparse  # takes 0.5 s and 15 MB, and most places are not swept

        columns = [np.flatnonzero(self.view(at) & floor) for at in spots]
        starts = np.concatenate([[0], np.cumsum([len(each) for each in columns])])
        indices = np.concatenate(columns) if columns else np.zeros(0, np.int64)
        views = sparse.csr_array(
            (np.ones(len(indices), np.float32), indices, starts),
            shape=(len(spots), floor.size),
        )
        self._of_floor = {key: (spots, views)}
        return spots, views

    def _in_order(self, start: Spot, spots: list[Spot]) -> list[Spot]:
        """Return points in the order of a short way from a start: nearest next, then 2-opt."""
        if len(spots) < 2:
            return spots
        away = self._distances([start, *spots])
        order, rest = [0], set(range(1, len(spots) + 1))
        while rest:
            nearest = min(rest, key=lambda each: away[order[-1], each])
            order.append(nearest)
            rest.remove(nearest)
        improved = True
        while improved:
            improved = False
            for first in range(1, len(order) - 1):
                for last in range(first + 1, len(order)):
                    before = away[order[first - 1], order[first]]
                    after = away[order[first - 1], order[last]]
                    if last + 1 < len(order):
                        before += away[order[last], order[last + 1]]
                        after += away[order[first], order[last + 1]]
                    if after < before - 1e-6:
                        order[first : last + 1] = order[first : last + 1][::-1]
                        improved = True
        return [spots[each - 1] for each in order[1:]]

    def _distances(self, stops: Sequence[Spot]) -> NDArray[np.float64]:
        """Return the metres of the ways between points; straight ones where there is no way."""
        from skimage.graph import MCP_Geometric  # takes 0.3 s, and most places are not swept

        side = self._grid.resolution * self._size
        blocks = [self._nearest(self._ways, at, self._size) for at in stops]
        away = np.zeros((len(stops), len(stops)))
        search = MCP_Geometric(np.where(self._ways, 1.0, -1.0))
        for one, block in enumerate(blocks):
            costs, _ = search.find_costs([block])
            for other, goal in enumerate(blocks):
                straight = math.dist(stops[one], stops[other])
                way = float(costs[goal]) * side
                away[one, other] = max(straight, way) if math.isfinite(way) else 2 * straight
        return np.minimum(away, away.T)

    def _nearest(self, mask: Mask, spot: Spot, size: int = 1) -> tuple[int, int]:
        """Return the cell, or block, of a mask that is nearest to a point."""
        row, column = (each // size for each in self._grid.cell_of(*spot))
        if 0 <= row < mask.shape[0] and 0 <= column < mask.shape[1] and mask[row, column]:
            return row, column
        cells = np.argwhere(mask)
        if not len(cells):
            return 0, 0
        away = np.hypot(cells[:, 0] - row, cells[:, 1] - column)
        found = cells[int(np.argmin(away))]
        return int(found[0]), int(found[1])


class FloorSweep:
    """One sweep of a place: where to drive next, as long as there is something to be seen.

    Args:
        floor: When what was in view; somebody else tells it on the way.
        planner: Chooses from where to see it.
        cells: The cells of the place.
        since: What was in view since then need not be seen again, seconds.
    """

    def __init__(self, floor: SeenFloor, planner: SweepPlanner, cells: Mask, since: float) -> None:
        self._floor, self._planner = floor, planner
        self._cells, self._since = cells.copy(), since
        self._stops: list[Spot] | None = None
        self._again = True

    @property
    def left(self) -> Mask:
        """The cells that are still to be seen."""
        seen = self._floor.seen_since(self._since, camera=self._floor.counts_camera)
        return np.asarray(self._cells & ~seen)

    def metres(self, here: Spot) -> float:
        """Return how long the way is that is left, metres."""
        if self._stops is None:
            self._stops = self._planner.sweep(self._cells, here, self.left)
        return self._planner.metres(here, self._stops)

    def next_stop(self, here: Spot) -> Spot | None:
        """Return where to drive next; None: nothing that can be seen is left.

        Args:
            here: Where the robot is, map frame, metres.
        """
        if self._stops is None:
            self._stops = self._planner.sweep(self._cells, here, self.left)
        while True:
            left = self.left
            while self._stops:
                stop = self._stops.pop(0)
                # It may have been seen on the way.
                if self._planner.shows(stop, left):
                    return stop
            if not self._again:
                return None
            self._again = False
            self._stops = self._planner.sweep(self._cells, here, left)

    def leave_out(self, stop: Spot) -> None:
        """Take note that a stop cannot be reached: what only it shows is left out."""
        self._cells &= ~self._planner.view(stop)


def _blocks(mask: Mask, size: int, padding: tuple[int, int], *, beyond: bool = False) -> Mask:
    """Return for each block of a mask whether any of its cells is set."""
    full = np.pad(mask, ((0, padding[0]), (0, padding[1])), constant_values=beyond)
    rows, columns = full.shape
    return np.asarray(full.reshape(rows // size, size, columns // size, size).any(axis=(1, 3)))
