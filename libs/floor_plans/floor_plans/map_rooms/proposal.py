"""A place made of a map: rooms and doors with names, and in each room a point the robot can reach.

Where two rooms meet there is a border of free cells. Its pieces that the robot fits through are
doors, as wide as they are from jamb to jamb; the others are walls that the map does not show, as a
gap that a scan left. What reaches to the edge of the map all around, as the paper of a floor plan
does, is outside: the ways out are closed. Whatever else is no room is left out with its reason.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import count, pairwise
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from floor_plans.floor_plan import Door, FloorPlan
from floor_plans.map_rooms.confidence import confidence
from floor_plans.map_rooms.halls import Hall, halls, with_aisles
from floor_plans.map_rooms.segmentation import (
    CELL,
    SMALLEST_ROOM,
    Line,
    Segmentation,
    segment,
)
from floor_plans.occupancy_grid import (
    Grid,
    boxes,
    distance_to,
    looked_up,
    spread,
    totals,
    walled_off,
)
from floor_plans.occupancy_map import OccupancyMap
from floor_plans.room_map import RoomMap, check_passable
from floor_plans.rooms import PlaceError

Labels = NDArray[np.int32]
Mask = NDArray[np.bool_]
Point = tuple[float, float]

_NEAR_POINT = 3.0
"""A room's point need not be farther from walls than this many radii of the robot."""
_WIDEST = 20.0
_SPARE = 0.1
"""More than the robot needs at the point of a door, where there is more, metres."""
_SHORTEST_WALL = 0.12
_LINE_CELLS = 5
"""A room's point keeps this far from the lines of doors: their thickness, working cells."""
OUTSIDE = 'outside of the building: it reaches to the edge of the map all around'
_BESIDE_DOOR = 0.3
"""An opening is a known door if their middles are at most so far apart, metres."""


_SEPARATE_ENOUGH = 2.0
"""From this area on, in squares of the door's width, a room is one whatever stands at its door."""
_DEEP = 0.75
"""What is deeper than this beside a door, across it, is no wall, metres."""
_LIFT = 2.0
"""The smallest room behind a door, m^2: a lift for a wheelchair has 1.1 x 1.4 m and its walls."""
_PASSES = 6
_STEP = 0.05
_PAPER = 0.6
"""Share of the map's edge from which on free floor there is outside, as that of a scanned plan."""
_AT_EDGE = 0.02
"""A part with less of the edge is a room that the map cuts off."""
_DUST = 0.5
"""A part of the floor with less area is not worth a word, m^2."""


@dataclass(frozen=True)
class LeftOut:
    """A part of the floor that is no room of the place.

    Attributes:
        number: Of it among the rooms that were found; 0: it is too small to be one.
        reason: Why, in words.
        area: Square metres.
        at: A point in it, x and y in metres.
    """

    number: int
    reason: str
    area: float
    at: Point


@dataclass(frozen=True)
class Proposal:
    """What is proposed for a map.

    Attributes:
        parameters: All of the place's file below `ros__parameters`, but for the map's file.
        segmentation: The rooms as they were found.
        names: Name of each room by its number.
        left_out: The parts of the floor that are no rooms of the place, outside first.
        entrances: Names of the walls that close a way out, and the room that it leads out of.
    """

    parameters: Mapping[str, Any]
    segmentation: Segmentation
    names: Mapping[int, str]
    left_out: tuple[LeftOut, ...]
    entrances: Mapping[str, str]

    def areas(self) -> dict[str, float]:
        """Return the area of each room, square metres."""
        grid = self.segmentation.working
        counts = totals(self.segmentation.working_labels, self.segmentation.rooms + 1)
        return {name: float(counts[n]) * grid.resolution**2 for n, name in self.names.items()}

    def confidence(self) -> dict[str, float]:
        """Return how sure each room and door is, from 0.5 to 1 (`map_rooms.confidence`)."""
        sides: dict[str, list[str]] = {}
        for room, doors in self.parameters['map'].items():
            for door in doors:
                sides.setdefault(door, []).append(room)
        placed = self.parameters.get('doors', {})
        return confidence(
            self.areas(), {door: (sides[door], row[3]) for door, row in placed.items()}
        )

    def halls(self, building: OccupancyMap) -> dict[str, Hall]:
        """Return the rooms that are too large to be seen from their points, by name."""
        positions = self.parameters['room_positions']
        # Working cells are 0.05 m, the map's may be a little more or less.
        scale = (
            building.cells.shape[1] * building.resolution / self.segmentation.working.cells.shape[1]
        )
        own = {
            name: building.to_own([positions[name][:2]])[0] * (CELL / scale)
            for name in self.names.values()
        }
        points = {name: (float(x), float(y)) for name, (x, y) in own.items()}
        return halls(self.segmentation, self.names, points)

    @property
    def outside(self) -> tuple[int, ...]:
        """Numbers of the parts that are outside of the building."""
        return tuple(each.number for each in self.left_out if each.reason == OUTSIDE)


