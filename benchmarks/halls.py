#!/usr/bin/env python3
"""Measure how much of a hall's floor a simulated patrol sees within the urgency threshold.

    .venv/bin/python benchmarks/halls.py [--quick] [--map FILE --threshold S]

Three buildings of one place are drawn, imported by the command `import`, and patrolled in
simulation as fast as it goes: an arena with nine pillars as TurtleBot3's world has them, a
warehouse of four aisles, a hall of 50 m x 30 m. Where the robot truly was is sampled twice a
second; what it saw from there follows from beams over the cells of the map, whatever the robot
believes. From the end of the first sweep on, it is measured every five seconds which part of the
floor was seen within the threshold. The peer is a robot that stands at its place's point, as all
robots did before places were areas.
"""

from __future__ import annotations

import argparse
import json
import sys
import tempfile
import threading
import time
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from scipy import ndimage

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

from benchmarks.sizes import Size, sized_parser
from benchmarks.whole_stack import Stack
from floor_plans.imports import ImportRequest, import_place
from floor_plans.occupancy_map import read_map, write_map

SIDE = 0.05
REACH = 6.0
Cells = NDArray[np.int8]
Mask = NDArray[np.bool_]


def arena() -> Cells:
    """Return TurtleBot3's world: a hexagon with nine pillars of 0.15 m, 1.1 m apart."""
    row, column = np.mgrid[0:140, 0:140]
    x, y = (column - 70) * SIDE, (row - 70) * SIDE
    angles = np.radians([0.0, 60.0, 120.0])[:, None, None]
    away = np.abs(x * np.cos(angles) + y * np.sin(angles)).max(axis=0)
    cells = np.full(x.shape, -1, np.int8)
    cells[away < 2.8] = 100
    cells[away < 2.7] = 0
    for east in (-1.1, 0.0, 1.1):
        for north in (-1.1, 0.0, 1.1):
            cells[np.hypot(x - east, y - north) < 0.15] = 100
    return cells


def box(width: float, height: float) -> Cells:
    """Return a floor with walls around it, metres."""
    rows, columns = round(height / SIDE), round(width / SIDE)
    cells = np.full((rows + 24, columns + 24), -1, np.int8)
    cells[10:-10, 10:-10] = 100
    cells[12:-12, 12:-12] = 0
    return cells


def warehouse() -> Cells:
    """Return a hall of 26 m x 16 m with three double shelves, which leave four aisles."""
    cells = box(26.0, 16.0)
    for each in range(3):
        row = 76 + each * 72
        cells[row : row + 28, 92:452] = 100
    return cells


def hall() -> Cells:
    """Return a hall of 50 m x 30 m with columns."""
    cells = box(50.0, 30.0)
    for row in (172, 452):
        for column in range(112, 1000, 200):
            cells[row - 6 : row + 6, column - 6 : column + 6] = 100
    return cells


def seen_from(free: Mask, row: float, column: float) -> tuple[NDArray[np.intp], NDArray[np.intp]]:
    """Return the cells that beams over the map reach from a point, in cells."""
    count = round(2 * np.pi * REACH / SIDE)
    angle = np.linspace(0.0, 2 * np.pi, count, endpoint=False)[:, None]
    away = np.arange(0.0, REACH / SIDE, 0.7)
    rows = np.clip(np.floor(row + np.sin(angle) * away).astype(int), 0, free.shape[0] - 1)
    columns = np.clip(np.floor(column + np.cos(angle) * away).astype(int), 0, free.shape[1] - 1)
    open_ = np.cumsum(~free[rows, columns], axis=1) == 0
    return rows[open_], columns[open_]


@dataclass
class Patrol:
    """What one simulated patrol came to."""

    floor: float
    sweep: float
    mean: float
    least: float
    standing: float
    visits: int


