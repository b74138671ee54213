"""Whether the lidar sees walkers in real logs: it should where somebody walks, and nowhere else.

.venv/bin/python benchmarks/walkers.py LOG ... [--pictures FOLDER]

A log is CARMEN's (lines FLASER, `.log` or `.log.gz`) or FLIRT's (lines VERTEX2 and ROBOTLASER1, in
turn). Public ones are in github.com/acschaefer/ple (data/carmen) and github.com/tipaldi/flirtlib
(data). The robot's own map builder maps it, its localiser finds the robot on that map, scan after
scan, and the observer's watcher looks at the sweeps. Nobody has marked who walks in these logs:
with --pictures each walk is drawn, the last sweeps in colours from blue to red, to be looked at.
"""

from __future__ import annotations

import argparse
import gzip
import math
import sys
import tempfile
import time
from collections.abc import Iterator
from dataclasses import dataclass
from datetime import UTC, datetime
from itertools import pairwise
from pathlib import Path

import cv2
import numpy as np
from numpy.typing import NDArray

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

from benchmarks.sizes import Size, sized_parser
from benchmarks.tables import table
from floor_plans import Grid
from indoor_watch import ChangeMonitor, EventBook, Kind, Observation
from lidar_navigation import Localiser, MapBuilder
from lidar_navigation.geometry import Pose, Scan
from surveillance_simulation.robot.lidar import LidarModel, scan
from surveillance_simulation.world.simulated_place import read_simulated_place

ROOT = Path(__file__).resolve().parents[1]
Points = NDArray[np.float64]

REACH = 25.0
"""Beams that go farther met nothing, metres."""
STAY = 60.0
"""A robot on patrol is at another place after this time, seconds."""
AROUND, SHOWN = 4.0, 14
"""A picture shows so much to each side, metres, and so many sweeps before."""


@dataclass(frozen=True)
class Sweep:
    """A scan of a log: when, where the log has the robot, and what was measured."""

    stamp: float
    pose: Pose
    scan: Scan


def read_log(file: Path) -> list[Sweep]:
    """Return the scans of a log, in its order."""
    with gzip.open(file, 'rt') if file.suffix == '.gz' else file.open() as lines:
        found = list(_sweeps(lines))
    # Some logs have no times: then a second lies between two scans.
    timed = all(a.stamp < b.stamp for a, b in pairwise(found[:50]))
    return found if timed else [Sweep(float(n), e.pose, e.scan) for n, e in enumerate(found)]


def _sweeps(lines: Iterator[str]) -> Iterator[Sweep]:
    pose: Pose | None = None
    for line in lines:
        kind, *words = line.split() or ['']
        if kind == 'VERTEX2':
            x, y, yaw = (float(word) for word in words[1:4])
            pose = x, y, yaw
        elif kind == 'FLASER':
            count = int(words[0])
            ranges = np.array(words[1 : 1 + count], float)
            x, y, yaw, *_, stamp = (float(word) for word in words[1 + count : 8 + count])
            # Half a turn, in steps of a degree or half of one.
            step = math.pi / (count - count % 2)
            angles = np.asarray(-math.pi / 2 + step * np.arange(count), np.float64)
            yield Sweep(stamp, (x, y, yaw), _scan(angles, ranges))
        elif kind == 'ROBOTLASER1' and pose is not None:
            count = int(words[7])
            angles = np.asarray(float(words[1]) + float(words[3]) * np.arange(count), np.float64)
            ranges = np.array(words[8 : 8 + count], float)
            rest = words[8 + count :]
            stamp = float(rest[-3]) if len(rest) > 3 else 0.0
            yield Sweep(stamp, pose, _scan(angles, ranges))


def _scan(angles: Points, ranges: Points) -> Scan:
    ranges = np.where(ranges >= REACH, np.inf, ranges)
    return Scan(angles, np.where(ranges <= 0.05, np.nan, ranges), REACH)


def mapped(log: list[Sweep]) -> Grid:
    """Return the map that the robot makes of a log."""
    builder = MapBuilder(start=log[0].pose)
    for each in log:
        builder.see(each.scan, each.pose)
    return builder.grid()


def beams(pose: Pose, scan: Scan) -> tuple[Points, NDArray[np.bool_]]:
    """Return where beams ended, map frame, and which of them met something."""
    told = ~np.isnan(scan.ranges)
    angles, ranges = scan.angles[told] + pose[2], np.minimum(scan.ranges[told], REACH)
    ends = np.stack([np.cos(angles), np.sin(angles)], axis=1) * ranges[:, None] + pose[:2]
    return ends, scan.ranges[told] < REACH