@dataclass(frozen=True)
class _Opening:
    """A piece of a border: the rooms, its ends and a cell with room, column and row."""

    rooms: tuple[int, int]
    start: tuple[float, float]
    end: tuple[float, float]
    middle: tuple[float, float]
    clearance: float


def propose(
    building: OccupancyMap,
    radius: float,
    doors: Mapping[str, Line] | None = None,
    *,
    with_outside: bool = False,
    aisles: bool = False,
) -> Proposal:
    """Return a place with the rooms and doors of a map.

    Args:
        building: The map.
        radius: Of the robot, metres.
        doors: Doors that are known, by name: each parts two rooms. World frame, metres.
        with_outside: What is outside of the building is a room, too.
        aisles: The aisles of a hall are places of their own.

    Raises:
        ValueError: The robot fits nowhere.
    """
    known = doors or {}
    if not building.own_grid.free.any():
        unknown = float((building.own_grid.cells < 0).mean())
        raise ValueError(
            f'no cell of the map is free ({unknown:.0%} unknown, {1 - unknown:.0%} occupied): '
            'expected floor'
        )
    found = segment(building.own_grid, [_as_line(building.to_own(each)) for each in known.values()])
    grid = found.working
    # A working cell is not exactly 0.05 m where the map's are of another size.
    scale = building.cells.shape[1] * building.resolution / grid.cells.shape[1]
    free = grid.free
    clearance = distance_to(~free, grid.resolution)
    floor = _Floor(building, radius, known, scale, free, clearance, with_outside)
    found = _without_false_doors(floor, found)
    found = with_aisles(found) if aisles else found
    borders = _borders(found.working_labels, free)
    for _ in range(found.rooms):
        layout = _laid_out(floor, found, borders)
        pair = layout.one_room or _not_parted(floor, layout)
        if pair is None:
            return layout.proposal
        found = found.joined(*pair)
    return _laid_out(floor, found, borders).proposal


@dataclass(frozen=True)
class _Floor:
    """What stays while rooms are tried.

    Attributes:
        building: The map.
        radius: Of the robot, metres.
        known: Doors that are known, by name.
        scale: Side of a working cell, metres.
        free: The working cells that are free.
        clearance: How far each is from what is not, metres.
        with_outside: What is outside of the building is a room, too.
    """

    building: OccupancyMap
    radius: float
    known: Mapping[str, Line]
    scale: float
    free: Mask
    clearance: NDArray[np.float32]
    with_outside: bool

    def world(self, points: list[tuple[float, float]]) -> NDArray[np.float64]:
        """Return working cells (column, row) in the world, metres."""
        return self.building.to_world((np.array(points) + 0.5) * self.scale)


@dataclass(frozen=True)
class _Layout:
    """A proposal, and which rooms each of its doors joins.

    Attributes:
        proposal: The proposal.
        joins: The numbers of the rooms on both sides of each door.
        one_room: Two rooms that are one, as one of them has no point for the robot.
    """

    proposal: Proposal
    joins: Mapping[str, tuple[int, int]]
    one_room: tuple[int, int] | None = None


