"""Exploring measured: how long a robot takes to map a place by itself, and how good the map is.

    python benchmarks/explore.py [--quick] [--place FILE ...] [--keep DIR]

Pure simulation on the cores alone, faster than real time. The shortest tour leads through all
rooms of a place that one knows; nobody can visit them in less.
"""

from __future__ import annotations

import math
import sys
import time
from dataclasses import dataclass, replace
from itertools import pairwise
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from PIL import Image

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

from benchmarks.sizes import sized_parser
from benchmarks.tables import table
from benchmarks.whole_stack import ROOT
from floor_plans import Grid
from floor_plans.facts import graph_over_doors
from floor_plans.occupancy_grid import distance_to
from lidar_navigation import Exploration, FrontierParameters, MapBuilder, Phase
from lidar_navigation.geometry import Pose, Scan, composed, relative
from surveillance_simulation.robot.base import BaseModel
from surveillance_simulation.robot.lidar import LidarModel
from surveillance_simulation.robot.robot import Robot
from surveillance_simulation.world.simulated_place import SimulatedPlace, read_simulated_place

PLACES = ('seven_rooms', 'patrol_world', 'office')
STEP = 0.1
"""Seconds between two scans."""


@dataclass
class Explored:
    """What came of one exploration; metres and seconds."""

    seconds: float
    metres: float
    share: float
    wall_error: float
    pose_error: float
    odometry_error: float
    loops: int
    collisions: int
    back: bool
    given_up: list[str]
    think_ms: list[float]
    grid: Grid


def explore(
    world: SimulatedPlace,
    seed: int,
    *,
    errors: float = 1.0,
    noise: float = 0.01,
    frontiers: FrontierParameters | None = None,
    most: float = 3600.0,
    lost: float = 0.0,
) -> Explored:
    """Explore a place with a robot whose odometry has so many times the usual errors.

    Args:
        world: The place.
        seed: Of all noise.
        errors: Times the usual errors of the odometry.
        noise: Of the lidar, metres.
        frontiers: Which frontier comes first.
        most: It ends after this time, seconds.
        lost: This share of the scans never comes.
    """
    usual = BaseModel()
    base = replace(
        usual,
        distance_error=errors * usual.distance_error,
        turn_error=errors * usual.turn_error,
    )
    lidar = replace(LidarModel(), noise=noise)
    robot = Robot(world, base, lidar, rng=np.random.default_rng(seed))
    builder = MapBuilder(start=robot.base.pose)
    exploration = Exploration(builder, frontiers=frontiers or FrontierParameters())
    angles, worst = robot.lidar.angles, 0.0
    chance = np.random.default_rng(seed + 1)
    think_ms = []
    while exploration.phase is not Phase.DONE and robot.time < most:
        scan = Scan(angles, robot.scan().astype(float), robot.lidar.range_max)
        if chance.random() >= lost:
            velocity = exploration.see(scan, robot.base.odometry, robot.time)
            robot.base.command(velocity.speed, velocity.turn)
        robot.advance(STEP)
        begun = time.process_time()
        if exploration.think():
            think_ms.append(1e3 * (time.process_time() - begun))
        pose = exploration.pose(robot.base.odometry)
        worst = max(worst, math.dist(pose[:2], robot.base.pose[:2]))
    assert exploration.grid is not None
    share, wall_error = compared(exploration.grid, world)
    return Explored(
        robot.time,
        robot.base.travelled,
        share,
        wall_error,
        worst,
        math.dist(robot.base.odometry[:2], robot.base.pose[:2]),
        builder.loops,
        robot.base.collisions,
        math.dist(robot.base.pose[:2], world.plan.start[:2]) < 0.5,
        [f'{each.reason} {np.round(each.point, 1).tolist()}' for each in exploration.unreached],
        think_ms,
        exploration.grid,
    )


def compared(grid: Grid, world: SimulatedPlace) -> tuple[float, float]:
    """Return the share of the true free floor that a map has as free, and its walls' error.

    The floor is what is free and connected with the robot's start; the error is the 95th percentile
    of the distance from an occupied cell's centre to the surface of what is really there, metres.
    """
    fine = 0.02
    truth = world.plan.grid(fine)
    import cv2

    regions = cv2.connectedComponents(truth.free.astype(np.uint8), connectivity=4)[1]
    floor = regions == regions[truth.cell_of(*world.plan.start[:2])]
    points = truth.centres_of(np.argwhere(floor))
    cells = grid.cells_of(points)
    inside = grid.contains(cells)
    row, column = cells[inside].T
    share = float(grid.free[row, column].sum()) / len(points)
    # From outside of what is there, and from inside of it.
    solid = ~truth.free
    outside, within = distance_to(solid, fine), distance_to(~solid, fine)
    walls = grid.centres_of(np.argwhere(grid.occupied))
    surface = np.maximum(outside, within).astype(np.float32) - np.float32(fine / 2)
    return share, float(np.percentile(truth.interpolated(surface, walls), 95))


def read_log(file: Path) -> list[tuple[Pose, Scan]]:
    """Return poses and scans of a log in FLIRT's format: lines VERTEX2 and ROBOTLASER1, in turn.

    Such logs, of public data sets, are in github.com/tipaldi/flirtlib (data/).
    """
    poses: list[Pose] = []
    scans: list[Scan] = []
    for line in file.read_text().splitlines():
        kind, *words = line.split()
        if kind == 'VERTEX2':
            x, y, yaw = (float(word) for word in words[1:4])
            poses.append((x, y, yaw))
        elif kind == 'ROBOTLASER1':
            numbers = [float(word) for word in words[: 8 + int(words[7])]]
            count, reach = int(numbers[7]), min(numbers[4], 50.0)
            angles = np.linspace(numbers[1], numbers[1] + (count - 1) * numbers[3], count)
            ranges = np.array(numbers[8 : 8 + count])
            # What is at the lidar's limit met nothing, or something that does not reflect.
            ranges[ranges >= 0.98 * reach] = np.nan
            ranges[ranges <= 0.05] = np.nan
            scans.append(Scan(angles, ranges, reach))
    return list(zip(poses, scans, strict=True))


