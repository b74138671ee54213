"""Paths over an occupancy grid: inflation, search, smoothing, and what blocks.

The free cells are those whose centre keeps the robot's inscribed radius and a margin from
everything that is not free. Where the robot is not round, its footprint is checked along the path
that was found; the cells at which it would touch something are left out, and another path is
sought. Among them, cells near obstacles cost more, so that a path keeps to the middle of a
passage where there is room. `grid_search` finds the cheapest way over the eight neighbours.
Straight shortcuts that are no dearer replace the steps of the grid, and corners are rounded as far
as the free space allows. A door or an obstacle that comes or goes changes the costs near it alone.
What may leave costs more than a usual way round, and does not block. A keep-out zone is as a wall;
in a slow zone a way costs as much more as it takes longer.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field, replace
from functools import cached_property
from itertools import pairwise

import cv2
import numpy as np
from numpy.typing import ArrayLike, NDArray
from skimage.graph import MCP_Geometric

from floor_plans import Grid, Zones
from floor_plans.occupancy_grid import distance_to, points_on, with_walls
from floor_plans.parameters import NO_ZONES
from floor_plans.shapes import Segment
from lidar_navigation import geometry
from lidar_navigation.footprint import Footprint
from lidar_navigation.geometry import Points
from lidar_navigation.planning.grid_search import Cell, GridSearch
from lidar_navigation.robot_base import robot_footprint, robot_radius
from strict_files.settings import parameter

Lines = Mapping[str, Segment]

_DEAREST = 20.0
"""No slow zone makes a way dearer than this many times."""
_BLOCKED = 1e4
"""Cost of a blocked cell in the search for what blocks; more than any detour."""


_TRIES = 12
"""Paths that are tried for a robot that is not round."""
_DEAR, _DEAR_REACH = 30.0, 0.12
"""Where it would touch something, cells within this distance, metres, cost so much more."""


class NoPathError(Exception):
    """There is no path; the text says why: what blocks it, or which point is not free."""


@dataclass(frozen=True)
class PlanningParameters:
    """How close to obstacles a path may run, and how much it avoids them.

    Attributes:
        margin: What a path keeps beyond the radius, metres; at least 0.71 cells, so that a
            diagonal step between two free cells grazes nothing.
        comfort: Beyond radius and margin, room up to this distance makes a cell cheaper, metres.
        aversion: How many times what an open cell costs one at the margin costs, minus one.
        escape: A start that is not free may be left over at most this distance, metres.
        goal_shift: A goal on which an obstacle stands is moved by at most this distance, metres.
        waiting: How many times what an open cell costs one does that somebody blocks who may leave;
            past a person these are about as many metres of a way round.
        corner: Longest part of a straight line that rounding a corner may take, metres.
        cruise: Speed outside of slow zones, with which ways through them are compared, m/s.
    """

    radius: float = robot_radius()
    footprint: tuple[float, ...] = robot_footprint()
    margin: float = parameter(0.05, 'Kept beyond the radius, m.', 0.0, 20.0)
    comfort: float = parameter(0.5, 'Room that a path prefers, m.', 0.0, 20.0)
    aversion: float = parameter(3.0, 'How much more a path near obstacles costs.', 0.0, 20.0)
    escape: float = 0.6
    goal_shift: float = 1.0
    waiting: float = 100.0
    corner: float = 0.5
    cruise: float = 0.6

    @cached_property
    def body(self) -> Footprint:
        """The robot's shape."""
        return Footprint(self.radius, self.footprint)

    @property
    def kept(self) -> float:
        """What every path keeps around the robot's centre, whichever way it looks, metres."""
        return self.body.inscribed