def _laid_out(floor: _Floor, found: Segmentation, borders: NDArray[np.intp]) -> _Layout:
    """Return the place of rooms as they were found.

    Raises:
        ValueError: The robot fits nowhere.
    """
    labels, clearance, radius, scale = (
        *(found.working_labels, floor.clearance),
        *(floor.radius, floor.scale),
    )
    outside = frozenset[int]() if floor.with_outside else outside_of(found)
    within = np.ones(found.rooms + 1, np.bool_)
    within[[0, *outside]] = False
    reach = _reachable(looked_up(within, labels), clearance, radius)
    needed = radius + 1.5 * found.working.resolution
    openings = _openings(labels, borders, clearance, needed + _SPARE)
    ways = [
        each
        for each in openings
        if each.clearance > needed and _fits(reach, each) and outside.isdisjoint(each.rooms)
    ]
    rooms = _joined_rooms(set(_numbers(labels, reach)), ways)
    if not rooms:
        raise ValueError(f'a robot with a radius of {radius:g} m fits nowhere: expected free floor')
    ways = [each for each in ways if set(each.rooms) <= rooms]
    listed = {id(each) for each in ways}
    names = _names(rooms, found)
    table: dict[str, list[str]] = {names[number]: [] for number in sorted(rooms)}
    placed: dict[str, list[float]] = {}
    middles = [floor.world([each.start, each.end]).mean(axis=0) for each in ways]
    called = _called(middles, floor.known)
    for name, door in zip(called, ways, strict=True):
        if name in floor.known:
            start, end = (np.array(each) for each in floor.known[name])
            placed[name] = _line(np.array([start, end, (start + end) / 2]), 0.0)
        else:
            placed[name] = _line(floor.world([door.start, door.end, door.middle]), scale)
        for number in door.rooms:
            table[names[number]].append(name)
    joins = {name: door.rooms for name, door in zip(called, ways, strict=True)}
    if len(rooms) == 1:
        table[next(iter(table))].append('D1')  # the door that leads out of the place
    walls = [
        _as_line(_longer(floor.world([each.start, each.end]), scale))
        for each in openings
        if id(each) not in listed and set(each.rooms) <= rooms
    ]
    # What leads to a part that is no room is closed, or that part would be one with its neighbour.
    exits = [each for each in openings if len(rooms & set(each.rooms)) == 1]
    closed = [_as_line(_longer(floor.world([each.start, each.end]), scale)) for each in exits]
    walls += closed
    lines = [Door(name, *row).ends for name, row in placed.items()]
    near = _beside(floor, [*lines, *walls])
    positions: dict[str, list[float]] = {}
    one_room = None
    parts = boxes(labels)
    for number in sorted(rooms):
        box = parts[number]  # a building has hundreds of rooms: each is looked at alone
        mask = labels[box] == number
        inside = mask & ~near[box]
        if len(rooms) > 1 and not (inside & reach[box]).any():
            # So small that the lines of its doors fill it.
            beside = [each.rooms for each in ways if number in each.rooms]
            one_room = one_room or beside[0]
            inside = mask
        column, row = point_in(inside, reach[box], clearance[box], radius)
        at = (column + box[1].start, row + box[0].start)
        positions[names[number]] = _rounded(floor.world([at])[0])
    points = list(positions.values())
    beyond = [_widest(labels, number, parts[number], clearance) for number in outside]
    points += [floor.world([at])[0] for at in beyond]
    walls += _gaps(floor, found, [*lines, *walls], points)
    station, home = _station(floor.building, labels, reach & ~near, rooms, names, positions, scale)
    parameters: dict[str, Any] = {
        'map': table,
        'room_positions': positions,
        'robot_room': home,
        'recharge_rooms': [home],
        'station': station,
    }
    if placed:
        parameters['doors'] = placed
    wide = [
        line
        for each, line in zip(exits, closed, strict=True)
        if each.clearance > needed and outside & set(each.rooms)
    ]
    walled = {line: f'entrance{index}' for index, line in enumerate(wide, start=1)}
    for line in walls:
        walled.setdefault(line, f'W{len(walled) - len(wide) + 1}')
    if walls:
        parameters['walls'] = {
            walled[line]: [*_rounded(np.array(line[0])), *_rounded(np.array(line[1]))]
            for line in walls
        }
    entrances = {
        walled[line]: names[next(number for number in each.rooms if number in rooms)]
        for each, line in zip(exits, closed, strict=True)
        if line in wide
    }
    left_out = _left_out(floor, found, rooms, outside, openings)
    proposal = Proposal(parameters, found, names, left_out, entrances)
    return _Layout(proposal, joins, one_room)