def patrol(map_file: Path, threshold: float, seconds: float, folder: Path) -> Patrol:
    """Patrol a map for a while of simulated time after the first sweep."""
    place, record = folder / 'place.yaml', folder / 'events.jsonl'
    import_place(ImportRequest(map_file, place, force=True))
    building = read_map(map_file)
    grid = building.grid
    free = grid.free
    own = {
        'robot_behavior': {'record': str(record), 'coverage.range': REACH},
        '*': {'urgency_threshold': round(threshold), 'map_file': str(map_file.absolute())},
    }

    def entries(kind: str) -> list[dict[str, float]]:
        lines = record.read_text().splitlines() if record.exists() else []
        return [entry for entry in map(json.loads, lines) if entry['event'] == kind]

    stack = Stack(place, own)
    at = np.full(free.shape, -np.inf)
    shares: list[float] = []
    standing = 0.0
    floor: Mask | None = None
    first_end = np.inf
    looks, last, measured = threading.Event(), -1.0, -np.inf
    try:
        stack.start()
        began = time.monotonic()
        while stack.robot.time < (first_end + seconds if np.isfinite(first_end) else 3600.0):
            if stack.error is not None or time.monotonic() - began > 3000.0:
                raise SystemExit(f'the patrol ended: {stack.error}')
            looks.wait(0.01)
            now, (x, y, _) = stack.robot.time, stack.robot.base.pose
            if now - last < 0.5:
                continue
            last = now
            row, column = (y - grid.origin[1]) / SIDE, (x - grid.origin[0]) / SIDE
            at[seen_from(free, row, column)] = now
            if floor is None:
                parts, _ = ndimage.label(free)
                floor = np.asarray(parts == parts[int(row), int(column)])
                standing = float((np.isfinite(at) & floor).sum() / floor.sum())
            if not np.isfinite(first_end) and entries('sweep'):
                first_end = now
            if now >= first_end and now - measured >= 5.0:
                measured = now
                shares.append(float(((at >= now - threshold) & floor).sum() / floor.sum()))
    finally:
        stack.close()
    assert floor is not None
    sweeps = entries('sweep')
    took = float(np.mean([entry['seconds'] for entry in sweeps]))
    area = float(floor.sum()) * SIDE**2
    return Patrol(area, took, float(np.mean(shares)), min(shares), standing, len(sweeps))


def main() -> int:
    parser = sized_parser(__doc__, quick='the arena and the warehouse, a few minutes each')
    parser.add_argument('--map', type=Path, help='another map, in place of the three')
    parser.add_argument('--threshold', type=float, default=600.0, help='of that map, seconds')
    options: argparse.Namespace = parser.parse_args()
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        cases = {'arena': (arena, 120.0), 'warehouse': (warehouse, 600.0), 'hall': (hall, 1200.0)}
        names = options.size.of(list(cases), ['arena', 'warehouse'], ['arena'])
        seconds = options.size.of(2.0, 1.0, 0.1)
        chosen = []
        for each in names:
            draw, threshold = cases[each]
            (folder / each).mkdir()
            write_map(folder / each / 'map.yaml', draw()[::-1], SIDE, (-2.0, -2.0, 0.0))
            chosen.append((each, folder / each / 'map.yaml', threshold))
        if options.map is not None and options.size is not Size.SMOKE:
            (folder / 'other').mkdir()
            chosen = [(options.map.stem, options.map, options.threshold)]
        print(
            f'{"building":12} {"floor m2":>8} {"threshold s":>11} {"sweep s":>8} {"sweeps":>6} '
            f'{"seen, mean":>10} {"least":>7} {"standing":>8}'
        )
        for each, map_file, threshold in chosen:
            own = folder / (each if options.map is None else 'other')
            found = patrol(map_file, threshold, seconds * threshold, own)
            print(
                f'{each:12} {found.floor:8.0f} {threshold:11.0f} {found.sweep:8.0f} '
                f'{found.visits:6} {found.mean:10.1%} {found.least:7.1%} {found.standing:8.1%}',
                flush=True,
            )
    return 0


if __name__ == '__main__':
    sys.exit(main())
