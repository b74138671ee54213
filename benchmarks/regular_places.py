"""Regular places made from rectangles: an office floor, and grids, rings and trees of rooms.

A place is drawn by naming rectangles and which of them a door connects; walls, door positions and
room positions follow. The result is the parameter mapping that a place's YAML file holds, so what
is generated here can be written to a file and be checked and changed by hand afterwards:

    python benchmarks/regular_places.py office > config/office.yaml
"""

from __future__ import annotations

import math
import random
import sys
from collections import defaultdict
from collections.abc import Iterable, Mapping, Sequence
from typing import Any

from floor_plans.writing import format_place
from surveillance_runtime.command_line import CommandParser

Rectangle = tuple[float, float, float, float]
"""West, south, east and north edge, metres."""

ROOM = 4.0
"""Side of a room in a grid, ring or tree, metres."""

DOOR_WIDTH = 1.2
"""Width of each door, metres."""


def place_from_rectangles(
    rectangles: Mapping[str, Rectangle],
    connections: Iterable[tuple[str, str]],
    *,
    start: str,
) -> dict[str, Any]:
    """Return the parameters of a place whose rooms are rectangles.

    Args:
        rectangles: Each place's name and rectangle; neighbours share a piece of an edge.
        connections: Pairs of neighbours with a door in the middle of the edge they share; the doors
            are named D1, D2, ... in this order.
        start: The place where the robot starts and charges.

    Raises:
        ValueError: Two connected places do not share an edge long enough for a door.
    """
    doors: dict[str, list[float]] = {}
    rooms: dict[str, list[str]] = {name: [] for name in rectangles}
    for number, (first, second) in enumerate(connections, start=1):
        door = f'D{number}'
        doors[door] = _door_between(first, second, rectangles)
        rooms[first].append(door)
        rooms[second].append(door)
    centres = {
        name: [(west + east) / 2, (south + north) / 2]
        for name, (west, south, east, north) in rectangles.items()
    }
    return {
        'map': rooms,
        'room_positions': centres,
        'robot_room': start,
        'recharge_rooms': [start],
        'walls': _outlines(rectangles.values()),
        'doors': doors,
        'station': [*centres[start], 0.0],
    }


