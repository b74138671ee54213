"""A robot finds itself on a drawn map and drives into the next room, before your eyes.

    python -m lidar_navigation.demo [--picture FILE]

The map is a flat of two rooms. The robot is told a pose that is half a metre and 20 degrees wrong,
its wheels measure 8 % too much, and a box stands in its way that no map has. `Localiser` finds it
by the scans, `GridPlanner` plans, `Navigator` and `Drive` drive. The terminal shows the map: `#`
walls, `.` the plan, `*` the way that was driven, `o` what the lidar saw that the map does not have.
"""

from __future__ import annotations

import argparse
import itertools
import math
import sys
from dataclasses import dataclass, field
from pathlib import Path

import cv2
import numpy as np

from lidar_navigation.driving.driving import Drive, DriveState
from lidar_navigation.driving.navigator import Navigator
from lidar_navigation.driving.path_following import Velocity
from lidar_navigation.geometry import Points, Pose, composed
from lidar_navigation.planning.grid_planning import GridPlanner
from lidar_navigation.testing import Flat

PERIOD = 0.1
"""Seconds between two scans."""
WHEELS = 1.08
"""The odometry says this many times what was driven."""
START, TOLD = (0.8, 0.8, 0.3), (1.2, 1.1, -0.05)
"""Where the robot stands, and where it is told to."""
GOAL = (6.3, 2.3)
BOX = (3.0, 1.35, 0.15)
"""x, y and radius of what the map does not have, metres."""
_PIXELS = 6
"""Of a cell of the picture."""


@dataclass
class Journey:
    """What happened.

    Attributes:
        flat: The place.
        arrived: Whether the robot got to its goal.
        seconds: How long it drove.
        off: How far the estimate was off with each scan, metres.
        driven: Where the robot was, shape (n, 2).
        plans: Each path that it was given.
        unknown: What it saw that the map does not have, shape (m, 2).
    """

    flat: Flat
    arrived: bool = False
    seconds: float = 0.0
    off: list[float] = field(default_factory=list)
    driven: list[tuple[float, float]] = field(default_factory=list)
    plans: list[Points] = field(default_factory=list)
    unknown: Points = field(default_factory=lambda: np.zeros((0, 2)))


def journey(most: float = 60.0) -> Journey:
    """Drive from `START` to `GOAL`, for at most so many seconds."""
    flat = Flat()
    planner, told = GridPlanner(flat.grid), Journey(flat)
    navigator = Navigator({'door': flat.DOOR})
    navigator.set_positions(flat.POSITIONS)
    navigator.set_map(flat.grid)
    navigator.believe(TOLD)
    true: Pose = START
    odometry: Pose = (0.0, 0.0, 0.0)
    drive: Drive | None = None
    navigator.move(odometry)
    while told.seconds < most:
        velocity = navigator.see(flat.scan(true, [BOX]), told.seconds) or Velocity()
        assert navigator.pose is not None
        told.off.append(math.dist(navigator.pose[:2], true[:2]))
        told.driven.append(true[:2])
        if drive is None and told.seconds >= 0.5:
            # It has found itself.
            told.plans.append(planner.plan(navigator.pose[:2], GOAL))
            navigator.task = drive = Drive(told.plans[-1])
        elif drive is not None and drive.state is DriveState.ASKING:
            planner.set_obstacles(navigator.obstacles)
            told.plans.append(planner.plan(navigator.pose[:2], GOAL))
            drive.new_path(told.plans[-1])
        elif drive is not None and drive.state.ended:
            told.arrived = drive.state is DriveState.ARRIVED
            break
        step = velocity.speed * PERIOD, 0.0, velocity.turn * PERIOD
        true = composed(true, step)
        odometry = composed(odometry, (WHEELS * step[0], 0.0, step[2]))
        navigator.move(odometry)
        told.seconds += PERIOD
    told.unknown = navigator.obstacles
    return told


def drawn(told: Journey, across: int = 2, down: int = 4) -> str:
    """Return the map as text: a sign for so many cells across and down."""
    grid = told.flat.grid
    rows, columns = grid.cells.shape
    signs = [[' '] * (columns // across + 1) for _ in range(rows // down + 1)]

    def put(sign: str, points: Points) -> None:
        for row, column in grid.cells_of(points):
            if 0 <= row < rows and 0 <= column < columns:
                signs[row // down][column // across] = sign

    put('#', grid.centres_of(np.argwhere(grid.occupied)))
    for plan in told.plans:
        put('.', _dense(plan))
    put('*', np.array(told.driven))
    put('o', told.unknown)
    put('A', np.array([told.driven[0]]))
    put('B', np.array([GOAL]))
    return '\n'.join(''.join(row).rstrip() for row in reversed(signs))


def picture(told: Journey) -> np.ndarray:
    """Return the map in colours, shape (rows, columns, 3), BGR."""
    grid = told.flat.grid
    cells = np.where(grid.occupied, 60, 255).astype(np.uint8)[::-1]
    image = cv2.cvtColor(
        cv2.resize(cells, None, fx=_PIXELS, fy=_PIXELS, interpolation=cv2.INTER_NEAREST),
        cv2.COLOR_GRAY2BGR,
    )

    def at(points: Points) -> np.ndarray:
        pixels = (np.asarray(points, float) - grid.origin) / grid.resolution * _PIXELS
        return np.stack([pixels[:, 0], len(image) - pixels[:, 1]], axis=1).astype(np.int32)

    for plan in told.plans:
        cv2.polylines(image, [at(plan)], False, (200, 170, 60), 2, cv2.LINE_AA)
    cv2.polylines(image, [at(np.array(told.driven))], False, (40, 40, 200), 3, cv2.LINE_AA)
    for x, y in at(told.unknown).tolist():
        cv2.circle(image, (x, y), 4, (0, 140, 255), -1, cv2.LINE_AA)
    for point, colour in ((told.driven[0], (40, 40, 200)), (GOAL, (200, 170, 60))):
        (x, y) = at(np.array([point]))[0].tolist()
        cv2.circle(image, (x, y), 9, colour, -1, cv2.LINE_AA)
    return image


def _dense(path: Points) -> Points:
    """Return points on a path, close enough that none of its cells is left out."""
    pieces = [np.linspace(a, b, 60) for a, b in itertools.pairwise(path)]
    return np.concatenate(pieces) if pieces else path


def main(words: list[str] | None = None) -> int:
    """Drive, show and say how it went."""
    parser = argparse.ArgumentParser(prog='python -m lidar_navigation.demo', description=__doc__)
    parser.add_argument('--picture', type=Path, help='write the map with the ways as a PNG file')
    options = parser.parse_args(words)
    told = journey()
    print(drawn(told))
    print(
        f'Told {math.dist(TOLD[:2], START[:2]):.2f} m beside the truth; '
        f'{max(told.off):.2f} m off at most while it drove, with wheels {WHEELS - 1:.0%} wrong.'
    )
    end = 'There' if told.arrived else 'Not there'
    print(f'{end} after {told.seconds:.0f} s; {len(told.plans)} plans: a box was in the way.')
    if options.picture is not None:
        ok, data = cv2.imencode('.png', picture(told))
        assert ok
        options.picture.write_bytes(data.tobytes())
        print(f'{options.picture} shows it.')
    return 0 if told.arrived else 1


if __name__ == '__main__':
    sys.exit(main())
