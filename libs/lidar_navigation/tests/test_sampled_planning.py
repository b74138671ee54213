"""The local planner around who moves, and the last check before a velocity is commanded."""

from __future__ import annotations

import math

import numpy as np
import pytest

from lidar_navigation import DriveParameters, Velocity
from lidar_navigation.driving.sampled_planning import (
    SampledPlanner,
    _standing,
    is_safe,
    path_cost,
    price_of_effort,
    rolled_out,
)
from lidar_navigation.geometry import composed, relative
from lidar_navigation.localisation.tracking import Mover

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
    assert path_cost(poses[None], LONG) == pytest.approx([price], abs=1e-5)


def test_what_leaves_the_path_at_the_end_pays_for_where_it_ends() -> None:
    poses = straight(0.0, 0.0)
    poses[-1, 1] = poses[-2, 1] = 0.3
    # At the last moment that is looked at it is 0.3 m off; that counts once and four times more.
    left = 1.0 + 0.3 + 0.3 * math.hypot(1.0, 0.3)
    assert path_cost(poses[None], LONG) == pytest.approx([0.3 + 4 * left], abs=1e-5)


def test_beyond_the_end_of_a_path_one_looks_along_its_last_step() -> None:
    bent = np.array([[0.0, 0.0], [0.5, 0.0], [1.0, 0.0], [1.0, 0.5]])
    there = np.tile(np.array([1.0, 0.5, math.pi / 2], np.float32), (20, 1))
    askew = there.copy()
    askew[-1, 2] = 0.0
    assert path_cost(np.stack([there, askew]), bent) == pytest.approx([0.0, 1.0], abs=1e-5)


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


# --- the parts of a price, beside plain sums ---


def planner() -> SampledPlanner:
    return SampledPlanner(ROBOT)


def test_known_manoeuvres_stand_back_off_and_swerve() -> None:
    known = planner()._known_manoeuvres()
    assert known.shape == (12, 20, 2)
    assert (known[0] == 0.0).all()
    for row, turn in zip(known[1:4], (0.0, 0.5, -0.5), strict=True):
        assert row == pytest.approx(np.tile([-0.3, turn], (20, 1)))
    swerves = [(speed, turn) for speed in (0.6, 0.3) for turn in (0.6, 1.0, -0.6, -1.0)]
    for row, (speed, turn) in zip(known[4:], swerves, strict=True):
        # A third to one side, a third back, and straight on.
        sides = [turn] * 6 + [-turn] * 6 + [0.0] * 8
        assert row == pytest.approx(np.column_stack([[speed] * 20, sides]))


def test_a_plan_goes_on_with_time_and_is_forgotten_when_told() -> None:
    local = planner()
    ramp = np.column_stack([np.arange(20.0), 40.0 - np.arange(20.0)]).astype(np.float32)
    local._plan[:] = ramp
    local._shift(0.075)
    assert local._plan[:, 0] == pytest.approx([*(np.arange(19) + 0.5), 19.0])
    assert local._plan[:, 1] == pytest.approx([*(39.5 - np.arange(19)), 21.0])
    local._shift(0.3)
    assert local._plan[0].tolist() == pytest.approx([2.5, 37.5])
    local.forget()
    assert (local._plan == 0.0).all()


@pytest.mark.parametrize(
    ('degrees', 'speed', 'turn'),
    [
        (0, 0.6, 0.0),
        (30, 0.6 * math.cos(math.pi / 6), math.pi / 4),
        (120, 0.0, 1.5),
        (-90, 0, -1.5),
    ],
)
def test_back_to_the_path_it_steers_to_a_point_a_bit_ahead(
    degrees: float, speed: float, turn: float
) -> None:
    angle = math.radians(degrees)
    path = np.array(
        [[way * math.cos(angle), way * math.sin(angle)] for way in (0.0, 0.3, 0.6, 1.2)]
    )
    path[-1] = (-1.2, 0.1)
    assert planner()._pursuit(path) == pytest.approx([speed, turn], abs=1e-6)


def test_sequences_keep_the_robot_s_limits_and_hold_what_is_known() -> None:
    local, last = planner(), Velocity(0.2, -0.3)
    path = np.stack([np.arange(0, 3, 0.1), np.zeros(30)], axis=1)
    drawn = local._drawn(last, path)
    assert drawn.shape == (300, 20, 2)
    speed, turn = drawn[..., 0], drawn[..., 1]
    assert speed.min() >= -0.3 - 1e-6
    assert speed.max() <= 0.6 + 1e-6
    assert np.abs(turn).max() <= 1.5 + 1e-6
    before = np.broadcast_to(np.array([0.2, -0.3]), (300, 1, 2))
    steps = np.abs(np.diff(drawn, axis=1, prepend=before))
    assert steps[..., 0].max() <= 0.8 * 0.15 + 1e-6
    assert steps[..., 1].max() <= 3.0 * 0.15 + 1e-6
    # Standing still is among them, as fast as the robot can, and so is what leads along the path.
    assert drawn[0, :3, 0] == pytest.approx([0.08, 0.0, 0.0], abs=1e-6)
    assert drawn[150, -1] == pytest.approx([0.6, 0.0], abs=1e-6)
    assert drawn[12, -1] == pytest.approx([0.0, 0.0], abs=1e-6), 'the last plan'
    assert 0.1 < turn[13:150].std() < 0.9
    assert speed[151:].mean() > speed[13:150].mean() + 0.1, 'half of them are about the path'


