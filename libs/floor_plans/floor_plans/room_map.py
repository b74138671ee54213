"""Which room a point of a floor plan lies in, and whether walls, doors and rooms fit together.

A floor plan says where walls stand and the map which rooms its doors join. `RoomMap` finds the
rooms between the walls and compares; `check_passable` asks whether a robot gets everywhere.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from floor_plans.floor_plan import FloorPlan
from floor_plans.occupancy_grid import LARGE_PART, UNKNOWN, distance_to, divided, regions
from floor_plans.rooms import PlaceError
from floor_plans.shapes import WALL_THICKNESS, Point

ROBOT_RADIUS = 0.22
"""Radius of a robot that has to get through the doors, metres, where nobody says another one."""


@dataclass(frozen=True, eq=False)
class FloorPart:
    """A part of the floor that is no room.

    Attributes:
        at: A point in it, x and y in metres.
        area: Square metres.
        cells: Its cells, shape of the grid.
        gaps: Names of the walls that close a gap of the map towards a room, with that room.
        is_outside: Whether it reaches to the edge of the map all around.
    """

    at: Point
    area: float
    cells: npt.NDArray[np.bool_]
    gaps: Mapping[str, str]
    is_outside: bool

    def reason(self, plan: FloorPlan) -> str:
        """Return why it is no room, in words."""
        if self.is_outside:
            return 'outside of the building'
        if not self.gaps:
            return 'no door: walls all around'
        widest = max(plan.walls[name].length for name in self.gaps)
        return f'its way in is closed: a wall of {widest:.2f} m'


class RoomMap:
    """The rooms of a floor plan as regions of a grid.

    Args:
        plan: The floor plan.

    Raises:
        PlaceError: The walls do not fit the map: two rooms are one, a door does not touch the room
            it leads into, or a position lies in a wall.
    """

    def __init__(self, plan: FloorPlan) -> None:
        self._plan = plan
        lines = plan.wall_pieces() + [door.ends for door in plan.doors.values()]
        self.grid = plan.walled(lines)
        if plan.walls and plan.map is None:
            self._labels = regions(self.grid.free)
            self._names = self._named()
        else:
            self._names = dict(enumerate(plan.place.positions, start=1))
            self._labels = self._divided()
        if plan.is_enclosed:
            self._check_doors()
            self._check_stations()

    def room_at(self, x: float, y: float) -> str | None:
        """Return the room that a point (metres) lies in, None outside of every room."""
        return self._names.get(self.grid.at(self._labels, x, y))

    def masks(self) -> dict[str, npt.NDArray[np.bool_]]:
        """Return the cells (rows, columns) of each room on `grid`, every door closed."""
        return {name: self._labels == label for label, name in self._names.items()}

    def mask(self, room: str) -> npt.NDArray[np.bool_]:
        """Return the cells (rows, columns) of one room on `grid`, every door closed."""
        numbers = [number for number, name in self._names.items() if name == room]
        return np.asarray(np.isin(self._labels, numbers))

    def numbers(self) -> tuple[npt.NDArray[np.int32], dict[int, str]]:
        """Return the number of each cell's room, and the rooms by their numbers."""
        return self._labels, dict(self._names)

    def left_out(self) -> tuple[FloorPart, ...]:
        """Return the parts of the floor of a map from 1 m^2 on that are no rooms, largest first."""
        if self._plan.map is None:
            return ()
        import cv2

        free = self.grid.free & ~np.isin(self._labels, list(self._names))
        count, pieces, stats, _ = cv2.connectedComponentsWithStats(
            free.astype(np.uint8), connectivity=4
        )
        areas = stats[:, cv2.CC_STAT_AREA] * self.grid.resolution**2
        large = [each for each in range(1, count) if areas[each] >= LARGE_PART]
        if not large:
            return ()
        ways = self._ways_out(np.asarray(pieces, np.int32))
        clearance = distance_to(~free, self.grid.resolution)
        edges = (pieces[0], pieces[-1], pieces[:, 0], pieces[:, -1])
        found = []
        for piece in sorted(large, key=lambda each: -areas[each]):
            cells = pieces == piece
            row, column = np.unravel_index(np.argmax(np.where(cells, clearance, -1)), cells.shape)
            found.append(
                FloorPart(
                    self.grid.centre_of(int(row), int(column)),
                    float(areas[piece]),
                    cells,
                    ways.get(piece, {}),
                    all((edge == piece).any() for edge in edges),
                )
            )
        return tuple(found)

    def _ways_out(self, pieces: npt.NDArray[np.int32]) -> dict[int, dict[str, str]]:
        """Return for each part the walls that have it on one side and a room on the other."""
        found: dict[int, dict[str, str]] = {}
        for name, wall in self._plan.walls.items():
            x, y = ((a + b) / 2 for a, b in zip(wall.start, wall.end, strict=True))
            dx, dy = ((b - a) / wall.length for a, b in zip(wall.start, wall.end, strict=True))
            sides: list[tuple[str | None, int]] = []
            for side in (-1.0, 1.0):
                points = [(x - side * d * dy, y + side * d * dx) for d in (0.15, 0.3, 0.5)]
                rooms = [self.room_at(*at) for at in points]
                parts = [self.grid.at(pieces, *at) or 0 for at in points]
                sides.append((next(filter(None, rooms), None), next(filter(None, parts), 0)))
            for (room, _), (_, part) in (sides, sides[::-1]):
                if room and part:
                    found.setdefault(part, {})[name] = room
        return found

    def _named(self) -> dict[int, str]:
        names: dict[int, str] = {}
        outside, free = int(self._labels[0, 0]), self.grid.free
        for room, (x, y, _) in self._plan.place.positions.items():
            where = ('room_positions', room)
            label = self.grid.at(self._labels, x, y)
            if label in (None, outside):
                raise PlaceError(where, f'({x:g}, {y:g}) lies outside: expected walls all around')
            if not self.grid.at(free, x, y):
                raise PlaceError(
                    where, f'({x:g}, {y:g}) lies in a wall or a door: expected free space'
                )
            if label in names:
                raise PlaceError(
                    where,
                    f"'{room}' and '{names[label]}' are one room: "
                    f'expected a wall between their positions',
                )
            names[label] = room
        return names

    def _divided(self) -> npt.NDArray[np.int32]:
        """Return each cell's room by its number in `_names`, 0 in none, on a map or open floor."""
        grid, positions = self.grid, self._plan.place.positions
        points = [(x, y) for x, y, _ in (positions[room] for room in self._names.values())]
        for room, (x, y) in zip(self._names.values(), points, strict=True):
            if not grid.at(grid.free, x, y):
                unknown = grid.at(grid.cells, x, y) in (None, UNKNOWN)
                found = 'outside of what the map knows' if unknown else 'in a wall or a door'
                raise PlaceError(
                    ('room_positions', room),
                    f'({x:g}, {y:g}) lies {found}: expected free space',
                )
        labels = divided(grid, points)
        labels[labels < 0] = 0
        return labels

    def _check_doors(self) -> None:
        # Beside the door of a map there may stand something, and its cells may be large.
        far = () if self._plan.map is None else (0.3, 0.5)
        reach = max(WALL_THICKNESS, 2 * self.grid.resolution)
        for room, doors in self._plan.place.rooms.items():
            for name in doors:
                door = self._plan.doors.get(name)
                if door is None:
                    continue  # has no position, as it may where there are no walls
                across = (-math.sin(door.yaw), math.cos(door.yaw))
                sides = {
                    self.room_at(door.x + step * across[0], door.y + step * across[1])
                    for away in (reach, *far)
                    for step in (-away, away)
                }
                if room not in sides:
                    found = ' and '.join(sorted(side or 'outside' for side in sides))
                    raise PlaceError(
                        ('doors', name),
                        f"stands between {found}: expected it at '{room}', as the map says",
                    )

    def _check_stations(self) -> None:
        for room, station in self._plan.stations.items():
            x, y, _ = station.pose
            found = self.room_at(x, y)
            # Without a recharge room the only station may stand anywhere.
            allowed = (room,) if self._plan.place.recharge_rooms else tuple(self._plan.place.rooms)
            if found not in allowed:
                raise PlaceError(
                    station.where,
                    f'({x:g}, {y:g}) lies in {found or "no place"}: '
                    f'expected a point in {" or ".join(allowed)}',
                )


