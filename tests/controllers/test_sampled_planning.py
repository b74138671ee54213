"""The local planner around who moves, and the last check before a velocity is commanded."""

from __future__ import annotations

import math

import numpy as np
import pytest

from surveillance_controllers.geometry import composed, relative
from surveillance_controllers.motion.path_following import DriveParameters, Velocity
from surveillance_controllers.motion.sampled_planning import SampledPlanner, is_safe
from surveillance_controllers.motion.tracking import Mover

ROBOT = DriveParameters()
NOTHING = np.zeros((0, 2))
PERIOD = 0.1


def least_gap(start: tuple[float, float], velocity: tuple[float, float]) -> tuple[float, float]:
    """Drive 4 m straight on while somebody walks; the least gap and how far the robot came."""
    planner = SampledPlanner(ROBOT)
    pose, last, gap = (0.0, 0.0, 0.0), Velocity(), math.inf
    for step in range(120):
        at = np.add(start, np.multiply(velocity, step * PERIOD))
        gap = min(gap, math.dist(at, pose[:2]) - ROBOT.radius - 0.25)
        x, y, _ = relative(pose, (at[0], at[1], 0.0))
        vx, vy, _ = relative((0.0, 0.0, pose[2]), (*velocity, 0.0))
        way = np.array(
            [relative(pose, (along, 0.0, 0.0))[:2] for along in np.arange(pose[0], 4.05, 0.1)]
        )
        if len(way) < 2:
            break
        wanted = planner.step(way, NOTHING, [Mover(x, y, vx, vy, 0.25)], last, PERIOD)
        change = ROBOT.acceleration * PERIOD
        speed = min(max(wanted.speed, last.speed - change), last.speed + change)
        last = Velocity(speed, wanted.turn)
        pose = composed(pose, (speed * PERIOD, 0.0, wanted.turn * PERIOD))
    return gap, pose[0]


@pytest.mark.parametrize(
    ('start', 'velocity'),
    [
        ((4.0, 0.05), (-0.8, 0.0)),
        ((2.0, -2.5), (0.0, 0.8)),
        ((3.0, 2.0), (-0.6, -0.6)),
    ],
    ids=['head on', 'from the side', 'aslant'],
)
def test_it_drives_around_somebody_and_arrives(
    start: tuple[float, float], velocity: tuple[float, float]
) -> None:
    gap, came = least_gap(start, velocity)
    assert gap > 0.05
    assert came > 3.3


@pytest.mark.parametrize('movers', [[Mover(3.0, -3.0, 0.5, 0.0, 0.25)], []], ids=['far', 'none'])
def test_the_path_is_followed_when_nobody_is_near_it(movers: list[Mover]) -> None:
    planner, last, pose = SampledPlanner(ROBOT), Velocity(), (0.0, 0.0, 0.0)
    for _ in range(40):
        way = np.array([relative(pose, (x, 0.0, 0.0))[:2] for x in np.arange(pose[0], 4, 0.1)])
        last = planner.step(way, NOTHING, movers, last, PERIOD)
        pose = composed(pose, (last.speed * PERIOD, 0.0, last.turn * PERIOD))
    assert pose[0] > 1.5
    assert abs(pose[1]) < 0.15


def test_what_stands_is_not_driven_into() -> None:
    wall = np.stack([np.full(60, 1.0), np.linspace(-1.5, 1.5, 60)], axis=1)
    planner, last, x = SampledPlanner(ROBOT), Velocity(), 0.0
    way = np.stack([np.arange(0, 3, 0.1), np.zeros(30)], axis=1)
    behind = Mover(-2.0, 0.0, 0.5, 0.0, 0.25)
    for _ in range(60):
        last = planner.step(way - (x, 0.0), wall - (x, 0.0), [behind], last, PERIOD)
        x += last.speed * PERIOD * math.cos(last.turn)
    assert x < 1.0 - ROBOT.radius


@pytest.mark.parametrize(
    ('velocity', 'mover', 'safe'),
    [
        (Velocity(0.6), Mover(0.9, 0.0, -1.2, 0.0, 0.25), False),
        (Velocity(0.6), Mover(3.0, 0.0, -1.2, 0.0, 0.25), True),
        (Velocity(0.0), Mover(0.5, 0.0, -1.2, 0.0, 0.25), True),
        (Velocity(0.6), Mover(-0.6, 0.0, 1.2, 0.0, 0.25), True),
        (Velocity(-0.3), Mover(-0.6, 0.0, 1.2, 0.0, 0.25), False),
        (Velocity(0.6), Mover(0.6, 1.2, 0.0, -1.2, 0.25), False),
    ],
)
def test_a_velocity_is_safe_when_the_robot_stands_before_anybody_is_there(
    velocity: Velocity, mover: Mover, safe: bool
) -> None:
    assert is_safe(velocity, [mover], ROBOT) is safe