def office() -> dict[str, Any]:
    """Return an office floor: 40 rooms in four rows, two pairs of corridors, a link and a lobby."""
    width, depth, corridor = 4.0, 5.0, 2.5
    columns = 10
    length = columns * width
    row_south = [0.0, depth + corridor, 2 * depth + corridor, 3 * depth + 2 * corridor]
    lower, upper = depth, 3 * depth + corridor
    half = length / 2
    rectangles: dict[str, Rectangle] = {
        'E': (-8.0, lower, 0.0, upper + corridor),
        'C1': (0.0, lower, half, lower + corridor),
        'C2': (half, lower, length, lower + corridor),
        'C3': (0.0, upper, half, upper + corridor),
        'C4': (half, upper, length, upper + corridor),
        'C5': (length, lower, length + 3.0, upper + corridor),
    }
    connections = [
        ('E', 'C1'),
        ('E', 'C3'),
        ('C1', 'C2'),
        ('C3', 'C4'),
        ('C2', 'C5'),
        ('C4', 'C5'),
    ]
    for row, south in enumerate(row_south, start=1):
        for column in range(columns):
            name = f'R{row}{column + 1:02d}'
            rectangles[name] = (column * width, south, (column + 1) * width, south + depth)
            corridors = ('C1', 'C2') if row <= 2 else ('C3', 'C4')
            connections.append((corridors[column * 2 // columns], name))
    return place_from_rectangles(rectangles, connections, start='E')


def grid(columns: int, rows: int) -> dict[str, Any]:
    """Return a grid of square rooms with a door between every two neighbours."""
    cells = _cells(columns, rows)
    return place_from_rectangles(cells, _neighbours(columns, rows), start='R1')


def ring(rooms: int) -> dict[str, Any]:
    """Return an even number of rooms in two rows, connected to one loop.

    Raises:
        ValueError: The number is odd or below 4.
    """
    if rooms < 4 or rooms % 2:
        raise ValueError(f'ring of {rooms} rooms: expected an even number of at least 4')
    half = rooms // 2
    numbers = [*range(1, half + 1), *range(rooms, half, -1)]
    loop = list(zip(numbers, [*numbers[1:], numbers[0]], strict=True))
    connections = [(f'R{first}', f'R{second}') for first, second in loop]
    return place_from_rectangles(_cells(half, 2), connections, start='R1')


def tree(columns: int, rows: int, rng: random.Random) -> dict[str, Any]:
    """Return a grid of rooms whose doors form a random spanning tree: one way between any two."""
    connections = _neighbours(columns, rows)
    rng.shuffle(connections)
    group = {name: name for name in _cells(columns, rows)}

    def root(name: str) -> str:
        while group[name] != name:
            name = group[name]
        return name

    kept = []
    for first, second in connections:
        if root(first) != root(second):
            group[root(first)] = root(second)
            kept.append((first, second))
    return place_from_rectangles(_cells(columns, rows), kept, start='R1')


def _cells(columns: int, rows: int) -> dict[str, Rectangle]:
    return {
        f'R{row * columns + column + 1}': (
            column * ROOM,
            row * ROOM,
            (column + 1) * ROOM,
            (row + 1) * ROOM,
        )
        for row in range(rows)
        for column in range(columns)
    }


def _neighbours(columns: int, rows: int) -> list[tuple[str, str]]:
    pairs = []
    for row in range(rows):
        for column in range(columns):
            number = row * columns + column + 1
            if column + 1 < columns:
                pairs.append((f'R{number}', f'R{number + 1}'))
            if row + 1 < rows:
                pairs.append((f'R{number}', f'R{number + columns}'))
    return pairs


def _door_between(first: str, second: str, rectangles: Mapping[str, Rectangle]) -> list[float]:
    west_1, south_1, east_1, north_1 = rectangles[first]
    west_2, south_2, east_2, north_2 = rectangles[second]
    south, north = max(south_1, south_2), min(north_1, north_2)
    west, east = max(west_1, west_2), min(east_1, east_2)
    if west == east and north - south > DOOR_WIDTH:
        return [west, (south + north) / 2, math.pi / 2, DOOR_WIDTH]
    if south == north and east - west > DOOR_WIDTH:
        return [(west + east) / 2, south, 0.0, DOOR_WIDTH]
    raise ValueError(
        f'no door between {first} and {second}: expected an edge shared for more than '
        f'{DOOR_WIDTH} m'
    )


def _outlines(rectangles: Iterable[Rectangle]) -> dict[str, list[float]]:
    """Return the rectangles' edges as walls, pieces on one line joined where they touch."""
    rows: dict[float, list[tuple[float, float]]] = defaultdict(list)
    columns: dict[float, list[tuple[float, float]]] = defaultdict(list)
    for west, south, east, north in rectangles:
        rows[south].append((west, east))
        rows[north].append((west, east))
        columns[west].append((south, north))
        columns[east].append((south, north))
    horizontal = [
        [start, y, end, y] for y, pieces in sorted(rows.items()) for start, end in _joined(pieces)
    ]
    vertical = [
        [x, start, x, end]
        for x, pieces in sorted(columns.items())
        for start, end in _joined(pieces)
    ]
    walls = {f'w{number}': wall for number, wall in enumerate(horizontal, start=1)}
    return walls | {f'v{number}': wall for number, wall in enumerate(vertical, start=1)}


def _joined(pieces: list[tuple[float, float]]) -> list[tuple[float, float]]:
    joined: list[tuple[float, float]] = []
    for start, end in sorted(pieces):
        if joined and start <= joined[-1][1]:
            joined[-1] = (joined[-1][0], max(joined[-1][1], end))
        else:
            joined.append((start, end))
    return joined


def main(argv: Sequence[str] | None = None) -> int:
    """Print a generated place as a parameter file."""
    parser = CommandParser(
        prog='regular_places', description='Write a regular place as a parameter file.'
    )
    parser.add_argument('kind', choices=['office', 'grid', 'ring', 'tree'])
    parser.add_argument(
        '--columns', type=int, default=4, help='grid, tree: rooms from west to east'
    )
    parser.add_argument('--rows', type=int, default=3, help='grid, tree: rooms from south to north')
    parser.add_argument('--rooms', type=int, default=12, help='ring: rooms of the loop')
    parser.add_argument('--seed', type=int, default=0, help='tree: seed of the random doors')
    options = parser.parse_args(argv)
    if options.columns < 1 or options.rows < 1:
        parser.error(f'--columns {options.columns} --rows {options.rows}: expected 1 or more')
    try:
        if options.kind == 'office':
            parameters, title = office(), 'An office floor with 40 rooms.'
        elif options.kind == 'grid':
            parameters = grid(options.columns, options.rows)
            title = f'A grid of {options.columns} x {options.rows} rooms.'
        elif options.kind == 'ring':
            parameters, title = ring(options.rooms), f'{options.rooms} rooms in a ring.'
        else:
            parameters = tree(options.columns, options.rows, random.Random(options.seed))
            title = f'A tree of {options.columns} x {options.rows} rooms.'
    except ValueError as error:
        parser.error(str(error))
    made = ' '.join(argv if argv is not None else sys.argv[1:])
    title += f'\nWritten by: python benchmarks/regular_places.py {made}'
    title += '\nMetres and radians in the world frame; each door cuts its opening out of its wall.'
    sys.stdout.write(format_place(parameters, title))
    return 0


if __name__ == '__main__':
    sys.exit(main())