def outside_of(found: Segmentation) -> frozenset[int]:
    """Return the numbers of the parts that are outside of the building; none: it has no outside.

    A robot's map ends at what nobody has seen. Where it ends at free floor all around, somebody has
    drawn it on white paper, or has marked as free what is not known.
    """
    labels = found.working_labels
    edge = np.concatenate([labels[0], labels[-1], labels[1:-1, 0], labels[1:-1, -1]])
    counts = np.bincount(edge, minlength=found.rooms + 1)
    counts[0] = 0
    if counts.sum() < _PAPER * len(edge):
        return frozenset()
    outer = frozenset(np.flatnonzero(counts >= _AT_EDGE * len(edge)).tolist())
    # A field or a yard without a building is the place itself.
    return outer if set(range(1, found.rooms + 1)) - outer else frozenset()


def _numbers(labels: Labels, where: Mask) -> list[int]:
    """Return the rooms of the cells of a mask."""
    found = totals(labels, int(labels.max()) + 1, where)
    return [number for number in np.flatnonzero(found).tolist() if number]


def _widest(
    labels: Labels, number: int, box: tuple[slice, slice], clearance: NDArray[np.float32]
) -> Point:
    """Return the cell of a part that is farthest from what stands there, column and row."""
    cells = np.argwhere(labels[box] == number)
    row, column = cells[np.argmax(clearance[box][cells[:, 0], cells[:, 1]])]
    return float(column + box[1].start), float(row + box[0].start)


def _left_out(
    floor: _Floor,
    found: Segmentation,
    rooms: set[int],
    outside: frozenset[int],
    openings: Sequence[_Opening],
) -> tuple[LeftOut, ...]:
    """Return what of the floor is no room, with the reason: outside, then rooms, then small parts.

    The widths are those of openings: a robot of a radius needs twice that and some centimetres.
    """
    labels, clearance, cell = found.working_labels, floor.clearance, floor.scale**2
    areas = totals(labels, found.rooms + 1) * cell
    needed = floor.radius + 1.5 * found.working.resolution

    parts = boxes(labels)

    def part(number: int, reason: str) -> LeftOut:
        x, y = _rounded(floor.world([_widest(labels, number, parts[number], clearance)])[0])
        return LeftOut(number, reason, round(float(areas[number]), 2), (x, y))

    others = sorted(set(range(1, found.rooms + 1)) - rooms - outside)

    def why(number: int) -> str:
        box = parts[number]
        if float(clearance[box][labels[box] == number].max()) <= floor.radius:
            return f'too narrow for a robot {2 * floor.radius:g} m wide'
        # Rooms that lead into each other have their way in together.
        mine = {number}
        while (
            more := {
                each
                for opening in openings
                if opening.clearance > needed and mine & set(opening.rooms)
                for each in opening.rooms
                if each in others
            }
            - mine
        ):
            mine |= more
        ways = [each for each in openings if len(mine & set(each.rooms)) == 1]
        widest = max((each.clearance for each in ways if rooms & set(each.rooms)), default=0.0)
        if widest:
            return f'no way in that is wide enough: {2 * widest:.2f} m, not {2 * needed:.2f} m'
        from_outside = any(outside & set(each.rooms) for each in ways)
        return 'reached from outside alone' if from_outside else 'no door: walls all around'

    left = [part(each, OUTSIDE) for each in sorted(outside)]
    left += [part(each, why(each)) for each in others]
    pieces, stats = cv2.connectedComponentsWithStats(
        (floor.free & (labels == 0)).astype(np.uint8), connectivity=4
    )[1:3]
    for piece, (west, low, wide, high, cells) in enumerate(stats.tolist()):
        if piece and cells * cell >= _DUST:
            box = (slice(low, low + high), slice(west, west + wide))
            at = _rounded(floor.world([_widest(pieces, piece, box, clearance)])[0])
            reason = f'smaller than {SMALLEST_ROOM:g} m2'
            left.append(LeftOut(0, reason, round(cells * cell, 2), (at[0], at[1])))
    return tuple(left)


