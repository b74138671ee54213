"""How well the robot knows where it is, on logs of real robots and on late, swept scans.

`--log FILE` reads a log in CARMEN's format whose laser poses were corrected (by SLAM): they are
the truth, the robot poses beside them the raw odometry. The map is drawn from the scans at their
true poses. A port of AMCL's particle filter (likelihood field, KLD left out; Nav2's defaults) runs
on the same map, odometry and scans. Without a log, late and swept scans of the simulated flat are
measured, and a peer that takes each scan for one of now.

    .venv/bin/python benchmarks/localisation.py --log intel.log
    .venv/bin/python benchmarks/localisation.py --quick
"""

from __future__ import annotations

import math
import sys
import time
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

sys.path.insert(0, str(Path(__file__).resolve().parent.parent))

from benchmarks.sizes import Size, sized_parser
from benchmarks.tables import table
from floor_plans import Grid
from floor_plans.occupancy_grid import distance_to
from lidar_navigation import Localiser
from lidar_navigation.geometry import Pose, Scan, angle_between, composed, in_map, relative
from lidar_navigation.localisation.odometry import OdometryBuffer, joined
from surveillance_simulation.robot.lidar import LidarModel, scan
from surveillance_simulation.world.simulated_place import SimulatedPlace, read_simulated_place

Floats = npt.NDArray[np.float64]
ROOT = Path(__file__).resolve().parent.parent
REACH = 20.0
"""Farther ranges of a log count as nothing met, metres."""
JUMP = 0.5
"""An estimate that moves this much more than the odometry between two scans jumped, metres."""


@dataclass(frozen=True)
class Record:
    """One scan of a log: where the robot was by SLAM, by its odometry, and what it saw."""

    stamp: float
    truth: Pose
    odometry: Pose
    ranges: Floats


def carmen(path: Path) -> list[Record]:
    """Read the scans of a log in CARMEN's format: messages FLASER and ROBOTLASER1.

    FLASER n r1..rn x y theta odom_x odom_y odom_theta time host time
    ROBOTLASER1 type start fov resolution max accuracy remission n r1..rn m e1..em
        x y theta odom_x odom_y odom_theta ...

    Raises:
        ValueError: A line is cut off or holds no numbers; the line is named.
    """
    records = []
    with path.open(encoding='ascii', errors='replace') as lines:
        for number, line in enumerate(lines, start=1):
            words = line.split()
            if not words or words[0] not in ('FLASER', 'ROBOTLASER1'):
                continue
            try:
                records.append(_record(words))
            except (ValueError, IndexError) as error:
                raise ValueError(
                    f'{path}:{number}: {words[0]}: expected numbers: {error}'
                ) from None
    if not records:
        raise ValueError(f'{path}: no scan: expected lines that begin with FLASER or ROBOTLASER1')
    return records


def _record(words: list[str]) -> Record:
    if words[0] == 'FLASER':
        count = int(words[1])
        at = 2 + count
        ranges = words[2:at]
    else:
        count = int(words[8])
        ranges = words[9 : 9 + count]
        at = 9 + count
        at += 1 + int(words[at])
    x, y, yaw, odom_x, odom_y, odom_yaw = (float(word) for word in words[at : at + 6])
    # Time of the logger is the last word.
    return Record(
        float(words[-1]),
        (x, y, yaw),
        (odom_x, odom_y, odom_yaw),
        np.array([float(word) for word in ranges]),
    )


def seen(record: Record) -> Scan:
    """Return the scan of a lidar that looks forwards over half a turn."""
    count = len(record.ranges)
    angles = -math.pi / 2 + (np.arange(count) + 0.5) * math.pi / count
    ranges = np.where(record.ranges < REACH, record.ranges, np.inf)
    return Scan(angles, np.maximum(ranges, 0.05), REACH)


def drawn(records: list[Record], resolution: float = 0.05) -> Grid:
    """Return the map that the scans make at their true poses: hits against passes of rays."""
    poses = np.array([record.truth for record in records])
    low = poses[:, :2].min(axis=0) - REACH / 2
    size = np.ceil((poses[:, :2].max(axis=0) + REACH / 2 - low) / resolution).astype(int)
    hits = np.zeros((size[1], size[0]), np.int32)
    passes = np.zeros_like(hits)

    def cells(points: Floats) -> tuple[Any, Any]:
        cell = np.floor((points - low) / resolution).astype(int)
        inside = ((cell >= 0) & (cell < size)).all(axis=1)
        return cell[inside, 1], cell[inside, 0]

    for record in records[::2]:
        found = seen(record)
        met = found.ranges < 12.0
        way = np.minimum(np.where(np.isfinite(found.ranges), found.ranges, 0.0), 12.0)
        steps = np.arange(0.0, 12.0, resolution)
        along = steps[None, :] < (way - resolution)[:, None]
        x = np.cos(found.angles)[:, None] * steps
        y = np.sin(found.angles)[:, None] * steps
        np.add.at(passes, cells(in_map(record.truth, np.stack([x[along], y[along]], axis=1))), 1)
        points = np.stack(
            [
                found.ranges[met] * np.cos(found.angles[met]),
                found.ranges[met] * np.sin(found.angles[met]),
            ],
            axis=1,
        )
        np.add.at(hits, cells(in_map(record.truth, points)), 1)
    told = np.full(hits.shape, -1, np.int8)
    told[passes > 0] = 0
    told[(hits >= 2) & (hits * 4 >= passes)] = 100
    return Grid(told, resolution, (float(low[0]), float(low[1])))


