"""A building from its map to a place that is drawn: `python -m floor_plans.demo [FOLDER]`.

The map is that of a robot: walls, a doorway, legs of tables, and what nobody has seen. Step by step
it becomes a file with rooms and doors, which is asked, changed and drawn.
"""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from floor_plans.description import read_place
from floor_plans.drawing import draw_place
from floor_plans.editor import PlaceEditor
from floor_plans.facts import facts
from floor_plans.imports import ImportRequest, import_place
from floor_plans.occupancy_map import write_map
from floor_plans.room_map import RoomMap

SIDE = 0.05
"""Of a cell, metres."""
WALLS = (
    *((0.5, 0.5, 12.5, 0.5), (12.5, 0.5, 12.5, 8.5), (12.5, 8.5, 0.5, 8.5), (0.5, 8.5, 0.5, 0.5)),
    *((0.5, 3.9, 2.0, 3.9), (2.9, 3.9, 7.9, 3.9), (8.8, 3.9, 12.5, 3.9)),
    *((0.5, 5.5, 1.6, 5.5), (2.5, 5.5, 9.4, 5.5), (10.3, 5.5, 12.5, 5.5)),
    *((4.5, 0.5, 4.5, 3.9), (6.5, 5.5, 6.5, 8.5)),
)
"""Ends of the walls: a corridor from west to east, two rooms on each side of it, metres."""
TABLES = ((2.2, 2.0), (9.0, 2.0), (3.4, 7.2), (9.6, 7.0))


def scanned() -> NDArray[np.int8]:
    """Return the cells of the map, row 0 at its top: 0 free, 100 occupied, -1 not seen."""
    cells = np.full((180, 260), -1, np.int8)
    cells[10:170, 10:250] = 0
    for x1, y1, x2, y2 in WALLS:
        west, east, south, north = (round(each / SIDE) for each in (x1, x2, y1, y2))
        cells[south - 1 : north + 1, west - 1 : east + 1] = 100
    for x, y in TABLES:
        for dx, dy in ((0, 0), (1.2, 0), (0, 0.7), (1.2, 0.7)):
            row, column = round((y + dy) / SIDE), round((x + dx) / SIDE)
            cells[row : row + 2, column : column + 2] = 100
    return cells[::-1]


def main(folder: Path = Path('floor_plans_demo')) -> None:
    """Make a place of a map, ask it, change it and draw it, in a folder."""
    folder.mkdir(parents=True, exist_ok=True)
    print('1. A map, as a robot leaves it:', folder / 'map.yaml')
    write_map(folder / 'map.yaml', scanned(), SIDE, (0.0, 0.0, 0.0))

    print('2. Its rooms and doors are found:')
    place = folder / 'place.yaml'
    for line in import_place(ImportRequest(folder / 'map.yaml', place, force=True)).lines:
        print('  ', line)

    print('3. Which room is where:')
    plan = read_place(place).plan
    rooms = RoomMap(plan)
    for x, y in ((2.0, 1.0), (6.0, 4.7), (11.0, 7.5), (20.0, 1.0)):
        print(f'   ({x:g}, {y:g}) lies in {rooms.room_at(x, y) or "no room"}')

    print('4. It is changed, checked, and taken back:')
    editor = PlaceEditor(place)
    office = rooms.room_at(2.0, 1.0)
    print('  ', editor.apply('rename', {'kind': 'room', 'name': office, 'new': 'office'}))
    print('  ', editor.apply('cut', {'x1': 9, 'y1': 6, 'x2': 9, 'y2': 8}))
    print('  ', editor.undo())
    print('  ', editor.problem_with('remove_room', {'room': rooms.room_at(6.0, 4.7)}))
    print('  ', editor.save())

    print('5. It is drawn:', folder / 'drawn.png')
    plan = read_place(place).plan
    draw_place(plan, 'A small office', facts(plan)).save(folder / 'drawn.png')


if __name__ == '__main__':
    main(*map(Path, sys.argv[1:2]))