def test_how_far_the_cells_around_are_from_what_stands() -> None:
    stands = np.array([[1.0, 0.5], [-0.6, -1.1], [3.16, 0.0], [0.0, -9.0]])
    away = planner()._away_from(stands)
    assert away.shape == (128, 128)
    met = [(math.floor((y + 3.2) / 0.05), math.floor((x + 3.2) / 0.05)) for x, y in stands[:2]]
    for row, column in ((0, 0), (64, 64), (84, 74), (40, 60), (127, 3), met[0]):
        nearest = 0.05 * min(math.hypot(row - r, column - c) for r, c in met)
        assert away[row, column] == pytest.approx(nearest, rel=0.06)
    assert planner()._away_from(NOTHING).min() > 3.2


@pytest.mark.parametrize('corners', [(), (0.5, 0.2, -0.3, 0.2, -0.3, -0.2, 0.5, -0.2)])
def test_coming_near_to_what_stands_costs_while_it_moves(corners: tuple[float, ...]) -> None:
    robot = DriveParameters(radius=0.2, footprint=corners)
    local = SampledPlanner(robot)
    stands = np.array([[1.0, 0.3], [0.4, -0.8]])
    away = local._away_from(stands)
    draw = np.random.default_rng(3)
    poses = draw.uniform(-1.0, 1.0, (6, 20, 3)).astype(np.float32)
    controls = draw.uniform(-0.1, 0.1, (6, 20, 2)).astype(np.float32)
    controls[:, ::3, 0] = 0.0
    found = local._of_standing(poses, controls, away)
    for sample in range(6):
        price = 0.0
        for moment in range(20):
            x, y, yaw = (float(each) for each in poses[sample, moment])
            points = [(x, y)]
            if corners:
                cos, sin = math.cos(yaw), math.sin(yaw)
                points = [
                    (x + cos * a - sin * b, y + sin * a + cos * b)
                    for a, b in robot.body.outline(0.1).tolist()
                ]
            at = [away[int((b + 3.2) / 0.05), int((a + 3.2) / 0.05)] for a, b in points]
            gap = float(min(at)) - (0.0 if corners else 0.2)
            moves = abs(float(controls[sample, moment, 0])) > 0.02
            price += 50.0 * (gap < robot.margin + 0.025 and moves)
            price += 0.5 * math.exp(-max(gap, 0.0) / 0.1)
        assert found[sample] == pytest.approx(price, rel=1e-3)
    assert found.max() > 50.0


@pytest.mark.parametrize('corners', [(), (0.5, 0.2, -0.3, 0.2, -0.3, -0.2, 0.5, -0.2)])
def test_coming_near_to_who_moves_costs_the_more_the_sooner_and_faster(
    corners: tuple[float, ...],
) -> None:
    robot = DriveParameters(radius=0.2, footprint=corners)
    local = SampledPlanner(robot)
    movers = [Mover(0.8, 0.2, -0.3, 0.1, 0.25), Mover(-0.5, 1.0, 0.0, -0.4, 0.2)]
    draw = np.random.default_rng(4)
    poses = draw.uniform(-1.0, 1.0, (5, 20, 3)).astype(np.float32)
    controls = draw.uniform(-0.6, 0.6, (5, 20, 2)).astype(np.float32)
    found = local._of_moving(poses, controls, movers)
    for sample in range(5):
        price = 0.0
        for moment in range(20):
            ahead = (moment + 1) * 0.15
            x, y, yaw = (float(each) for each in poses[sample, moment])
            moving = 0.5 + abs(float(controls[sample, moment, 0])) / robot.speed
            sooner = 1.5 - moment / 19
            for each in movers:
                dx, dy = each.x + each.vx * ahead - x, each.y + each.vy * ahead - y
                dx, dy, _ = relative((0.0, 0.0, yaw), (dx, dy, 0.0))
                gap = float(robot.body.gap(dx, dy)) - each.radius
                wanted = 0.15 + 0.08 * ahead
                near = 20.0 * (gap < wanted) + 2.0 * math.exp(-max(gap - wanted, 0.0) / 0.25)
                price += near * moving * sooner
        assert found[sample] == pytest.approx(price, rel=1e-3)
    assert (local._of_moving(poses, controls, []) == 0.0).all()


def test_points_of_who_moves_do_not_stand() -> None:
    seen = np.array([[1.0, 0.0], [1.39, 0.0], [1.41, 0.0], [3.0, 2.0]])
    movers = [Mover(1.0, 0.0, 0.5, 0.0, 0.25), Mover(3.0, 2.1, 0.5, 0.0, 0.1)]
    assert _standing(seen, movers).tolist() == [[1.41, 0.0]]
    assert _standing(seen, []).tolist() == seen.tolist()