def mapped(log: list[tuple[Pose, Scan]], seed: int) -> tuple[MapBuilder, list[Pose], float]:
    """Map a log with an odometry that is 5 % long, turns, and is noisy; return what it was off."""
    rng = np.random.default_rng(seed)
    builder = MapBuilder(start=log[0][0])
    odometry = last = log[0][0]
    for pose, scan in log:
        dx, dy, turn = relative(last, pose)
        way = math.hypot(dx, dy)
        error = rng.normal(0.0, 1.0, 2)
        step = (1.05 * dx + 0.02 * way * float(error[0]), 1.05 * dy, turn)
        bent = step[2] + 0.01 * way + 0.02 * math.sqrt(way) * float(error[1])
        odometry, last = composed(odometry, (step[0], step[1], bent)), pose
        builder.see(scan, odometry, keep=True)
    return builder, list(builder.graph.poses), math.dist(odometry[:2], last[:2])


def logs(files: list[Path], keep: Path | None) -> None:
    """Map foreign logs; print how far the poses are from those that were published with them."""
    rows = []
    for file in files:
        log = read_log(file)
        begun = time.process_time()
        builder, poses, off = mapped(log, 0)
        cpu = time.process_time() - begun
        steps = [math.dist(a[0][:2], b[0][:2]) for a, b in pairwise(log)]
        error = [math.dist(a[:2], b[0][:2]) for a, b in zip(poses, log, strict=True)]
        numbers = (len(log), sum(steps), off, *np.percentile(error, [50, 95, 100]), builder.loops)
        shown = ('.0f', '.0f', '.2f', '.2f', '.2f', '.2f', '.0f')
        cells = [format(number, form) for number, form in zip(numbers, shown, strict=True)]
        rows.append((file.stem, *cells, f'{cpu:.0f}'))
        print(' '.join(rows[-1]), file=sys.stderr, flush=True)
        if keep is not None:
            keep.mkdir(parents=True, exist_ok=True)
            Image.fromarray(picture(builder.grid())).save(keep / f'{file.stem}.png')
    head = ('log', 'scans', 'm', 'odom end', 'p50', 'p95', 'max', 'loops', 'cpu s')
    print(table([head, *rows]))


def picture(grid: Grid) -> NDArray[np.uint8]:
    """Return a map as map_server draws it."""
    shades = np.where(grid.cells < 0, 205, np.where(grid.occupied, 0, 254))
    return np.asarray(shades[::-1], np.uint8)


def main() -> int:
    """Explore the places and print the table."""
    parser = sized_parser('Exploring, measured.', quick='the seven rooms once')
    parser.add_argument('--place', action='append', type=Path, help='another place')
    parser.add_argument('--seeds', type=int, default=1)
    parser.add_argument('--errors', type=float, default=None, help='of the odometry, times')
    parser.add_argument('--lost', type=float, default=0.0, help='share of scans that never come')
    parser.add_argument('--keep', type=Path, help='write the maps into this folder')
    parser.add_argument('--log', action='append', type=Path, help="only this log, FLIRT's format")
    options = parser.parse_args()
    if options.log:
        logs(options.log, options.keep)
        return 0
    names = options.place or [
        ROOT / 'config' / f'{name}.yaml' for name in options.size.of(PLACES, PLACES[:1], PLACES[:1])
    ]
    rows = []
    kinds = (1.0, 5.0) if options.errors is None else (options.errors,)
    for file in names:
        tour = graph_over_doors(read_simulated_place(file).plan).tour.length
        for errors in kinds:
            noise = 0.01 if errors == 1.0 else 0.03
            for seed in range(options.seeds):
                begun = time.process_time()
                most = options.size.of(3600.0, 3600.0, 10.0)
                did = explore(
                    read_simulated_place(file),
                    seed,
                    errors=errors,
                    noise=noise,
                    most=most,
                    lost=options.lost,
                )
                cpu = time.process_time() - begun
                least = tour / BaseModel().speed
                rows.append(
                    (
                        f'{file.stem}, errors x{errors:g}',
                        f'{did.seconds:.0f}',
                        f'{did.seconds / least:.2f}',
                        f'{did.metres:.0f}',
                        f'{did.metres / tour:.2f}',
                        f'{did.share:.1%}',
                        f'{did.wall_error:.3f}',
                        f'{did.pose_error:.3f}',
                        f'{did.odometry_error:.2f}',
                        f'{did.loops}',
                        f'{did.collisions}',
                        'yes' if did.back else 'no',
                        f'{np.median(did.think_ms):.0f}',
                        f'{max(did.think_ms):.0f}',
                        f'{cpu:.0f}',
                    )
                )
                print(' '.join(rows[-1]), file=sys.stderr, flush=True)
                for each in did.given_up:
                    print(f'{file.stem}: left: {each}')
                if options.keep is not None:
                    options.keep.mkdir(parents=True, exist_ok=True)
                    name = f'{file.stem}_{errors:g}_{seed}.png'
                    Image.fromarray(picture(did.grid)).save(options.keep / name)
    head = (
        'place',
        's',
        'x tour',
        'm',
        'x tour',
        'floor',
        'wall p95',
        'pose max',
        'odom end',
        'loops',
        'hits',
        'back',
        'think ms',
        'max',
        'cpu s',
    )
    print(table([head, *rows]))
    return 0


if __name__ == '__main__':
    sys.exit(main())