def check_passable(plan: FloorPlan, radius: float) -> None:
    """Make sure that a round robot gets from its start through every door and into every room.

    Args:
        plan: A floor plan whose regions were checked.
        radius: Of the robot, metres.

    Raises:
        PlaceError: A door is too narrow or stands full, or a room cannot be reached.
    """
    import cv2  # takes 0.2 s, and a node that only needs the rooms does without

    for name, door in plan.doors.items():
        if door.width <= 2 * radius:
            raise PlaceError(
                ('doors', name),
                f'width {door.width:g} m: expected more than {2 * radius:g} m, '
                f'as the robot is {2 * radius:g} m wide',
            )
    if not plan.is_enclosed:
        return
    grid = plan.grid()
    solid = ~grid.free if plan.map is not None else grid.occupied
    for zone in plan.zones.keep_out.values():
        solid |= zone.cells_on(grid)
    clearance = distance_to(solid, grid.resolution)
    # A cell's centre may be half a cell farther from the wall than the wall's own surface.
    fits = (clearance > radius - grid.resolution / 2).astype(np.uint8)
    pieces = cv2.connectedComponents(fits, connectivity=8)[1]

    def piece_at(x: float, y: float) -> int:
        return int(pieces[grid.cell_of(x, y)])

    for room, (x, y, _) in plan.place.positions.items():
        if not piece_at(x, y):
            raise PlaceError(
                ('room_positions', room),
                f'({x:g}, {y:g}) lies closer than {radius:g} m to {_what_bars(plan)}: '
                'expected room for the robot',
            )
    for name, door in plan.doors.items():
        if not piece_at(door.x, door.y):
            raise PlaceError(
                ('doors', name),
                f'{_what_bars(plan)} stands in it: expected {door.width:g} m free',
            )
    start = piece_at(*plan.start[:2])
    cut_off = [room for room, (x, y, _) in plan.place.positions.items() if piece_at(x, y) != start]
    if cut_off:
        raise PlaceError(
            ('room_positions', cut_off[0]),
            f'a robot of {2 * radius:g} m cannot drive from {plan.place.start} to '
            f'{", ".join(cut_off)}: expected no {_what_bars(plan)[2:]} in the way',
        )


def _what_bars(plan: FloorPlan) -> str:
    return 'a wall or a keep-out zone' if plan.zones.keep_out else 'a wall'
