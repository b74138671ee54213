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

import importlib.util
import math
import sys
import time
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise
from pathlib import Path
from typing import Any, Protocol

import numpy as np
import numpy.typing as npt

sys.path.insert(0, str(Path(__file__).resolve().parent.parent))

from benchmarks import regular_places
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
            ours.move(record.odometry, record.stamp - first.stamp)
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


def driven_badly(records: list[Record], rng: np.random.Generator) -> list[Record]:
    """Return a log with an odometry that drifts, where its own is the truth, and with times.

    A corrected log may have lost what the wheels said: then each step is wrong by 3 % of the way
    and 5 % of the turn, and by 0.02 rad a metre (standard deviations). Stamps that stand still
    become those of a robot of 0.5 m/s and 1 rad/s.
    """
    if any(record.odometry != record.truth for record in records):
        return records
    odometry, now, result = records[0].truth, records[0].stamp, [records[0]]
    for before, after in pairwise(records):
        dx, dy, turn = relative(before.truth, after.truth)
        way = math.hypot(dx, dy)
        wrong = 1.0 + 0.03 * rng.standard_normal()
        bent = 0.05 * turn * rng.standard_normal() + 0.02 * way * rng.standard_normal()
        odometry = composed(odometry, (wrong * dx, wrong * dy, turn + bent))
        now = max(after.stamp, now + max(way / 0.5, abs(turn), 0.05))
        result.append(replace(after, stamp=now, odometry=odometry))
    return result


def on_log(path: Path) -> None:
    """Print how both estimators do on a log."""
    records = driven_badly(carmen(path), np.random.default_rng(0))
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


@dataclass(frozen=True)
class Moment:
    """What a robot is at the moment of a scan: its time, seconds; where it is, and what it sees."""

    now: float
    truth: Pose
    scan: Scan


class Peer(Protocol):
    """An estimator of the pose, as a stage drives it."""

    @property
    def pose(self) -> Pose:
        """The estimate."""

    @property
    def doubts(self) -> bool:
        """Whether it says that it may be elsewhere."""

    def step(self, odometry: Pose, found: Scan, now: float) -> None:
        """Take odometry and scan."""


class Ours:
    """The localiser of the library."""

    def __init__(self, grid: Grid, pose: Pose) -> None:
        self.localiser = Localiser(grid, pose)

    @property
    def pose(self) -> Pose:
        """The estimate."""
        return self.localiser.pose

    @property
    def doubts(self) -> bool:
        """Whether it says that it may be elsewhere."""
        return self.localiser.lost or self.localiser.ambiguous

    def step(self, odometry: Pose, found: Scan, now: float) -> None:
        """Take odometry and scan."""
        self.localiser.move(odometry, now)
        self.localiser.see(found, now)


class IndexAmcl:
    """AMCL as the package index has it (`pip install amcl`), with Nav2's parameters."""

    doubts = False

    def __init__(self, grid: Grid, pose: Pose) -> None:
        import amcl

        motion = amcl.MotionParameters(0.2, 0.2, 0.2, 0.2, 0.2)
        laser = amcl.LaserParameters(0.5, 0.05, 0.05, 0.5, 0.2, 0.1, 0.0, 60)
        self._filter = amcl.AMCL(500, 2000, 0.0, 0.0, motion, laser, 'differential')
        self._vector, self._amcl = amcl.Vector3D, amcl
        self._filter.set_map(
            amcl.create_occupancy_grid_from_list(
                grid.cells.tolist(), grid.resolution, *(float(each) for each in grid.origin)
            )
        )
        spread = amcl.create_diagonal_covariance(0.25**2, 0.25**2, 0.26**2)
        self._filter.set_initial_pose(self._vector(*pose), spread)
        self._last: Pose | None = None
        self.pose = self._mean = pose

    def step(self, odometry: Pose, found: Scan, now: float) -> None:
        """Take odometry and scan; they count after 0.25 m or 0.2 rad, as in Nav2."""
        if self._last is not None:
            dx, dy, turn = relative(self._last, odometry)
            if math.hypot(dx, dy) < 0.25 and abs(turn) < 0.2:
                self.pose = composed(self._mean, (dx, dy, turn))
                return
        self._last = odometry
        thin = found.thinned(60)
        rays = np.stack([np.minimum(thin.ranges, thin.range_max), thin.angles], axis=1)
        scan = self._amcl.create_laser_scan_from_list(rays.tolist(), thin.range_max)
        self._filter.update(scan, self._vector(*odometry))
        mean = self._filter.get_pose_mean()
        self.pose = self._mean = mean.x, mean.y, mean.theta