def _without_false_doors(floor: _Floor, found: Segmentation) -> Segmentation:
    """Return the rooms with those joined between which furniture stands, and no wall.

    A cupboard beside a wall leaves a gap as wide as a door. What tells them apart: behind a door
    there is a room, many times as large as a square on the door (`_SEPARATE_ENOUGH`), or what ends
    at the door on both sides is as thin as a wall is (`_DEEP`). What is smaller than a lift
    (`_LIFT`) is no room in either case. Closets and lifts behind doors in walls stay.
    """
    cell, grid = floor.scale**2, found.working
    borders = _borders(found.working_labels, floor.free)
    for _ in range(_PASSES):
        areas = totals(found.working_labels, found.rooms + 1) * cell
        needed = floor.radius + 1.5 * grid.resolution
        widest: dict[int, tuple[float, tuple[int, int]]] = {}
        enough = needed + _SPARE
        for each in _openings(found.working_labels, borders, floor.clearance, enough):
            if each.clearance <= needed:
                continue
            ends = (np.array([each.start, each.end, each.middle]) + 0.5) * floor.scale
            line = _line(ends, floor.scale)
            room = min(each.rooms, key=areas.__getitem__)
            smaller = float(areas[room])
            is_false = smaller < _LIFT or (
                smaller < _SEPARATE_ENOUGH * line[3] ** 2
                and max(_depth_at(floor, line, side) for side in (-1.0, 1.0)) > _DEEP
            )
            if is_false:
                widest[room] = max(widest.get(room, (0.0, each.rooms)), (line[3], each.rooms))
        if not widest:
            break
        # Each with one other, then all is looked at anew: it may be large enough now.
        found = found.all_joined([pair for _, pair in widest.values()])
    return found


def _depth_at(floor: _Floor, door: list[float], side: float) -> float:
    """Return how deep what stands beside a door is, across the door's direction, metres.

    The least of four lines across it, which begin 0.1 to 0.4 m behind the jamb and reach 1 m to
    both sides. The door is in the frame of the map's corner.
    """
    x, y, yaw, width = door
    along, across = (math.cos(yaw), math.sin(yaw)), (-math.sin(yaw), math.cos(yaw))
    behind = side * (width / 2 + np.array([0.1, 0.2, 0.3, 0.4]))[:, None]
    beside = np.arange(-1.0, 1.0 + 1e-9, _STEP)[None, :]
    columns = np.floor((x + behind * along[0] + beside * across[0]) / floor.scale).astype(int)
    rows = np.floor((y + behind * along[1] + beside * across[1]) / floor.scale).astype(int)
    inside = (rows >= 0) & (rows < floor.free.shape[0])
    inside &= (columns >= 0) & (columns < floor.free.shape[1])
    solid = np.ones(inside.shape, np.bool_)
    solid[inside] = ~floor.free[rows[inside], columns[inside]]
    return float(solid.sum(axis=1).min()) * _STEP


def _not_parted(floor: _Floor, layout: _Layout) -> tuple[int, int] | None:
    """Return two rooms that their door does not part as the place's file has to; None: all fits.

    It is asked what reads that file, so that no place is proposed which would then be refused.
    """
    parameters, names = layout.proposal.parameters, layout.proposal.names
    try:
        plan = FloorPlan.from_parameters(parameters, floor.building)
        RoomMap(plan)
        check_passable(plan, floor.radius)
    except PlaceError as error:
        table, name, *_ = (*error.where, '', '')
        if table == 'doors' and name in layout.joins:
            return layout.joins[name]
        room = next((number for number, each in names.items() if each == name), None)
        return next((pair for pair in layout.joins.values() if room in pair), None)
    return None


