"""What is measured on the floor of a place that is edited: cuts, openings, parts of rooms."""

from __future__ import annotations

import math
from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from floor_plans.floor_plan import Door, FloorPlan
from floor_plans.map_rooms.proposal import point_in
from floor_plans.occupancy_grid import Grid, distance_to, drawn_lines
from floor_plans.room_map import RoomMap
from floor_plans.shapes import WALL_THICKNESS, Point

Mask = NDArray[np.bool_]
_BESIDE = (0.12, 0.3, 0.5)
"""How far beside a door one is in one of its rooms: there may stand something near it, metres."""
_WIDEST_FIT = 6.0
_SMALLEST_PART = 0.25
"""Square metres below which a part of a room is no room."""


@dataclass(frozen=True)
class CutRoom:
    """A line from wall to wall through a room.

    Attributes:
        room: The room.
        door: The opening that the line leaves, with no name.
        own: The part of the room that keeps its name, cells of the regions' grid.
        other: The other part.
    """

    room: str
    door: Door
    own: Mask
    other: Mask


def cut_of(plan: FloorPlan, regions: RoomMap, start: Point, end: Point, radius: float) -> CutRoom:
    """Return how a drawn line cuts the room that it runs through.

    The line is carried on to the walls, so it need not reach them.

    Args:
        plan: The place.
        regions: Its rooms.
        start, end: Ends of the line, metres.
        radius: Of the robot, metres.

    Raises:
        ValueError: The line runs through no room, parts none, or leaves the robot no way.
    """
    length = math.dist(start, end)
    if length < 1e-3:
        raise ValueError('a line from a point to itself cuts nothing: expected two points')
    grid = regions.grid
    step = grid.resolution / 2
    drawn = np.linspace(start, end, max(3, math.ceil(length / step)))
    rooms = [regions.room_at(x, y) for x, y in drawn.tolist()]
    inside = [room for room in rooms if room]
    if not inside:
        raise ValueError('the line runs through no room')
    room = max(sorted(set(inside)), key=inside.count)
    mask = regions.mask(room)
    free = grid.free & mask
    at = drawn[[i for i, each in enumerate(rooms) if each == room][inside.count(room) // 2]]
    along = (np.array(end) - start) / length
    first, last = _stretch(grid, mask, free, at, along)
    centre = _centre(grid, free, first, last, radius)
    width = 2 * max(math.dist(centre, first), math.dist(centre, last)) + grid.resolution
    if plan.walls and plan.map is None:
        # A wall that is a door all along: both end in the walls beside it.
        centre, width = (first + last) / 2, math.dist(first, last) + WALL_THICKNESS
    yaw = math.remainder(math.atan2(along[1], along[0]), math.pi)
    door = Door('', float(centre[0]), float(centre[1]), yaw, width)
    own, other = _parts(plan, regions, room, free, door)
    return CutRoom(room, door, own, other)


def _stretch(
    grid: Grid, mask: Mask, free: Mask, at: NDArray[np.float64], along: NDArray[np.float64]
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return the first and the last free point of a room on a line through a point in it."""
    step = grid.resolution / 2
    reach = math.hypot(*mask.shape) * grid.resolution
    steps = np.arange(-math.ceil(reach / step), math.ceil(reach / step) + 1)
    points = at + steps[:, None] * step * along
    cells = grid.cells_of(points)
    on_map = grid.contains(cells)
    cells[~on_map] = 0
    in_room = mask[cells[:, 0], cells[:, 1]] & on_map
    here = len(steps) // 2
    gaps = np.flatnonzero(~in_room)
    low = gaps[gaps < here].max(initial=-1) + 1
    high = gaps[gaps > here].min(initial=len(steps)) - 1
    is_free = np.flatnonzero(free[cells[low : high + 1, 0], cells[low : high + 1, 1]]) + low
    if not len(is_free):
        raise ValueError('nothing is free on the line')
    return points[is_free[0]], points[is_free[-1]]


def _centre(
    grid: Grid, free: Mask, first: NDArray[np.float64], last: NDArray[np.float64], radius: float
) -> NDArray[np.float64]:
    """Return the point of a line nearest to its middle where the robot has room."""
    count = max(3, math.ceil(math.dist(first, last) / (grid.resolution / 2)))
    points = np.linspace(first, last, count)
    clearance = distance_to(~free, grid.resolution)
    clear = grid.interpolated(clearance, points)
    good = points[clear > radius + grid.resolution]
    if not len(good):
        raise ValueError(f'a robot of {2 * radius:g} m fits nowhere through the line')
    gaps = np.hypot(*(good - (first + last) / 2).T)
    return np.asarray(good[int(np.argmin(gaps))])


def _parts(
    plan: FloorPlan, regions: RoomMap, room: str, free: Mask, door: Door
) -> tuple[Mask, Mask]:
    """Return the two parts of a room on the sides of a line, the one with its point first."""
    grid = regions.grid
    line = drawn_lines(grid, [door.segment])
    reach = 2 * math.ceil((WALL_THICKNESS / 2 + grid.resolution) / grid.resolution) + 1
    thick = cv2.dilate(line.astype(np.uint8), np.ones((reach, reach), np.uint8)) > 0
    left = free & ~thick
    pieces, stats = cv2.connectedComponentsWithStats(left.astype(np.uint8), connectivity=4)[1:3]
    sizes = stats[:, cv2.CC_STAT_AREA] * grid.resolution**2
    large = [i for i in range(1, len(sizes)) if sizes[i] >= _SMALLEST_PART]
    if len(large) < 2:
        raise ValueError(f'the line does not part {room}: expected it from wall to wall')
    x, y, _ = plan.place.positions[room]
    # What furniture parts from the rest goes with the side of the line that it is on.
    across = np.array([-math.sin(door.yaw), math.cos(door.yaw)])

    def side_of(mask: Mask) -> bool:
        cells = np.argwhere(mask)
        return bool(((grid.centres_of(cells) - (door.x, door.y)) @ across).mean() > 0)

    large.sort(key=lambda i: -sizes[i])
    sides = {i: side_of(pieces == i) for i in large}
    own_piece = grid.at(pieces, x, y)
    own_side = sides.get(own_piece, sides[large[0]])
    own = np.isin(pieces, [i for i in large if sides[i] == own_side])
    other = np.isin(pieces, [i for i in large if sides[i] != own_side])
    if not other.any():
        raise ValueError(f'the line does not part {room}: expected it from wall to wall')
    return own, other


def free_point(grid: Grid, room: Mask, radius: float) -> Point:
    """Return a point of a room that the robot can reach, near its middle, metres.

    Args:
        grid: The map.
        room: Its cells.
        radius: Of the robot, metres.

    Raises:
        ValueError: The robot has no room in it.
    """
    clearance = distance_to(~grid.free, grid.resolution)
    fits = room & (clearance > radius + grid.resolution / 2)
    count, pieces, stats, _ = cv2.connectedComponentsWithStats(fits.astype(np.uint8))
    if count < 2:
        raise ValueError(f'a robot of {2 * radius:g} m has no room in one of the parts')
    largest = 1 + int(np.argmax(stats[1:, cv2.CC_STAT_AREA]))
    column, row = point_in(room, np.asarray(pieces == largest), clearance, radius, grid.resolution)
    return grid.centre_of(int(row), int(column))


def sides_of(door: Door, parts: dict[str, Mask], grid: Grid) -> str:
    """Return which of some parts a door leads into: the one beside it, or else the nearest."""
    across = (-math.sin(door.yaw), math.cos(door.yaw))
    for away in _BESIDE:
        for step in (-away, away):
            point = door.x + step * across[0], door.y + step * across[1]
            for name, mask in parts.items():
                if grid.at(mask, *point):
                    return name

    def gap(name: str) -> float:
        cells = grid.centres_of(np.argwhere(parts[name]))
        return float(np.hypot(*(cells - (door.x, door.y)).T).min())

    return min(parts, key=gap)


def fitted_door(grid: Grid, x: float, y: float) -> Door:
    """Return the opening at a point of a map: along the shortest line from wall to wall.

    Args:
        grid: The map, doors open.
        x, y: The point, metres.

    Raises:
        ValueError: The point is not free, or no walls are near.
    """
    if not grid.at(grid.free, x, y):
        raise ValueError(f'({x:.2f}, {y:.2f}) is not free: expected a point in an opening')
    best: tuple[float, float, float, float] | None = None
    reach = np.arange(0.0, _WIDEST_FIT, grid.resolution / 2)
    for yaw in np.linspace(-math.pi / 2, math.pi / 2, 36, endpoint=False).tolist():
        along = np.array([math.cos(yaw), math.sin(yaw)])
        ways = []
        for towards in (-1.0, 1.0):
            cells = grid.cells_of((x, y) + towards * reach[:, None] * along)
            on_map = grid.contains(cells)
            cells[~on_map] = 0
            solid = np.flatnonzero(~(grid.free[cells[:, 0], cells[:, 1]] & on_map))
            ways.append(float(reach[solid[0]]) if len(solid) else math.inf)
        width = sum(ways)
        if math.isfinite(width) and (best is None or width < best[0]):
            best = width, yaw, *ways
    if best is None:
        raise ValueError(f'no walls within {_WIDEST_FIT:g} m of ({x:.2f}, {y:.2f})')
    width, yaw, back, forth = best
    shift = (forth - back) / 2
    return Door('', x + shift * math.cos(yaw), y + shift * math.sin(yaw), yaw, width)


def door_on_wall(plan: FloorPlan, x: float, y: float, width: float) -> Door:
    """Return a door of some width on the wall nearest to a point, metres.

    Raises:
        ValueError: No wall is near, or none so long.
    """
    best: tuple[float, Door] | None = None
    for wall in plan.walls.values():
        if wall.length < width:
            continue
        dx, dy = ((b - a) / wall.length for a, b in zip(wall.start, wall.end, strict=True))
        along = (x - wall.start[0]) * dx + (y - wall.start[1]) * dy
        along = min(max(along, width / 2), wall.length - width / 2)
        at = wall.start[0] + along * dx, wall.start[1] + along * dy
        gap = math.dist((x, y), at)
        if gap <= 1.0 and (best is None or gap < best[0]):
            best = gap, Door('', *at, math.atan2(dy, dx), width)
    if best is None:
        raise ValueError(f'no wall of {width:g} m or more within 1 m of ({x:.2f}, {y:.2f})')
    return best[1]