class Amcl:
    """A port of AMCL: particles, the odometry's noise (alpha 0.2), a likelihood field (Nav2)."""

    def __init__(self, grid: Grid, pose: Pose, rng: np.random.Generator, count: int = 1000) -> None:
        self._grid = grid
        self._field = distance_to(grid.occupied, grid.resolution)
        self._rng = rng
        spread = np.array([0.25, 0.25, 0.26])
        self._particles = np.array(pose) + rng.standard_normal((count, 3)) * spread
        self._weights = np.full(count, 1.0 / count)
        self._odometry: Pose | None = None
        self._since: Pose | None = None
        self.pose = pose

    def step(self, odometry: Pose, found: Scan) -> None:
        """Take odometry and scan; they count after 0.25 m or 0.2 rad (update_min_d, _a)."""
        if self._since is None:
            self._since = odometry
            self._see(found)
            return
        dx, dy, turn = relative(self._since, odometry)
        if math.hypot(dx, dy) < 0.25 and abs(turn) < 0.2:
            self.pose = composed(self._mean(), (dx, dy, turn))
            return
        self._since = odometry
        self._move(dx, dy, turn)
        self._see(found)

    def _move(self, dx: float, dy: float, turn: float) -> None:
        trans = math.hypot(dx, dy)
        first = math.atan2(dy, dx) if trans > 0.01 else 0.0
        last = angle_between(first, turn)
        back = min(abs(first), abs(abs(first) - math.pi)), min(abs(last), abs(abs(last) - math.pi))
        n, a = len(self._particles), 0.2
        draw = self._rng.standard_normal((3, n))
        rot1 = first - draw[0] * math.sqrt(a * back[0] ** 2 + a * trans**2)
        way = trans - draw[1] * math.sqrt(a * trans**2 + a * back[0] ** 2 + a * back[1] ** 2)
        rot2 = last - draw[2] * math.sqrt(a * back[1] ** 2 + a * trans**2)
        p = self._particles
        p[:, 0] += way * np.cos(p[:, 2] + rot1)
        p[:, 1] += way * np.sin(p[:, 2] + rot1)
        p[:, 2] += rot1 + rot2

    def _see(self, found: Scan) -> None:
        thin = found.thinned(60)
        met = np.isfinite(thin.ranges)
        x, y = (
            thin.ranges[met] * np.cos(thin.angles[met]),
            thin.ranges[met] * np.sin(thin.angles[met]),
        )
        p = self._particles
        cos, sin = np.cos(p[:, 2])[:, None], np.sin(p[:, 2])[:, None]
        column = (
            (p[:, :1] + cos * x - sin * y - self._grid.origin[0]) / self._grid.resolution
        ).astype(int)
        row = (
            (p[:, 1:2] + sin * x + cos * y - self._grid.origin[1]) / self._grid.resolution
        ).astype(int)
        rows, columns = self._field.shape
        inside = (row >= 0) & (row < rows) & (column >= 0) & (column < columns)
        away = np.where(
            inside, self._field[np.clip(row, 0, rows - 1), np.clip(column, 0, columns - 1)], 2.0
        )
        away = np.minimum(away, 2.0)
        chance = 0.5 * np.exp(-(away**2) / (2 * 0.2**2)) + 0.5 / REACH
        self._weights *= 1.0 + (chance**3).sum(axis=1)
        self._weights /= self._weights.sum()
        n = len(p)
        if 1.0 / (self._weights**2).sum() < n / 2:
            places = (np.arange(n) + self._rng.random()) / n
            taken = np.searchsorted(np.cumsum(self._weights), places).clip(0, n - 1)
            self._particles = p[taken].copy()
            self._weights = np.full(n, 1.0 / n)
        self.pose = self._mean()

    def _mean(self) -> Pose:
        x, y = self._weights @ self._particles[:, :2]
        yaw = math.atan2(
            self._weights @ np.sin(self._particles[:, 2]),
            self._weights @ np.cos(self._particles[:, 2]),
        )
        return float(x), float(y), yaw


def errors_on(records: list[Record], grid: Grid, who: str) -> tuple[Floats, int, int, float]:
    """Return errors (metres), jumps, searches and the share of a core that one estimator takes."""
    first = records[0]
    searches = 0

    def count() -> None:
        nonlocal searches
        searches += 1

    ours = Localiser(grid, first.truth, count)
    peer = Amcl(grid, first.truth, np.random.default_rng(0))
    errors, jumps = [], 0
    last: tuple[Pose, Pose] | None = None
    begun = time.process_time()
    for record in records:
        found = seen(record)
        if who == 'ours':
            ours.move(record.odometry)
            ours.see(found, record.stamp - first.stamp)
            pose = ours.pose
        else:
            peer.step(record.odometry, found)
            pose = peer.pose
        if last is not None:
            step = composed(last[0], relative(last[1], record.odometry))
            jumps += math.dist(step[:2], pose[:2]) > JUMP
        last = pose, record.odometry
        errors.append(math.dist(pose[:2], record.truth[:2]))
    took = time.process_time() - begun
    return np.array(errors), jumps, searches, took / max(records[-1].stamp - first.stamp, 1e-9)