def _longer(ends: NDArray[np.float64], more: float) -> NDArray[np.float64]:
    """Return a wall that reaches farther on both sides, and is as long as walls have to be."""
    start, end = ends
    gap = math.dist(start, end)
    along = (end - start) / gap if gap > 1e-9 else np.array([1.0, 0.0])
    longer = max(more, (_SHORTEST_WALL - gap) / 2)
    return np.array([start - along * longer, end + along * longer])


def _beside(floor: _Floor, lines: list[Line]) -> Mask:
    """Return the working cells below the lines of doors and walls, and beside them."""
    drawn = np.zeros(floor.free.shape, np.uint8)
    for line in lines:
        start, end = np.rint(floor.building.to_own(line) / floor.scale - 0.5).astype(int).tolist()
        cv2.line(drawn, start, end, 1, _LINE_CELLS)
    return drawn > 0


def _gaps(
    floor: _Floor, found: Segmentation, lines: list[Line], points: Sequence[Sequence[float]]
) -> list[Line]:
    """Return walls where two rooms are one beside their door, through cells that are too narrow.

    Rooms are found on cells of 0.05 m; a finer map has gaps between them, and a border may run
    through furniture, where no straight door closes it.
    """
    building, grid = floor.building, floor.building.own_grid
    side = grid.resolution
    drawn = [_as_line(building.to_own(line)) for line in lines]
    opened = walled_off(grid, drawn).free.astype(np.uint8)
    parts = cv2.connectedComponents(opened, connectivity=4)[1]
    inside: dict[int, int] = {}
    for x, y in building.to_own(points):
        part = grid.at(parts, x, y)
        inside[part] = inside.get(part, 0) + 1
    crowded = [part for part, count_ in inside.items() if part and count_ > 1]
    if not crowded:
        return []
    rooms = np.where(np.isin(parts, crowded), spread(found.labels.copy()), 0)
    border = np.zeros(rooms.shape, np.bool_)
    for here, there in ((np.s_[:, :-1], np.s_[:, 1:]), (np.s_[:-1], np.s_[1:])):
        one, other = rooms[here], rooms[there]
        border[here] |= (one > 0) & (other > 0) & (one != other)
    narrow = border & (distance_to(~grid.free, side) < floor.radius)
    count_, pieces = cv2.connectedComponents(
        cv2.dilate(narrow.astype(np.uint8), np.ones((3, 3), np.uint8)), connectivity=8
    )
    cells = np.argwhere(narrow)
    which = pieces[cells[:, 0], cells[:, 1]]
    walls = []
    for piece in range(1, count_):
        mine = cells[which == piece][:, ::-1].astype(float)
        start = mine[np.argmax(np.hypot(*(mine - mine.mean(axis=0)).T))]
        end = mine[np.argmax(np.hypot(*(mine - start).T))]
        ends = building.to_world((np.array([start, end]) + 0.5) * side)
        walls.append(_as_line(_longer(ends, 1.5 * side)))
    return walls


def _called(middles: list[NDArray[np.float64]], known: Mapping[str, Line]) -> list[str]:
    """Return the names of doors: that of the known one which is there, else the next of D1, D2."""
    names = [''] * len(middles)
    for name, line in known.items():
        start, end = (np.array(each) for each in line)
        gaps = [math.dist((start + end) / 2, middle) for middle in middles]
        left = [index for index, taken in enumerate(names) if not taken]
        best = min(left, key=gaps.__getitem__, default=None)
        if best is not None and gaps[best] < max(math.dist(start, end) / 2, _BESIDE_DOOR):
            names[best] = name
    new = (name for index in count(1) if (name := f'D{index}') not in known)
    return [name or next(new) for name in names]


def _as_line(points: NDArray[np.float64]) -> Line:
    (x1, y1), (x2, y2) = points.tolist()
    return (x1, y1), (x2, y2)


