"""The local planner around who moves, and the last check before a velocity is commanded."""

from __future__ import annotations

import math

import numpy as np
import pytest

from surveillance_controllers.geometry import composed, relative
from surveillance_controllers.motion.path_following import DriveParameters, Velocity
from surveillance_controllers.motion.sampled_planning import (
    SampledPlanner,
    is_safe,
    price_of_effort,
    price_of_way,
    rolled_out,
)
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


def straight(y: float, yaw: float, length: float = 2.0, start: float = 0.0) -> np.ndarray:
    """Return 20 poses along x, the last one so far from the start."""
    x = start + (np.arange(20) + 1.0) * (length - start) / 20
    return np.stack([x, np.full(20, y), np.full(20, yaw)], axis=1).astype(np.float32)


LONG = np.stack([np.arange(0.0, 3.05, 0.1), np.zeros(31)], axis=1)
"""3 m straight on, a point each 10 cm."""


@pytest.mark.parametrize(
    ('poses', 'price'),
    [
        # Seven moments are looked at, the last one 2 m along: 1 m is left, and 1 m to the end.
        (straight(0.0, 0.0), 4 * (1.0 + 0.3 * 1.0)),
        # 0.2 m aside at each of them, and at the last one more.
        (straight(0.2, 0.0), 7 * 0.2 + 4 * (1.0 + 0.2 + 0.3 * math.hypot(1.0, 0.2))),
        (straight(0.0, math.pi / 2), 4 * (1.0 + 0.3 * 1.0) + 1.0),
        (straight(0.0, math.pi), 4 * (1.0 + 0.3 * 1.0) + 2.0),
    ],
    ids=['along', 'beside', 'across', 'back'],
)
def test_the_price_of_a_way_is_what_is_left_and_how_far_it_leaves_the_path(
    poses: np.ndarray, price: float
) -> None:
    assert price_of_way(poses[None], LONG) == pytest.approx([price], abs=1e-5)


def test_what_leaves_the_path_at_the_end_pays_for_where_it_ends() -> None:
    poses = straight(0.0, 0.0)
    poses[-1, 1] = poses[-2, 1] = 0.3
    # At the last moment that is looked at it is 0.3 m off; that counts once and four times more.
    left = 1.0 + 0.3 + 0.3 * math.hypot(1.0, 0.3)
    assert price_of_way(poses[None], LONG) == pytest.approx([0.3 + 4 * left], abs=1e-5)


def test_beyond_the_end_of_a_path_one_looks_along_its_last_step() -> None:
    bent = np.array([[0.0, 0.0], [0.5, 0.0], [1.0, 0.0], [1.0, 0.5]])
    there = np.tile(np.array([1.0, 0.5, math.pi / 2], np.float32), (20, 1))
    askew = there.copy()
    askew[-1, 2] = 0.0
    assert price_of_way(np.stack([there, askew]), bent) == pytest.approx([0.0, 1.0], abs=1e-5)


def test_backwards_and_rough_is_dear() -> None:
    controls = np.zeros((4, 3, 2), np.float32)
    controls[1] = (0.5, 0.4)
    controls[2] = (-0.2, 0.0)
    controls[3] = [(0.1, 0.0), (0.3, -0.2), (0.0, 0.4)]
    rough = 0.2 + 0.3 + 0.2 + 0.6
    assert price_of_effort(controls) == pytest.approx([0.0, 0.0, 1.5 * 0.6, 0.15 * rough])


def test_velocities_are_rolled_out_along_arcs() -> None:
    controls = np.array([[(1.0, 0.0), (0.5, 0.0)], [(1.0, 1.0), (-1.0, 2.0)]], np.float32)
    poses = rolled_out(controls, 0.2)
    assert poses[0] == pytest.approx(np.array([[0.2, 0.0, 0.0], [0.3, 0.0, 0.0]]))
    first = np.array([0.2 * math.cos(0.1), 0.2 * math.sin(0.1)])
    second = first - (0.2 * math.cos(0.4), 0.2 * math.sin(0.4))
    assert poses[1] == pytest.approx(np.array([[*first, 0.2], [*second, 0.6]]))


@pytest.mark.parametrize(
    ('distance', 'safe'),
    # At 0.5 m/s it needs the latency and 0.5^2 / (2 a) to stand, then 3 cm are to be left.
    [(0.005, True), (-0.005, False)],
)
@pytest.mark.parametrize('way', [1.0, -1.0], ids=['forwards', 'backwards'])
def test_it_stands_three_centimetres_before_who_stands(
    distance: float, safe: bool, way: float
) -> None:
    needed = 0.5 * ROBOT.latency + 0.5**2 / (2 * ROBOT.acceleration)
    x = needed + ROBOT.radius + 0.25 + 0.03 + distance
    assert is_safe(Velocity(way * 0.5), [Mover(way * x, 0.0, 0.0, 0.0, 0.25)], ROBOT) is safe


@pytest.mark.parametrize('side', [1.0, -1.0], ids=['left', 'right'])
def test_an_arc_is_followed_to_where_it_leads(side: float) -> None:
    needed = 0.5 * ROBOT.latency + 0.5**2 / (2 * ROBOT.acceleration)
    turn = side * 2.0
    ahead = needed + ROBOT.radius + 0.25 + 0.02
    # Straight on it would come too near; on the arc it does not come so far.
    person = Mover(ahead, -side * 0.1, 0.0, 0.0, 0.25)
    assert not is_safe(Velocity(0.5), [Mover(ahead, 0.0, 0.0, 0.0, 0.25)], ROBOT)
    assert is_safe(Velocity(0.5, turn), [person], ROBOT)
    angle = turn * (needed / 0.5) / 2
    along = Mover(ahead * math.cos(angle), ahead * math.sin(angle), 0.0, 0.0, 0.25)
    assert not is_safe(Velocity(0.5, turn), [along], ROBOT)


def test_of_several_each_counts() -> None:
    far, near = Mover(5.0, 0.0, 0.0, 0.0, 0.25), Mover(0.7, 0.0, 0.0, 0.0, 0.25)
    for movers in ([far, near], [near, far]):
        assert not is_safe(Velocity(0.6), movers, ROBOT)


def test_a_plan_is_forgotten() -> None:
    way = np.stack([np.arange(0, 3, 0.1), np.zeros(30)], axis=1)
    planner, fresh = SampledPlanner(ROBOT), SampledPlanner(ROBOT)
    for _ in range(5):
        planner.step(way, NOTHING, [], Velocity(0.4), PERIOD)
    planner.forget()
    planner._rng, fresh._rng = (np.random.default_rng(3) for _ in range(2))
    assert planner.step(way, NOTHING, [], Velocity(), PERIOD) == fresh.step(
        way, NOTHING, [], Velocity(), PERIOD
    )
