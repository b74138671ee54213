"""The patrol's driving in a world that is not its own: MuJoCo beside the kinematic simulator.

Drives from room to room on the cores alone. Wheels are 5 % too large and too small, the floor is
slippery, the lidar is noisy, sweeps, and sits off its place. A port of AMCL's particle filter
hears the same odometry and scans. Wrong is an estimate more than 0.3 m off; sure, one of a robot
that does not say it is lost or unsure.

    .venv/bin/python benchmarks/physics.py [--quick] [--place office]

`--doors` drives in MuJoCo among doors that shut and open by chance, which the robot only sees; a
goal counts as one that could be reached if a way was open when the drive ended.
"""

from __future__ import annotations

import logging
import math
import sys
from collections import Counter
from dataclasses import dataclass, field, replace
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).resolve().parent.parent))

from benchmarks.driven_robot import DrivenRobot
from benchmarks.localisation import Amcl, print_table
from benchmarks.sizes import sized_parser, skip
from lidar_navigation import DriveState, GridPlanner, NoPathError, PlanningParameters
from lidar_navigation.geometry import Pose, Scan, composed, relative
from lidar_navigation.localisation.odometry import OdometryBuffer
from surveillance_controllers.motion.door_sight import DoorSight
from surveillance_simulation.optional_mujoco import mujoco
from surveillance_simulation.physics.model import PhysicsModel
from surveillance_simulation.robot.base import BaseModel
from surveillance_simulation.robot.lidar import LidarModel
from surveillance_simulation.robot.robot import Robot
from surveillance_simulation.world.simulated_place import read_simulated_place

ROOT = Path(__file__).resolve().parent.parent
WRONG = 0.3


@dataclass
class Outcome:
    """What came of a run."""

    robot: Robot
    drives: int = 0
    arrived: int = 0
    failed: Counter[str] = field(default_factory=Counter)
    errors: list[float] = field(default_factory=list)
    sure: list[bool] = field(default_factory=list)
    peer: list[float] = field(default_factory=list)


def patrol(robot: Robot, seconds: float, seed: int) -> Outcome:
    """Drive from room to room for simulated seconds, and compare each estimate with the truth."""
    world, outcome = robot.world, Outcome(robot)
    readings = OdometryBuffer()

    def seen(scan: Scan, stamp: float) -> None:
        then = readings.at(np.array([stamp]))[0]
        odometry: Pose = (float(then[0]), float(then[1]), float(then[2]))
        amcl.step(odometry, Scan(scan.angles, scan.ranges, scan.range_max))
        # AMCL tells map -> odom; who asks for the pose applies it to the last odometry.
        now = composed(amcl.pose, relative(odometry, robot.base.odometry))
        outcome.peer.append(math.dist(now[:2], robot.base.pose[:2]))

    def moved() -> None:
        readings.add(robot.time, robot.base.odometry)

    def stepped() -> None:
        if driven.navigator.pose is not None:
            outcome.errors.append(math.dist(driven.navigator.pose[:2], robot.base.pose[:2]))
            outcome.sure.append(not (driven.navigator.lost or driven.navigator.ambiguous))

    driven = DrivenRobot(robot, robot.base.model.radius, moved, seen, stepped)
    amcl = Amcl(driven.grid, robot.base.pose, np.random.default_rng(seed))
    moved()
    robot.measure()
    while driven.navigator.pose is None:
        driven.look()
    rng = np.random.default_rng(seed)
    for room, drive in driven.rooms(rng, lambda: robot.time >= seconds):
        outcome.drives += 1
        if isinstance(drive, str):
            outcome.failed[drive] += 1
        elif drive.state is DriveState.ARRIVED and world.place_at(*robot.base.pose[:2]) == room:
            outcome.arrived += 1
        else:
            outcome.failed[drive.reason.split('(')[0] or 'in another room'] += 1
    return outcome


DOOR_SECONDS = 30.0
"""Mean time between two doors that shut or open, simulated seconds."""
BESIDE_DOOR = 0.8
"""No door shuts while the robot is nearer than this, metres."""