def draw(grid: Grid, at: tuple[float, float], seen: list[tuple[Pose, Points]]) -> NDArray[np.uint8]:
    """Return a picture of some sweeps around a point, the last ones red."""
    side = 480
    scale = side / (2 * AROUND)
    picture = np.full((side, side, 3), 255, np.uint8)

    def pixels(points: Points) -> list[tuple[int, int]]:
        near = points[(np.abs(points - at) < AROUND).all(axis=1)]
        across, up = ((near - at + AROUND) * scale).astype(int).T
        return list(zip(across.tolist(), (side - up).tolist(), strict=True))

    half = round(grid.resolution * scale / 2)
    for x, y in pixels(grid.centres_of(np.argwhere(grid.occupied))):
        cv2.rectangle(picture, (x - half, y - half), (x + half, y + half), (190, 190, 190), -1)
    for number, (pose, ends) in enumerate(seen):
        shade = np.array([[round(255 * number / max(1, len(seen) - 1))]], np.uint8)
        colour = cv2.applyColorMap(shade, cv2.COLORMAP_JET)[0, 0].tolist()
        for point in pixels(ends):
            cv2.circle(picture, point, 1, colour, -1)
        for point in pixels(np.array([pose[:2]])):
            cv2.circle(picture, point, 5, colour, 1)
    return picture


def watch(log: list[Sweep], pictures: Path | None, name: str) -> tuple[int, list[str], float]:
    """Let the observer look at a log; return sweeps, walks that are told, and ms a sweep."""
    grid = mapped(log)
    localiser = Localiser(grid, log[0].pose)
    told: list[Observation] = []
    watcher = ChangeMonitor(
        [],
        EventBook(),
        local=lambda stamp: datetime.fromtimestamp(stamp, UTC),
        robot='Robot1',
        tell=told.append,
    )
    watcher.use_map(grid)
    place, began, last = 0, log[0].stamp, log[0].stamp
    watcher.arrive('0', began)
    seen: list[tuple[Pose, Points]] = []
    walks: list[str] = []
    spent = 0.0
    for number, each in enumerate(log):
        localiser.move(each.pose)
        localiser.see(each.scan, each.stamp)
        if not localiser.plausible:
            continue
        if each.stamp - began > STAY or each.stamp - last > STAY:
            place, began = place + 1, each.stamp
            watcher.arrive(str(place), began)
        last = each.stamp
        ends, met = beams(localiser.pose, each.scan)
        seen = [*seen[-SHOWN:], (localiser.pose, ends[met])]
        count = len(told)
        begun = time.process_time()
        watcher.sweep(localiser.pose[:2], ends, met, each.stamp)
        spent += time.process_time() - begun
        for walk in told[count:]:
            if walk.kind == Kind.PERSON and walk.state == 'seen' and walk.position is not None:
                walks.append(f'{number} at {walk.position[0]:.1f}, {walk.position[1]:.1f}')
                if pictures is not None:
                    pictures.mkdir(parents=True, exist_ok=True)
                    picture = draw(grid, walk.position, seen)
                    cv2.imwrite(str(pictures / f'{name}-{number}.png'), picture)
    return len(log), walks, 1000.0 * spent / max(1, len(log))


def main() -> None:
    """Print the table."""
    parser = sized_parser(__doc__)
    parser.add_argument('logs', type=Path, nargs='*')
    parser.add_argument('--pictures', type=Path, help='where each walk is drawn')
    given = parser.parse_args()
    with tempfile.TemporaryDirectory() as folder:
        if given.size is Size.SMOKE:
            given.logs = [Path(folder) / 'simulated.log']
            write_log(given.logs[0])
        elif not given.logs:
            parser.error('no log is named')
        measure(given)


def write_log(file: Path) -> None:
    """Write what a robot on its way through the seven rooms sees, as CARMEN does."""
    world, model = read_simulated_place(ROOT / 'config' / 'seven_rooms.yaml'), LidarModel(rays=180)
    rng, lines = np.random.default_rng(1), []
    x, y, yaw = world.plan.start
    for number in range(12):
        pose = x + 0.05 * number, y, yaw
        ranges = ' '.join(f'{each:.2f}' for each in scan(world, pose, model, rng))
        at = ' '.join(f'{each:.3f}' for each in pose)
        lines.append(f'FLASER {model.rays} {ranges} {at} {at} {0.5 * number:.1f}\n')
    file.write_text(''.join(lines), encoding='utf-8')


def measure(given: argparse.Namespace) -> None:
    """Look at the logs and print the table."""
    rows = [['log', 'scans', 'apart', 'walks told', 'ms CPU a scan']]
    for file in given.logs:
        log = read_log(file)
        apart = float(np.median(np.diff([each.stamp for each in log])))
        name = file.name.partition('.')[0]
        scans, walks, spent = watch(log, given.pictures, name)
        rows.append([name, str(scans), f'{apart:.2f} s', str(len(walks)), f'{spent:.1f}'])
        print(name, '; '.join(walks) or 'nobody', file=sys.stderr, flush=True)
    print(table(rows))


if __name__ == '__main__':
    main()