@dataclass
class GridPlanner:
    """Finds paths on one map, with doors closed and obstacles seen since; one call at a time.

    Args:
        grid: The map.
        parameters: The robot's size, margins and costs.
        doors: All doors, open or closed: a goal is not moved through one.
        zones: Where the robot is not to drive, or slowly.
    """

    grid: Grid
    parameters: PlanningParameters = field(default_factory=PlanningParameters)
    doors: Lines = field(default_factory=dict)
    zones: Zones = NO_ZONES
    _closed: Lines = field(default_factory=dict, init=False)
    _staying: Points = field(default_factory=lambda: np.zeros((0, 2)), init=False)
    _leaving: Points = field(default_factory=lambda: np.zeros((0, 2)), init=False)
    _firm_cells: set[Cell] = field(default_factory=set, init=False)
    _loose_cells: set[Cell] = field(default_factory=set, init=False)

    def __post_init__(self) -> None:
        p, shape = self.parameters, self.grid.cells.shape
        # From walls alone, and from keep-out zones, too.
        self._walls = self._static = self._distance(~self.grid.free)
        if self.zones.keep_out:
            barred = ~self.grid.free
            for zone in self.zones.keep_out.values():
                barred |= zone.cells_on(self.grid)
            self._static = self._distance(barred)
        self._slower = self._times_longer()
        self._reach = math.ceil((p.kept + p.margin + p.comfort) / self.grid.resolution) + 1
        # From what stays, and from everything.
        self._firm, self._clearance = self._static.copy(), self._static.copy()
        self._cost = np.empty(shape, np.float32)
        # Where nothing blocks the way, not even what may leave.
        self._open = np.empty(shape, np.bool_)
        self._price_cells(np.s_[:, :])
        self._search = GridSearch(self._cost)
        self._divide()
        rooms = with_walls(self.grid, list(self.doors.values())).free
        self._rooms = cv2.connectedComponents(rooms.astype(np.uint8), connectivity=4)[1]

    def set_closed(self, doors: Lines) -> None:
        """Close doors: nothing leads across their segments. Replaces what was closed before."""
        if dict(doors) != dict(self._closed):
            self._closed = dict(doors)
            self._update()

    def set_obstacles(self, points: ArrayLike, stay: NDArray[np.bool_] | None = None) -> None:
        """Take obstacles that the map does not have.

        Args:
            points: Shape (n, 2), on their surface.
            stay: Which of them stay, shape (n,); the others may be gone when the robot comes
                there. None: all of them.
        """
        array = np.asarray(points, dtype=float).reshape(-1, 2)
        stays = np.ones(len(array), np.bool_) if stay is None else stay
        self._staying, self._leaving = array[stays], array[~stays]
        self._update()

    @property
    def cost(self) -> NDArray[np.float32]:
        """What the search works on: each cell's cost, -1 where the robot cannot be."""
        return self._cost

    def clearance(self, points: ArrayLike) -> Points:
        """Return how far points are from everything that is not free, shape (n,), metres.

        A lower bound, to within a part of a cell: what is not free fills its cells.
        """
        return self.grid.interpolated(self._clearance, points)

    def is_free(self, path: ArrayLike) -> bool:
        """Tell whether the robot can go along a path, shape (n, 2), without touching anything."""
        samples = _samples(np.asarray(path, dtype=float), self.grid.resolution / 2)
        inside = self.grid.contains(self.grid.cells_of(samples)).all()
        return bool(inside and (self.clearance(samples) >= self.parameters.kept).all())

    def plan(self, start: ArrayLike, goal: ArrayLike) -> Points:
        """Find the way from one point to another.

        Where the way around is very long, or there is none, it leads through obstacles that may be
        gone by then.

        Args:
            start: x, y in metres; when it is not free, the path leaves it by the shortest way.
            goal: x, y in metres; when an obstacle that the map does not have stands there, the
                path ends as near to it as it can.

        Returns:
            The path, shape (n, 2), n of at least 2, both points included.

        Raises:
            NoPathError: There is none; the text says what blocks it.
        """
        begin: Points = np.asarray(start, dtype=float)[:2]
        end: Points = np.asarray(goal, dtype=float)[:2]
        if barred := self.zones.barred(end):
            raise NoPathError(f'the goal {_shown(end)} lies in the keep-out zone {barred.name}')
        if barred := self.zones.barred(begin):
            return self._leaving_zone(barred.name).plan(begin, end)
        wanted = self._cell('the goal', end)
        start_cell = self._free_cell_near(begin)
        goal_cell = wanted if self._open[wanted] else self._cell_beside(end, wanted, start_cell)
        if goal_cell != wanted:
            end = self.grid.centres_of(goal_cell)[0]
        if self._regions[start_cell] != self._regions[goal_cell]:
            raise NoPathError(
                f'no path from {_shown(begin)} to {_shown(end)}: '
                f'{self._what_blocks(start_cell, goal_cell)}'
            )
        path = self._found(begin, end, start_cell, goal_cell)
        if self.parameters.body.is_round:
            return path
        dear: list[tuple[tuple[slice, slice], NDArray[np.float32]]] = []
        touches = begin
        try:
            for _ in range(_TRIES):
                found = self._touches(path)
                if found is None:
                    return path
                touches = found
                dear.append(self._made_dear(found))
                path = self._found(begin, end, start_cell, goal_cell)
        finally:
            for window, cost in reversed(dear):
                self._cost[window] = cost
                self._told_changed(window)
        raise NoPathError(
            f'no path from {_shown(begin)} to {_shown(end)}: the robot does not fit through at '
            f'{_shown(touches)}, whose footprint is {2 * self.parameters.kept:.2f} m wide at least'
        )

    def _found(self, begin: Points, end: Points, start_cell: Cell, goal_cell: Cell) -> Points:
        """Return the cheapest path between two points whose cells these are."""
        cells = self._search.path(start_cell, goal_cell)
        path = self.grid.centres_of(cells)
        path[0] = begin if self._is_free_at(begin) else path[0]
        path[-1] = end
        path = self._rounded(self._shortened(path))
        return path if np.array_equal(path[0], begin) else np.vstack([begin, path])

    def _leaving_zone(self, name: str) -> GridPlanner:
        """Return a planner for a robot in a keep-out zone: it drives out, at a high price."""
        zones = self.zones
        out = replace(zones.keep_out[name], speed=self.parameters.cruise / _DEAREST)
        others = {each: zone for each, zone in zones.keep_out.items() if each != name}
        leaving = Zones(others, {**zones.slow, name: out})
        planner = GridPlanner(self.grid, self.parameters, self.doors, leaving)
        planner.set_closed(self._closed)
        stay = np.arange(len(self._staying) + len(self._leaving)) < len(self._staying)
        planner.set_obstacles(np.concatenate([self._staying, self._leaving]), stay)
        return planner

    def _times_longer(self) -> NDArray[np.float32] | None:
        """Return how many times longer each cell takes; None where nothing is slow."""
        if not self.zones.slow:
            return None
        longer = np.ones(self.grid.cells.shape, np.float32)
        for zone in self.zones.slow.values():
            assert zone.speed is not None
            times = min(max(self.parameters.cruise / zone.speed, 1.0), _DEAREST)
            cells = zone.cells_on(self.grid)
            longer[cells] = np.maximum(longer[cells], np.float32(times))
        return longer

    def _touches(self, path: Points) -> Points | None:
        """Return where a robot that looks along the path first touches something, shape (2,).

        It may turn at the start as it likes: which way it looks there is not known.
        """
        poses = _poses_along(path, self.grid.resolution / 2)
        poses = poses[np.hypot(*(poses[:, :2] - path[0]).T) > self.grid.resolution]
        if not len(poses):
            return None
        edge = self.parameters.body.outline(self.grid.resolution)
        cos, sin = np.cos(poses[:, 2:]), np.sin(poses[:, 2:])
        x = poses[:, :1] + cos * edge[:, 0] - sin * edge[:, 1]
        y = poses[:, 1:2] + sin * edge[:, 0] + cos * edge[:, 1]
        clearance = self.grid.interpolated(self._clearance, np.stack([x.ravel(), y.ravel()], 1))
        touching = (clearance.reshape(x.shape) < 0.0).any(axis=1)
        return np.asarray(poses[int(touching.argmax()), :2]) if touching.any() else None

    def _made_dear(self, at: Points) -> tuple[tuple[slice, slice], NDArray[np.float32]]:
        """Make the cells around a point dear; return which, and what they cost before."""
        row, column = (int(each) for each in self.grid.cells_of(at)[0])
        steps = max(2, round(_DEAR_REACH / self.grid.resolution))
        top, left = max(row - steps, 0), max(column - steps, 0)
        window = slice(top, row + steps + 1), slice(left, column + steps + 1)
        before = np.asarray(self._cost[window].copy())
        rows = np.arange(top, top + len(before))[:, None]
        columns = np.arange(left, left + before.shape[1])
        near = (rows - row) ** 2 + (columns - column) ** 2 <= steps**2
        self._cost[window] = np.where(near & (before > 0), before + np.float32(_DEAR), before)
        self._told_changed(window)
        return window, before

    def _told_changed(self, window: tuple[slice, slice]) -> None:
        rows, columns = self.grid.cells.shape
        self._search.changed(
            window[0].start,
            min(window[0].stop, rows),
            window[1].start,
            min(window[1].stop, columns),
        )

    def _distance(self, mask: NDArray[np.bool_]) -> NDArray[np.float32]:
        # From a cell's centre to the edge of the nearest cell that is not free.
        away = distance_to(mask, self.grid.resolution)
        return np.asarray(away - np.float32(self.grid.resolution / 2), dtype=np.float32)

    def _update(self) -> None:
        """Take the doors and obstacles into account that came or went."""
        lines = [points_on(line, self.grid.resolution / 2) for line in self._closed.values()]
        firm = self._cells_of(np.concatenate([*lines, self._staying]))
        loose = self._cells_of(self._leaving)
        changed = np.array(
            sorted((firm ^ self._firm_cells) | (loose ^ self._loose_cells)), dtype=np.intp
        ).reshape(-1, 2)
        self._firm_cells, self._loose_cells = firm, loose
        if not len(changed):
            return
        # What is further away than this from a change costs what it did.
        rows, columns = self.grid.cells.shape
        top, left = np.maximum(changed.min(axis=0) - self._reach, 0)
        bottom, right = np.minimum(changed.max(axis=0) + self._reach + 1, (rows, columns))
        bounds = int(top), int(bottom), int(left), int(right)
        window = np.s_[top:bottom, left:right]
        self._firm[window] = np.minimum(self._static[window], self._measured(firm, *bounds))
        self._clearance[window] = np.minimum(self._firm[window], self._measured(loose, *bounds))
        self._price_cells(window)
        self._search.changed(*bounds)
        self._divide()

    def _cells_of(self, points: Points) -> set[Cell]:
        cells = self.grid.cells_of(points)
        return {(int(row), int(rank)) for row, rank in cells[self.grid.contains(cells)]}

    def _measured(
        self, cells: set[Cell], top: int, bottom: int, left: int, right: int
    ) -> NDArray[np.float32]:
        """Return the distance to cells in a window; exact up to `_reach`, no less beyond."""
        north, south = max(top - self._reach, 0), bottom + self._reach
        west, east = max(left - self._reach, 0), right + self._reach
        around = np.zeros(self._static[north:south, west:east].shape, np.bool_)
        near = [(r - north, c - west) for r, c in cells if north <= r < south and west <= c < east]
        if near:
            at = np.array(near)
            around[at[:, 0], at[:, 1]] = True
        return self._distance(around)[top - north : bottom - north, left - west : right - west]

    def _price_cells(self, window: tuple[slice, slice]) -> None:
        p = self.parameters

        def priced(clearance: NDArray[np.float32]) -> tuple[NDArray[np.bool_], NDArray[np.float32]]:
            spare = clearance[window] - np.float32(p.kept + p.margin)
            crowded = np.clip(1 - spare / np.float32(max(p.comfort, 1e-6)), 0, 1)
            return spare >= 0, 1 + np.float32(p.aversion) * crowded * crowded

        self._open[window], price = priced(self._clearance)
        # Past somebody, too, the path keeps to the middle of a passage, and not to the side.
        passable, waiting = priced(self._firm)
        blocked = np.where(passable, np.float32(p.waiting) * waiting, np.float32(-1))
        self._cost[window] = np.where(self._open[window], price, blocked)
        if self._slower is not None:
            self._cost[window] *= np.where(blocked > 0, self._slower[window], np.float32(1))

    def _divide(self) -> None:
        free = (self._cost > 0).astype(np.uint8)
        self._regions = cv2.connectedComponents(free, connectivity=8)[1]

    def _cell(self, what: str, point: Points) -> Cell:
        cell = self.grid.cells_of(point)
        if not np.isfinite(point).all() or not self.grid.contains(cell)[0]:
            west, south, east, north = self.grid.bounds
            raise NoPathError(
                f'{what} {_shown(point)} lies outside of the map, which goes from '
                f'({west:.2f}, {south:.2f}) to ({east:.2f}, {north:.2f})'
            )
        return int(cell[0, 0]), int(cell[0, 1])

    def _is_free_at(self, point: Points) -> bool:
        return bool(self.clearance(point)[0] >= self.parameters.kept)

    def _free_cell_near(self, start: Points) -> Cell:
        at = self._cell('the start', start)
        if self._open[at]:
            return at
        if not self.grid.free[at]:
            raise NoPathError(f'the start {_shown(start)} {self._why_not_free(start)}')
        for cell in self._cells_around(at, self.parameters.escape, self._open):
            if self._can_escape(start, self.grid.centres_of(cell)[0]):
                return cell
        if self._regions[at] != 0:
            return at
        raise NoPathError(f'the start {_shown(start)} {self._why_not_free(start)}')

    def _cell_beside(self, goal: Points, cell: Cell, start: Cell) -> Cell:
        """Return the cell nearest to a goal that an obstacle covers, among those of the same room
        that can be reached; the goal's own where there is none, and it may become free.
        """
        needed = self.parameters.kept + self.parameters.margin
        if self._static[cell] >= needed:
            region = self._open & (self._regions == self._regions[start])
            if self._rooms[cell]:  # Else it lies in a door, so in both rooms.
                region &= self._rooms == self._rooms[cell]
            for nearest in self._cells_around(cell, self.parameters.goal_shift, region):
                return nearest
            if self._regions[cell] != 0:
                return cell
        raise NoPathError(f'the goal {_shown(goal)} {self._why_not_free(goal)}')

    def _cells_around(self, cell: Cell, reach: float, wanted: NDArray[np.bool_]) -> Iterator[Cell]:
        """Yield the wanted cells within reach of a cell, metres, the nearest ones first."""
        steps = math.ceil(reach / self.grid.resolution)
        low = np.maximum(np.array(cell) - steps, 0)
        window = wanted[low[0] : cell[0] + steps + 1, low[1] : cell[1] + steps + 1]
        found = np.argwhere(window) + low
        gaps = np.hypot(*(found - cell).T)
        for index in np.argsort(gaps, kind='stable'):
            if gaps[index] > steps:
                return
            yield int(found[index, 0]), int(found[index, 1])

    def _can_escape(self, start: Points, end: Points) -> bool:
        """Tell whether the way out only leads away from what is near: it must never come closer."""
        clearance = self.clearance(_samples(np.array([start, end]), self.grid.resolution / 2))
        return bool((np.diff(clearance) > -self.grid.resolution / 4).all())

    def _why_not_free(self, point: Points) -> str:
        cell = self.grid.cells_of(point)
        row, column = int(cell[0, 0]), int(cell[0, 1])
        if self.grid.occupied[row, column]:
            return 'lies inside a wall'
        if not self.grid.free[row, column]:
            return 'lies where the map is unknown'
        needed = self.parameters.kept + self.parameters.margin
        near = f'{max(0.0, float(self._clearance[row, column])):.2f} m from '
        if self._walls[row, column] < needed:
            what = 'a wall'
        else:
            what = self._nearest_extra(point)
        return f'is {near}{what}: expected at least {needed:.2f} m'

    def _nearest_extra(self, point: Points) -> str:
        gaps = {
            f'the keep-out zone {name}': zone.distance((float(point[0]), float(point[1])))
            for name, zone in self.zones.keep_out.items()
        }
        gaps |= {
            f'the closed door {name}': float(
                np.hypot(*(geometry.equally_spaced(_ends(line), 0.05) - point).T).min()
            )
            for name, line in self._closed.items()
        }
        if len(self._staying):
            index = int(np.argmin(np.hypot(*(self._staying - point).T)))
            obstacle = self._staying[index]
            gaps[f'an obstacle at {_shown(obstacle)}'] = float(np.hypot(*(obstacle - point)))
        return min(gaps, key=lambda name: gaps[name])

    def _what_blocks(self, start: Cell, goal: Cell) -> str:
        """Name what lies on the path that would be taken if doors and obstacles were not there."""
        needed = np.float32(self.parameters.kept + self.parameters.margin)
        cost = np.where(self._cost > 0, self._cost, np.float32(_BLOCKED))
        cost = np.where(self._walls >= needed, cost, np.float32(-1))
        search = MCP_Geometric(cost)
        try:
            search.find_costs([start], [goal])
            cells = np.asarray(search.traceback(goal))
        except ValueError:
            # The grid takes up to a cell's diagonal on either side of an opening at an angle.
            wide = 2.0 * (needed + math.sqrt(2.0) * self.grid.resolution)
            return (
                'walls lie between them, with no opening wide enough: expected one of '
                f'{wide:.2f} m, or a smaller planning.margin'
            )
        path = self.grid.centres_of(cells)
        blocked = path[self._cost[cells[:, 0], cells[:, 1]] < 0]
        return self._nearest_extra(blocked[len(blocked) // 2]) + ' is in the way'

    def _shortened(self, path: Points) -> Points:
        """Replace steps of the grid by straight lines that are free and cost no more."""
        path = path[_corners(path)]
        dear = np.array([self._price(first, last) for first, last in pairwise(path)])
        dear = np.concatenate(([0.0], np.cumsum(dear)))
        kept = [0]
        while kept[-1] < len(path) - 1:
            at = kept[-1]
            good, reach = at + 1, 2
            # Ever longer lines until one is not good, then the limit between by halving.
            while at + reach < len(path) and self._is_line(path, at, at + reach, dear):
                good = at + reach
                reach *= 2
            bad = min(at + reach, len(path))
            while bad - good > 1:
                middle = (good + bad) // 2
                if self._is_line(path, at, middle, dear):
                    good = middle
                else:
                    bad = middle
            kept.append(good)
        return np.asarray(path[kept])

    def _is_line(self, path: Points, first: int, last: int, dear: Points) -> bool:
        price = self._price(path[first], path[last])
        return price <= float(dear[last] - dear[first]) * 1.02 + 1e-6

    def _price(self, begin: Points, end: Points) -> float:
        """Return what the straight line between two points costs; infinite where it is not free."""
        (x, y), (dx, dy) = begin, end - begin
        length = math.hypot(dx, dy)
        count = math.ceil(2 * length / self.grid.resolution) + 1
        share = np.arange(count) / max(1, count - 1)
        scale = 1.0 / self.grid.resolution
        west, south = self.grid.origin
        columns = (((x - west) + share * dx) * scale).astype(np.intp)
        rows = (((y - south) + share * dy) * scale).astype(np.intp)
        costs = self._cost[rows, columns]
        # The ends are the start's and the goal's own, which may be nearer to something.
        if count > 2 and costs[1:-1].min() < 0:
            return math.inf
        return float(np.abs(costs).sum()) / count * length

    def _rounded(self, path: Points) -> Points:
        """Round each corner by a quadratic Bezier curve, as far as that is free."""
        result = [path[:1]]
        for before, corner, after in zip(path, path[1:], path[2:], strict=False):
            reach = self.parameters.corner
            arms = [min(reach, float(np.hypot(*(end - corner))) / 2) for end in (before, after)]
            result.append(self._round(before, corner, after, arms))
        result.append(path[-1:])
        return np.vstack(result)

    def _round(self, before: Points, corner: Points, after: Points, arms: list[float]) -> Points:
        for _ in range(3):
            entry = corner + (before - corner) * (arms[0] / math.dist(before, corner))
            leave = corner + (after - corner) * (arms[1] / math.dist(after, corner))
            # The curve is shorter than its two arms: samples are at most half a cell apart.
            count = 2 * math.ceil(sum(arms) / self.grid.resolution) + 1
            share = np.arange(count)[:, None] / (count - 1)
            curve = (1 - share) ** 2 * entry + 2 * share * (1 - share) * corner + share**2 * leave
            cells = ((curve - self.grid.origin) / self.grid.resolution).astype(np.intp)
            if self._open[cells[:, 1], cells[:, 0]].all():
                step = max(1, count // 6)
                return np.vstack([curve[:-1:step], curve[-1:]])
            arms = [arm / 2 for arm in arms]
        return corner[None, :]


def _poses_along(path: Points, spacing: float) -> Points:
    """Return x, y, yaw along a path, shape (n, 3); at a corner it turns on the spot."""
    result: list[Points] = []
    last: float | None = None
    for begin, end in pairwise(path):
        way = end - begin
        length = float(np.hypot(*way))
        if length < 1e-9:
            continue
        yaw = math.atan2(way[1], way[0])
        if last is not None:
            turn = geometry.angle_between(last, yaw)
            turns = last + turn * np.linspace(0.0, 1.0, max(2, math.ceil(abs(turn) / 0.1) + 1))
            result.append(np.column_stack([np.tile(begin, (len(turns), 1)), turns]))
        last = yaw
        share = np.linspace(0.0, 1.0, max(2, math.ceil(length / spacing) + 1))[:, None]
        points = begin + share * way
        result.append(np.column_stack([points, np.full(len(points), yaw)]))
    return np.concatenate(result) if result else np.zeros((0, 3))


def _corners(path: Points) -> NDArray[np.intp]:
    """Return where a path of cells changes its direction, and its two ends."""
    if len(path) < 3:
        return np.arange(len(path))
    steps = np.diff(path, axis=0)
    turns = np.flatnonzero(np.abs(np.diff(steps, axis=0)).max(axis=1) > 1e-9) + 1
    return np.concatenate(([0], turns, [len(path) - 1]))


def _ends(line: tuple[float, float, float, float]) -> Points:
    return np.array(line, dtype=float).reshape(2, 2)


def _samples(path: Points, spacing: float) -> Points:
    if len(path) == 1:
        return path
    return geometry.equally_spaced(path, spacing) if len(path) else path


def _shown(point: Points) -> str:
    return f'({point[0]:.2f}, {point[1]:.2f})'