def print_table(title: str, head: Sequence[str], rows: Sequence[Sequence[str]]) -> None:
    """Print a table below its title."""
    print(f'\n{title}\n\n{table([head, *rows])}\n')


def on_log(path: Path) -> None:
    """Print how both estimators do on a log."""
    records = carmen(path)
    grid = drawn(records)
    rows = []
    for who in ('ours', 'AMCL, port'):
        errors, jumps, searches, core = errors_on(records, grid, who)
        p50, p95, worst = np.percentile(errors, [50, 95, 100])
        rows.append(
            [
                who,
                f'{p50:.3f}',
                f'{p95:.3f}',
                f'{worst:.2f}',
                str(jumps),
                str(searches),
                f'{core:.1%}',
            ]
        )
    way = sum(math.dist(a.odometry[:2], b.odometry[:2]) for a, b in pairwise(records))
    print_table(
        f'{path.name}: {len(records)} scans, {way:.0f} m by odometry; position error, m.',
        ('estimator', 'p50', 'p95', 'max', 'jumps', 'searches', 'of a core'),
        rows,
    )


def drive(
    world: SimulatedPlace, late: float, sweep: float, seconds: float
) -> Iterator[tuple[Any, ...]]:
    """Yield truth, odometry and scan of a robot that drives to and fro, as they come.

    A scan begins at its stamp, takes `sweep` seconds, and comes `late` seconds after its stamp.
    """
    x, y, _ = world.plan.start
    model = LidarModel(rays=180)
    rng = np.random.default_rng(3)
    offsets = np.linspace(0.0, sweep, model.rays)

    def truth(at: float) -> Pose:
        return x + 0.6 * math.sin(0.5 * at), y + 0.1 * math.sin(0.9 * at), 1.2 * math.sin(0.7 * at)

    waiting: list[tuple[float, float, Floats]] = []
    for tick in range(int(seconds * 50)):
        now = tick / 50
        odometry = truth(now)
        if tick % 5 == 0:
            if sweep:
                ranges = np.empty(model.rays)
                for part in np.array_split(np.arange(model.rays), 12):
                    whole = scan(world, truth(now + float(offsets[part].mean())), model, rng)
                    ranges[part] = whole[part]
            else:
                ranges = scan(world, truth(now), model, rng).astype(float)
            waiting.append((now + max(late, sweep), now, ranges))
        ready = [each for each in waiting if each[0] <= now]
        waiting = [each for each in waiting if each[0] > now]
        found = [
            (stamp, Scan(model.angles, ranges, model.range_max, times=offsets if sweep else None))
            for _, stamp, ranges in ready
        ]
        yield now, odometry, found


def late_scans(size: Size) -> None:
    """Print how late and swept scans change the estimate, with and without joining in time."""
    world = read_simulated_place(ROOT / 'config' / 'seven_rooms.yaml')
    grid = world.plan.grid(0.05)
    rows = []
    for late, sweep in ((0.0, 0.0), (0.1, 0.0), (0.3, 0.0), (0.1, 0.1), (0.3, 0.1)):
        row = [f'{late:g} s', f'{sweep:g} s']
        for joins in (False, True):
            off, turned = [], []
            localiser: Localiser | None = None
            readings = OdometryBuffer()
            for now, odometry, found in drive(world, late, sweep, size.of(60.0, 12.0, 1.5)):
                localiser = localiser or Localiser(grid, odometry)
                readings.add(now, odometry)
                localiser.move(odometry)
                for stamp, each in found:
                    taken = joined(each, readings, stamp) if joins else each
                    localiser.see(taken, now)
                if now > 1.0:
                    off.append(math.dist(localiser.pose[:2], odometry[:2]))
                    turned.append(abs(angle_between(localiser.pose[2], odometry[2])))
            row += [f'{np.median(off):.3f}', f'{np.percentile(turned, 95):.3f}']
        rows.append(row)
    print_table(
        'Scans that come late, and that take a while; p50 of the position, m, p95 of the yaw, rad.',
        ('late', 'sweep', 'as of now: m', 'rad', 'joined: m', 'rad'),
        rows,
    )


def main() -> int:
    """Measure and print."""
    parser = sized_parser(__doc__, quick='fewer and shorter runs')
    parser.add_argument('--log', type=Path, action='append', default=[], help='in CARMEN format')
    options = parser.parse_args()
    for path in options.log:
        try:
            on_log(path)
        except (OSError, ValueError) as error:
            print(f'localisation.py: {error}', file=sys.stderr)
            return 2
    if not options.log:
        late_scans(options.size)
    return 0


if __name__ == '__main__':
    sys.exit(main())