def peers() -> dict[str, Callable[[Grid, Pose], Peer]]:
    """Return who is measured: AMCL from the package index where it is installed."""
    found: dict[str, Callable[[Grid, Pose], Peer]] = {'ours': Ours}
    if importlib.util.find_spec('amcl') is not None:
        found['AMCL, index'] = IndexAmcl
    return found


def before_a_shut_door(world: SimulatedPlace, room: str, name: str, away: float) -> list[Moment]:
    """Return what a robot meets that leaves a room by a door which is shut, and goes back.

    Args:
        world: The place; on its map the door is open.
        room: The room.
        name: The door.
        away: How far before the door the robot stops, metres.
    """
    door = world.plan.doors[name]
    across = np.array([-math.sin(door.yaw), math.cos(door.yaw)])
    middle = np.array([door.x, door.y])
    inside = np.asarray(world.plan.place.positions[room])[:2] - middle
    if float(across @ inside) < 0.0:
        across = -across
    heading = math.atan2(-across[1], -across[0])
    way = [1.6 - 0.05 * step for step in range(round((1.6 - away) / 0.05))]
    poses: list[Pose] = [(*(middle + each * across).tolist(), heading) for each in way]
    at = (middle + away * across).tolist()
    poses += [(at[0], at[1], heading)] * 40
    poses += [(at[0], at[1], heading + 0.15 * turn) for turn in range(1, 22)]
    last = poses[-1]
    poses += [composed(last, (0.05 * step, 0.0, 0.0)) for step in range(1, 11)]
    model, rng = LidarModel(), np.random.default_rng(0)
    world.set_door(name, False)
    seen = [scan(world, pose, model, rng).astype(float) for pose in poses]
    world.set_door(name, True)
    return [
        Moment(0.1 * step, pose, Scan(model.angles, ranges, model.range_max))
        for step, (pose, ranges) in enumerate(zip(poses, seen, strict=True))
    ]