def among_doors(robot: Robot, seconds: float, seed: int) -> list[str]:
    """Drive from room to room while doors shut and open; return a row of the table."""
    world, chance = robot.world, np.random.default_rng(seed + 1)
    doors = {door.name: door.segment for door in world.plan.doors.values()}
    sight = DoorSight(doors)
    wrong_and_sure, steps, next_change, changes = 0, 0, 0.0, 0

    def stepped() -> None:
        nonlocal wrong_and_sure, steps, next_change, changes
        navigator, now = driven.navigator, robot.time
        if navigator.trusted is not None and sight.see(*navigator.trusted):
            driven.planner.set_closed({name: doors[name] for name in sight.shut})
        if navigator.pose is not None:
            steps += 1
            off = math.dist(navigator.pose[:2], robot.base.pose[:2])
            wrong_and_sure += off > WRONG and navigator.is_sure
        if now >= next_change:
            next_change = now + float(chance.exponential(DOOR_SECONDS))
            name = str(chance.choice(sorted(doors)))
            x1, y1, x2, y2 = doors[name]
            middle = (x1 + x2) / 2, (y1 + y2) / 2
            if math.dist(middle, robot.base.pose[:2]) > BESIDE_DOOR:
                world.set_door(name, not world.is_open(name))
                changes += 1

    driven = DrivenRobot(robot, robot.base.model.radius, stepped=stepped)
    truth = GridPlanner(driven.grid, PlanningParameters(), doors=doors)
    robot.measure()
    while driven.navigator.pose is None:
        driven.look()
    arrived = missed = shut = 0
    last, longest = robot.time, 0.0
    rng = np.random.default_rng(seed)
    for room, drive in driven.rooms(rng, lambda: robot.time >= seconds):
        if not isinstance(drive, str) and drive.state is DriveState.ARRIVED:
            arrived += world.place_at(*robot.base.pose[:2]) == room
            longest, last = max(longest, robot.time - last), robot.time
            continue
        truth.set_closed({name: doors[name] for name in doors if not world.is_open(name)})
        try:
            truth.plan(robot.base.pose[:2], world.plan.place.positions[room][:2])
            missed += 1
        except NoPathError:
            shut += 1
        # As the mission does before it chooses again.
        for _ in range(50):
            driven.look()
    longest = max(longest, robot.time - last)
    return [
        *map(str, (arrived, missed, shut, changes, robot.base.collisions)),
        *(f'{wrong_and_sure / max(steps, 1):.2%}', f'{longest:.0f}'),
    ]


def print_among_doors(place: str, seconds: float, seed: int) -> None:
    """Measure and print what `--doors` asks for."""
    world = read_simulated_place(ROOT / 'config' / f'{place}.yaml')
    lidar = LidarModel(noise=0.02)
    rng = np.random.default_rng(seed)
    robot = Robot(world, BaseModel(), lidar, rng=rng, physics=PhysicsModel())
    print_table(
        f'{seconds:.0f} simulated seconds in MuJoCo in {place}, among doors that shut and open.',
        (
            *('arrived', 'missed', 'no way was open', 'doors moved', 'contacts'),
            *('wrong and sure', 'longest s without an arrival'),
        ),
        [among_doors(robot, seconds, seed)],
    )


def main() -> int:
    """Measure and print."""
    parser = sized_parser(__doc__, quick='120 simulated seconds')
    parser.add_argument('--place', default='office', help='a place of config/')
    parser.add_argument('--seconds', type=float, default=900.0, help='simulated')
    parser.add_argument('--seed', type=int, default=1)
    parser.add_argument('--doors', action='store_true', help='doors shut and open by chance')
    options = parser.parse_args()
    if mujoco is None:
        skip('mujoco is missing: pip install mujoco')
    logging.disable()
    seconds = options.size.of(options.seconds, 120.0, 5.0)
    if options.doors:
        print_among_doors(options.place, seconds, options.seed)
        return 0
    file = ROOT / 'config' / f'{options.place}.yaml'
    bad = PhysicsModel(wheel_errors=(0.05, -0.05), friction=0.3)
    off = replace(bad, lidar_offset=(0.03, 0.02, 0.03))
    runs: tuple[tuple[str, PhysicsModel | None, float], ...] = (
        ('kinematic', None, 0.01),
        ('kinematic, noise 0.03', None, 0.03),
        ('MuJoCo', PhysicsModel(), 0.01),
        ('MuJoCo, wheels +-5 %, mu 0.3, noise 0.03', bad, 0.03),
        ('the same, lidar off by 3 cm, 0.03 rad', off, 0.03),
    )
    rows = []
    for name, physics, noise in runs:
        robot = Robot(
            read_simulated_place(file),
            BaseModel(),
            LidarModel(noise=noise),
            rng=np.random.default_rng(options.seed),
            physics=physics,
        )
        did = patrol(robot, seconds, options.seed)
        errors, sure = np.array(did.errors), np.array(did.sure)
        rows.append(
            [
                name,
                f'{did.arrived} of {did.drives}',
                f'{robot.base.collisions}',
                f'{np.median(errors):.3f}',
                f'{errors.max():.2f}',
                f'{(errors > WRONG).mean():.1%}',
                f'{((errors > WRONG) & sure).mean():.1%}',
                f'{np.median(did.peer):.3f}',
                f'{np.max(did.peer):.2f}',
                f'{(np.array(did.peer) > WRONG).mean():.1%}',
            ]
        )
        for reason, count in did.failed.items():
            print(f'{name}: failed {count}: {reason}')
    print_table(
        f'{seconds:.0f} simulated seconds of drives in {options.place}; errors in metres.',
        (
            'world',
            'arrived',
            'contacts',
            'p50',
            'max',
            'wrong',
            'and sure',
            'AMCL: p50',
            'max',
            'wrong',
        ),
        rows,
    )
    return 0


if __name__ == '__main__':
    sys.exit(main())