def _reachable(floor: Mask, clearance: NDArray[np.float32], radius: float) -> Mask:
    """Return the cells of the largest part of the floor that the robot can be in."""
    fits = floor & (clearance > radius)
    count, pieces, stats, _ = cv2.connectedComponentsWithStats(
        fits.astype(np.uint8), connectivity=8
    )
    if count < 2:
        return np.zeros_like(fits)
    largest = 1 + int(np.argmax(stats[1:, cv2.CC_STAT_AREA]))
    return np.asarray(pieces == largest)


def _borders(labels: Labels, free: Mask) -> NDArray[np.intp]:
    """Return the pairs of free cells at which two rooms meet: indices into the flat map, (2, n).

    Joining rooms takes some of them away and adds none, so that they are looked for once.
    """
    found = []
    columns = labels.shape[1]
    for (up, right), here, there in (
        ((0, 1), np.s_[:, :-1], np.s_[:, 1:]),
        ((1, 0), np.s_[:-1], np.s_[1:]),
    ):
        meet = labels[here] != labels[there]
        meet &= free[here] & free[there]
        rows_columns = np.nonzero(meet)
        first = rows_columns[0] * columns + rows_columns[1]
        found.append(np.stack([first, first + up * columns + right]))
    pairs = np.concatenate(found, axis=1)
    return pairs[:, (labels.ravel()[pairs] > 0).all(axis=0)]


def _openings(
    labels: Labels, borders: NDArray[np.intp], clearance: NDArray[np.float32], enough: float
) -> list[_Opening]:
    """Return the pieces of free borders between rooms, in the order of the rooms.

    Args:
        labels: The rooms.
        borders: The pairs of cells at which they meet, and maybe more.
        clearance: How far each is from what is not, metres.
        enough: The clearance that a door's point needs, where there is as much, metres.
    """
    found: list[_Opening] = []
    # On the side of the lower number, so that a border is one cell wide.
    rooms_ = labels.ravel()[borders]
    differ = rooms_[0] != rooms_[1]
    rooms_, borders = rooms_[:, differ], borders[:, differ]
    low = np.where(rooms_[0] < rooms_[1], borders[0], borders[1])
    rooms_ = np.sort(rooms_, axis=0)
    order = np.lexsort((rooms_[1], rooms_[0]))
    rooms_, low = rooms_[:, order], low[order]
    begins = np.flatnonzero(np.diff(rooms_, axis=1, prepend=-1).any(axis=0)).tolist()
    for begin, end in pairwise([*begins, len(low)]):
        rooms = (int(rooms_[0, begin]), int(rooms_[1, begin]))
        cells = np.stack(np.unravel_index(np.unique(low[begin:end]), labels.shape), axis=1)
        corner, far = cells.min(axis=0), cells.max(axis=0)
        window = np.zeros(tuple(far - corner + 1), np.uint8)
        window[tuple((cells - corner).T)] = 1
        # Steps of a slanted border touch at corners, or miss by a cell.
        grown = cv2.dilate(window, np.ones((3, 3), np.uint8))
        pieces = cv2.connectedComponents(grown, connectivity=8)[1]
        which = pieces[tuple((cells - corner).T)]
        for piece in np.unique(which):
            mine = cells[which == piece]
            found.append(_opening_of(rooms, mine, clearance, enough))
    return found


def _opening_of(
    rooms: tuple[int, int],
    cells: NDArray[np.intp],
    clearance: NDArray[np.float32],
    enough: float,
) -> _Opening:
    points = cells[:, ::-1].astype(float)
    centre = points.mean(axis=0)
    start = points[np.argmax(np.hypot(*(points - centre).T))]
    end = points[np.argmax(np.hypot(*(points - start).T))]
    clear = clearance[cells[:, 0], cells[:, 1]]
    # Of the cells that are free enough the one in the middle: a door reaches equally far from it.
    best = clear >= min(float(clear.max()) - 0.05, enough)
    middle = points[best][np.argmin(np.hypot(*(points[best] - (start + end) / 2).T))]
    as_pair = [(float(x), float(y)) for x, y in (start, end, middle)]
    return _Opening(rooms, as_pair[0], as_pair[1], as_pair[2], float(clear.max()))