def shut_doors(size: Size) -> None:
    """Print how far an estimate is off at shut doors."""
    places = {
        name: read_simulated_place(ROOT / 'config' / f'{name}.yaml')
        for name in ('seven_rooms', 'office', 'patrol_world')
    }
    places['grid, rooms alike'] = SimulatedPlace.from_parameters(regular_places.grid(3, 3))
    most = size.of(40, 8, 1)
    rows = []
    for place, world in places.items():
        grid = world.plan.grid(0.05)
        ways = [
            (room, door)
            for door, rooms in world.plan.place.doors.items()
            for room in rooms
            if sum(room in each for each in world.plan.place.doors.values()) == 1
        ]
        ways = sorted(
            ways or ((r, d) for d, rooms in world.plan.place.doors.items() for r in rooms)
        )
        ways = ways[:: max(1, len(ways) // most)][:most]
        for away in size.of((0.3, 0.45, 0.6, 0.8), (0.3, 0.45, 0.6, 0.8), (0.3,)):
            row = [place, f'{away:g} m']
            cases = [before_a_shut_door(world, *way, away) for way in ways]
            for who in peers().values():
                off = [worst_of(who, grid, case) for case in cases]
                row += [f'{sum(each > 1.0 for each in off)} of {len(off)}', f'{max(off):.2f}']
            rows.append(row)
    print_table(
        'A door, open on the map, is shut before a robot that leaves its room: jumps over 1 m, '
        'and the farthest that\nan estimate is off, m.',
        ('place', 'stands', *(f'{who}: {each}' for who in peers() for each in ('jumps', 'm'))),
        rows,
    )


def worst_of(who: Callable[[Grid, Pose], Peer], grid: Grid, case: Sequence[Moment]) -> float:
    """Return how far an estimate is off at worst, metres, with exact odometry."""
    peer, worst = who(grid, case[0].truth), 0.0
    for moment in case:
        peer.step(moment.truth, moment.scan, moment.now)
        worst = max(worst, math.dist(peer.pose[:2], moment.truth[:2]))
    return worst


def furnish(
    world: SimulatedPlace,
    grid: Grid,
    case: Sequence[Moment],
    share: float,
    rng: np.random.Generator,
) -> list[Moment]:
    """Return the same way among things that no map has, along the walls, none of them on the way.

    Args:
        world: The place; it is as it was afterwards.
        grid: Its map.
        case: The way.
        share: So many of the rays are to meet a thing, 0 to 1, as far as there is room for things.
        rng: Of chance.
    """
    if share == 0.0:
        return list(case)
    away = distance_to(grid.occupied, grid.resolution)
    spots = grid.centres_of(np.argwhere(grid.free & (away > 0.2) & (away < 0.4)))
    path = np.array([moment.truth[:2] for moment in case])
    spots = spots[[np.hypot(*(path - spot).T).min() > 0.55 for spot in spots]]
    spots = spots[np.hypot(*(spots - path[-1]).T) < 8.0]
    names: list[str] = []
    model = LidarModel()
    seen = [np.asarray(moment.scan.ranges) for moment in case]
    some = range(0, len(case), 12)
    for number, spot in enumerate(rng.permutation(spots)[:400]):
        world.place_obstacle(f'thing {number}', float(spot[0]), float(spot[1]), 0.22)
        names.append(f'thing {number}')
        if number % 4 == 3:
            hidden = [
                scan(world, case[at].truth, model) < np.minimum(seen[at], 8.0) - 0.15 for at in some
            ]
            if float(np.mean(hidden)) >= share:
                break
    result = []
    for moment, before in zip(case, seen, strict=True):
        # What was seen with the door shut, or the thing before it.
        ranges = np.minimum(before, scan(world, moment.truth, model, rng))
        result.append(Moment(moment.now, moment.truth, Scan(model.angles, ranges, model.range_max)))
    for name in names:
        world.remove_obstacle(name)
    return result


def furniture(size: Size) -> None:
    """Print how often an estimate is wrong and sure where much is not on the map."""
    seed = int(np.random.SeedSequence().generate_state(1)[0])
    rng = np.random.default_rng(seed)
    rows = []
    count = size.of(67, 16, 1)
    for share in (0.0, 0.25, 0.5):
        off: dict[str, list[float]] = {}
        for run in range(count):
            name = ('seven_rooms', 'office', 'patrol_world')[run % 3]
            world = read_simulated_place(ROOT / 'config' / f'{name}.yaml')
            grid = world.plan.grid(0.05)
            doors = sorted(world.plan.place.doors.items())
            door, rooms = doors[int(rng.integers(len(doors)))]
            room, away = rooms[int(rng.integers(len(rooms)))], float(rng.uniform(0.3, 0.8))
            case = before_a_shut_door(world, room, door, away)
            case = furnish(world, grid, case, share, rng)
            for who, make in peers().items():
                off.setdefault(who, []).append(wrong_and_sure(make, grid, case))
        row = [f'{share:.0%}', f'{count}']
        for each in off.values():
            row += [f'{sum(seconds > 0.5 for seconds in each)}', f'{max(each):.1f}']
        rows.append(row)
    heads = [f'{who}: {each}' for who in peers() for each in ('runs', 'longest s')]
    print_table(
        f'The same among things along the walls that no map has, three places, any door (seed '
        f'{seed}): runs in which\nan estimate was wrong by 0.5 m and sure for 0.5 s.',
        ('rays that meet them', 'runs', *heads),
        rows,
    )


def wrong_and_sure(who: Callable[[Grid, Pose], Peer], grid: Grid, case: Sequence[Moment]) -> float:
    """Return for how long an estimate is more than 0.5 m off without a word of doubt, seconds."""
    peer, wrong = who(grid, case[0].truth), 0
    for moment in case:
        peer.step(moment.truth, moment.scan, moment.now)
        off = math.dist(peer.pose[:2], moment.truth[:2]) > 0.5
        wrong += off and not peer.doubts
    return 0.1 * wrong


STAGES: dict[str, Callable[[Size], None]] = {
    'late': late_scans,
    'doors': shut_doors,
    'furniture': furniture,
}


def main() -> int:
    """Measure and print."""
    parser = sized_parser(__doc__, quick='fewer and shorter runs')
    parser.add_argument('stages', nargs='*', choices=[[], *STAGES], help='all by default')
    parser.add_argument('--log', type=Path, action='append', default=[], help='in CARMEN format')
    options = parser.parse_args()
    for path in options.log:
        try:
            on_log(path)
        except (OSError, ValueError) as error:
            print(f'localisation.py: {error}', file=sys.stderr)
            return 2
    for stage in options.stages or ([] if options.log else STAGES):
        STAGES[stage](options.size)
    return 0


if __name__ == '__main__':
    sys.exit(main())
