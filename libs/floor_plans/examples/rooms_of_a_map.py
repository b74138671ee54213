"""Rooms, doors and areas of a map; the map is drawn here, with two rooms and a table."""

from __future__ import annotations

import tempfile
from pathlib import Path

import numpy as np

from floor_plans import RoomMap, read_place
from floor_plans.imports import ImportRequest, import_place
from floor_plans.occupancy_map import write_map


def main() -> None:
    """Make a place of a map, and say how large each of its rooms is."""
    cells = np.full((90, 130), -1, np.int8)
    cells[5:85, 5:125] = 0
    cells[[5, 84], 5:125] = cells[5:85, 5] = cells[5:85, 124] = cells[5:85, 64] = 100
    cells[35:55, 64] = 0
    cells[10:16, 10:26] = 100
    with tempfile.TemporaryDirectory() as folder:
        source, place = Path(folder) / 'flat.yaml', Path(folder) / 'place.yaml'
        write_map(source, cells, 0.05, (0.0, 0.0, 0.0))
        print(import_place(ImportRequest(source, place)).found)
        plan = read_place(place).plan
        rooms = RoomMap(plan)
        for name, mask in rooms.masks().items():
            area = np.count_nonzero(mask & rooms.grid.free) * rooms.grid.resolution**2
            print(f'{name}: {area:.1f} m2, doors {", ".join(plan.place.rooms[name])}')


if __name__ == '__main__':
    main()