def _fits(reach: Mask, opening: _Opening) -> bool:
    column, row = (int(each) for each in opening.middle)
    return bool(reach[max(0, row - 1) : row + 2, max(0, column - 1) : column + 2].any())


def _joined_rooms(rooms: set[int], doors: list[_Opening]) -> set[int]:
    """Return the largest set of rooms that doors join."""
    beside: dict[int, set[int]] = {number: set() for number in rooms}
    for door in doors:
        first, second = door.rooms
        if first in rooms and second in rooms:
            beside[first].add(second)
            beside[second].add(first)
    best: set[int] = set()
    left = set(rooms)
    while left:
        seen = {left.pop()}
        queue = list(seen)
        while queue:
            new = beside[queue.pop()] - seen
            seen |= new
            queue += new
        left -= seen
        best = max(best, seen, key=len)
    return best


def _names(rooms: set[int], found: Segmentation) -> dict[int, str]:
    names, counts = {}, {'R': 0, 'C': 0}
    for number in sorted(rooms):
        kind = 'C' if number in found.corridors else 'R'
        counts[kind] += 1
        names[number] = f'{kind}{counts[kind]}'
    return names


def point_in(
    room: Mask,
    reach: Mask,
    clearance: NDArray[np.float32],
    radius: float,
    resolution: float = 0.05,
) -> tuple[float, float]:
    """Return a cell of a room that is free enough and near its middle, column and row.

    Args:
        room: Its cells.
        reach: Those that the robot can be in.
        clearance: How far each cell is from what is not free, metres.
        radius: Of the robot, metres.
        resolution: Side of a cell, metres.
    """
    # Also far from the room's own borders, so that the robot is clearly inside.
    deep = cv2.distanceTransform(np.pad(room, 1).astype(np.uint8), cv2.DIST_L2, 3)[1:-1, 1:-1]
    deep = np.where(room & reach, np.minimum(clearance, resolution * deep), -1.0)
    good = np.argwhere(deep >= min(float(deep.max()), _NEAR_POINT * radius) - 1e-6)
    rows, columns = room.sum(axis=1), room.sum(axis=0)
    middle = [(each @ np.arange(len(each))) / each.sum() for each in (rows, columns)]
    away = np.hypot(good[:, 0] - np.float32(middle[0]), good[:, 1] - np.float32(middle[1]))
    row, column = good[np.argmin(away)]
    return float(column), float(row)


def _line(points: NDArray[np.float64], side: float) -> list[float]:
    """Return x, y, yaw and width of a door with these ends and this point with room, metres."""
    start, end, middle = points
    length = math.dist(start, end)
    along = (end - start) / length if length > 0 else np.array([1.0, 0.0])
    # On the line between its ends, beside that point; so long that it reaches both.
    at = start + along * float((middle - start) @ along)
    width = 2 * max(math.dist(at, start), math.dist(at, end)) + side
    yaw = math.atan2(along[1], along[0])
    if not -math.pi / 2 < yaw <= math.pi / 2 + 1e-9:
        yaw -= math.copysign(math.pi, yaw)
    return [*_rounded(at), round(yaw, 4), round(min(max(width, 0.3), _WIDEST), 3)]


def _station(
    building: OccupancyMap,
    labels: Labels,
    reach: Mask,
    rooms: set[int],
    names: Mapping[int, str],
    positions: Mapping[str, list[float]],
    scale: float,
) -> tuple[list[float], str]:
    """Return the pose and the room of the station: where the map began, if that is free.

    A mapper begins at 0, 0, and usually that is the robot's dock.
    """
    own = Grid(np.zeros(labels.shape, np.int8), scale)
    x, y = building.to_own([(0.0, 0.0)])[0]
    if own.at(reach, x, y) and (number := own.at(labels, x, y)) in rooms:
        return [0.0, 0.0, 0.0], names[number]
    corridors = [name for name in positions if name.startswith('C')]
    home = (corridors or list(positions))[0]
    return [*positions[home], 0.0], home


def _rounded(point: NDArray[np.float64]) -> list[float]:
    return [round(float(each), 3) for each in point]
