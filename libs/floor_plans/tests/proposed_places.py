"""What is proposed for some drawn buildings, as text.

`python -m libs.floor_plans.tests.proposed_places` writes the texts anew, after a change that is
meant.
"""

from __future__ import annotations

import math
from functools import cache
from pathlib import Path

import cv2
import numpy as np

from floor_plans.map_rooms import propose
from floor_plans.occupancy_map import OccupancyMap

RECORDS = Path(__file__).with_name('proposed')

Building = dict[str, list[tuple[float, ...]]]

OFFICE: Building = {
    'walls': [
        (0, 0, 11, 0), (11, 0, 11, 7), (11, 7, 0, 7), (0, 7, 0, 0),
        (0, 2.6, 1.2, 2.6), (2.1, 2.6, 5.5, 2.6), (6.4, 2.6, 11, 2.6),
        (0, 4.2, 2.4, 4.2), (3.3, 4.2, 8.0, 4.2), (8.9, 4.2, 11, 4.2),
        (3.8, 0, 3.8, 2.6), (5.6, 4.2, 5.6, 7),
    ],
    'things': [(1.0, 1.0, 0.15), (8.0, 1.2, 0.25), (2.0, 5.6, 0.2), (7.4, 6.2, 0.25)],
    'unknown': [(9.6, 0.2, 10.8, 1.4)],
}  # fmt: skip
"""Two rooms in the south, a corridor, two rooms in the north; metres."""
OPEN: Building = {
    'walls': [
        (0, 0, 9, 0), (9, 0, 9, 6), (9, 6, 0, 6), (0, 6, 0, 0),
        (4.4, 0, 4.4, 2.0), (4.4, 4.0, 4.4, 6), (6.6, 3.0, 9, 3.0),
    ],
    'things': [(2.0, 3.0, 0.25), (6.0, 1.5, 0.1), (7.5, 4.6, 0.2)],
    'unknown': [],
}  # fmt: skip
"""A room behind an opening of two metres, and one that a wall of half its width divides."""
L_SHAPE: Building = {
    'walls': [
        (0, 0, 8, 0), (8, 0, 8, 3), (8, 3, 3, 3), (3, 3, 3, 8), (3, 8, 0, 8), (0, 8, 0, 0),
        (0, 5.0, 1.0, 5.0), (1.9, 5.0, 3, 5.0), (5.5, 0, 5.5, 1.0), (5.5, 1.85, 5.5, 3),
    ],
    'things': [],
    'unknown': [],
}  # fmt: skip
BUILDINGS = {'office': OFFICE, 'open': OPEN, 'l_shape': L_SHAPE}
VARIANTS: dict[str, tuple[str, float, float]] = {
    'office': ('office', 0.05, 0.0),
    'office_turned': ('office', 0.05, 0.4),
    'office_coarse': ('office', 0.1, 0.0),
    'office_fine': ('office', 0.03, 0.2),
    'open': ('open', 0.05, 0.0),
    'l_shape': ('l_shape', 0.05, -0.7),
}
"""Building, side of a cell, by how much it is turned, rad."""


@cache
def drawn(name: str, resolution: float, turn: float) -> OccupancyMap:
    """Return the map of a building that stands at an angle; outside of it all is unknown."""
    building = BUILDINGS[name]
    cos, sin = math.cos(turn), math.sin(turn)
    walls = np.array(building['walls'], float).reshape(-1, 2, 2)
    corners = walls.reshape(-1, 2) @ np.array([[cos, sin], [-sin, cos]])
    low = corners.min(axis=0) - 0.5
    wide, high = np.ceil((corners.max(axis=0) + 0.5 - low) / resolution).astype(int).tolist()

    def cells(points: np.ndarray) -> np.ndarray:
        turned = points.reshape(-1, 2) @ np.array([[cos, sin], [-sin, cos]])
        return np.rint((turned - low) / resolution - 0.5).astype(np.int32)

    picture = np.full((high, wide), 255, np.uint8)
    outline = [walls[0, 0]]
    left = [*walls]
    while True:  # the outer walls follow each other
        following = next((each for each in left if (each[0] == outline[-1]).all()), None)
        if following is None or (following[1] == outline[0]).all():
            break
        outline.append(following[1])
    cv2.fillPoly(picture, [cells(np.array(outline))], 0)
    for x1, y1, x2, y2 in building['unknown']:
        corner = np.array([(x1, y1), (x2, y1), (x2, y2), (x1, y2)])
        cv2.fillPoly(picture, [cells(corner)], 255)
    thick = max(1, round(0.1 / resolution))
    for wall in walls:
        start, end = cells(wall).tolist()
        cv2.line(picture, start, end, 100, thick)
    for x, y, radius in building['things']:
        (middle,) = cells(np.array([(x, y)])).tolist()
        cv2.circle(picture, middle, round(radius / resolution), 100, -1)
    values = np.where(picture == 255, -1, picture.astype(np.int16)).astype(np.int8)
    corner_of = float(low[0]), float(low[1]), 0.0
    return OccupancyMap(Path('map.yaml'), values, resolution, corner_of)


def proposed(variant: str) -> list[str]:
    """Return what is proposed for a building, a line for each thing."""
    name, resolution, turn = VARIANTS[variant]
    found = propose(drawn(name, resolution, turn), 0.22)
    lines = []
    for key, value in found.parameters.items():
        if isinstance(value, dict):
            lines += [f'{key} {each}: {_shown(entry)}' for each, entry in value.items()]
        else:
            lines.append(f'{key}: {_shown(value)}')
    rooms = found.segmentation
    areas = np.bincount(rooms.labels.ravel(), minlength=rooms.rooms + 1)[1:]
    lines.append(f'cells: {_shown(areas.tolist())}')
    lines.append(f'corridors: {_shown(sorted(rooms.corridors))}')
    lines.append(f'left out: {_shown([each.number for each in found.left_out if each.number])}')
    return lines


def _shown(value: object) -> str:
    if isinstance(value, list | tuple):
        return ' '.join(map(_shown, value))
    return f'{round(value, 2) + 0.0:g}' if isinstance(value, float) else str(value)


def main() -> None:
    """Write what is proposed now."""
    RECORDS.mkdir(exist_ok=True)
    for variant in VARIANTS:
        (RECORDS / f'{variant}.txt').write_text('\n'.join(proposed(variant)) + '\n', 'utf-8')


if __name__ == '__main__':
    main()
