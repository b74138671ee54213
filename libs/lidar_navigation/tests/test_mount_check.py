"""Whether a lidar sits as the profile says, told from the first decimetres of a drive."""

import math
import random

import numpy as np
import pytest

from lidar_navigation.geometry import Mount, Pose, Scan, angle_between, composed
from lidar_navigation.localisation.mount_check import MountCheck, MountFinding
from lidar_navigation.testing import Flat


def driven(
    flat: Flat,
    believed: Mount,
    true: Mount,
    *,
    at: Pose = (1.0, 1.0, 0.6),
    turns: tuple[float, ...] = (0.0,),
    scale: float = 1.0,
    way: float = 0.5,
    obstacles: tuple[tuple[float, float, float], ...] = (),
) -> tuple[MountFinding | None, float]:
    """Drive an arc; return what is found, and after which way, until something does not fit."""
    check = MountCheck(believed)
    pose, odometry = at, (3.0, -2.0, 1.0)
    gone = 0.0
    for turn in turns:
        steps = max(1, round(way / 0.03)) if turn == 0.0 else max(1, round(abs(turn) / 0.06))
        for _ in range(steps):
            step = (0.03, 0.0, 0.0) if turn == 0.0 else (0.0, 0.0, math.copysign(0.06, turn))
            pose = composed(pose, step)
            odometry = composed(odometry, (scale * step[0], 0.0, step[2]))
            gone += step[0]
            seen = flat.scan(composed(pose, true.pose), obstacles)
            ranges = seen.ranges[::-1] if true.upside_down != believed.upside_down else seen.ranges
            angles = -seen.angles[::-1] if true.upside_down != believed.upside_down else seen.angles
            finding = check.see(Scan(angles, ranges, seen.range_max, believed.pose), odometry)
            if finding is not None and not finding.fits:
                return finding, gone
    return check.finding, gone


@pytest.mark.parametrize('off', [math.pi / 2, -math.pi / 2, math.pi, 0.5, -1.0])
def test_a_lidar_that_is_turned_is_named_with_its_angle_within_a_third_of_a_metre(
    flat: Flat, off: float
) -> None:
    true = Mount((0.12, 0.03, off))
    finding, way = driven(flat, Mount((0.12, 0.03, 0.0)), true)

    assert finding is not None
    assert finding.is_turned
    assert not finding.is_mirrored
    assert abs(angle_between(finding.fitting.pose[2], off)) < 0.06
    assert way <= 0.31


def test_a_lidar_that_is_said_to_look_backwards_and_does_not_is_named(flat: Flat) -> None:
    finding, _ = driven(flat, Mount((0.1, 0.0, math.pi)), Mount((0.1, 0.0, 0.0)))

    assert finding is not None
    assert abs(finding.fitting.pose[2]) < 0.06


@pytest.mark.parametrize('yaw', [0.0, math.pi / 2])
def test_a_lidar_that_hangs_upside_down_is_named_once_the_robot_turns(
    flat: Flat, yaw: float
) -> None:
    finding, _ = driven(flat, Mount(), Mount((0.0, 0.0, yaw), upside_down=True), turns=(0.9, 0.0))

    assert finding is not None
    assert finding.fitting.upside_down
    assert 'the other way' in finding.text


def test_an_upside_down_lidar_that_is_turned_as_well_is_named_with_both(flat: Flat) -> None:
    check_first = (0.0, 0.9)
    true = Mount((0.0, 0.0, 0.2), upside_down=True)
    finding, _ = driven(flat, Mount(), true, turns=check_first)

    assert finding is not None
    assert finding.fitting.upside_down


@pytest.mark.parametrize('scale', [1.2, 1 / 1.2, 1.5])
def test_wheels_of_another_size_are_named_with_the_scale_that_fits(
    flat: Flat, scale: float
) -> None:
    finding, way = driven(flat, Mount(), Mount(), scale=scale)

    assert finding is not None
    assert finding.is_scaled
    assert finding.scale == pytest.approx(1 / scale, rel=0.04)
    assert way <= 0.45


def test_whoever_is_pushed_while_it_turns_has_no_wrong_mount() -> None:
    seed = random.randrange(1_000_000)
    print('seed', seed)
    draw = random.Random(seed)
    for _ in range(30):
        flat, check = Flat(), MountCheck(Mount())
        pose, odometry = (1.0, 1.0, draw.uniform(-3, 3)), (0.0, 0.0, 0.0)
        pushed_at, turn = draw.randrange(3, 30), draw.choice([-0.06, 0.06])
        for number in range(30):
            step = (0.012, 0.0, turn)
            pose, odometry = composed(pose, step), composed(odometry, step)
            if number == pushed_at:
                # Also by more than a scan is looked for, and to another end of the room.
                by = draw.uniform(-1.6, 1.6)
                pose = (draw.uniform(0.8, 2.5), draw.uniform(0.6, 1.5), pose[2] + by)
            finding = check.see(flat.scan(pose), odometry)
            assert finding is None or finding.fits, (number, pushed_at, finding.text)


def test_whatever_is_mounted_as_said_fits_with_wheels_that_are_worn() -> None:
    seed = random.randrange(1_000_000)
    print('seed', seed)
    draw = random.Random(seed)
    for _ in range(12):
        flat = Flat()
        flat.noise = np.random.default_rng(draw.randrange(1000))
        mount = Mount(
            (draw.uniform(-0.2, 0.2), draw.uniform(-0.2, 0.2), draw.uniform(-3, 3)),
            draw.random() < 0.5,
        )
        # `flat` sees as an upright lidar does, and so does a reader that is told the mount.
        at = (draw.uniform(0.8, 2.5), draw.uniform(0.6, 1.5), draw.uniform(-3, 3))
        finding, _ = driven(
            flat,
            mount,
            mount,
            at=at,
            turns=(draw.uniform(-1, 1), 0.0, draw.uniform(-1, 1), 0.0),
            scale=draw.uniform(0.92, 1.08),
            way=0.4,
            obstacles=((draw.uniform(0, 6), draw.uniform(0, 3), 0.3),),
        )
        assert finding is None or finding.fits, (mount, at, finding)


def test_wheels_that_slip_on_the_spot_are_no_wrong_mount(flat: Flat) -> None:
    check = MountCheck()
    pose, odometry = (1.0, 1.0, 0.6), (0.0, 0.0, 0.0)
    for number in range(40):
        odometry = composed(odometry, (0.03, 0.0, 0.0))
        pose = composed(pose, (0.03 if number > 20 else 0.0, 0.0, 0.0))
        finding = check.see(flat.scan(pose), odometry)
        assert finding is None or finding.fits


def test_a_robot_in_a_corridor_that_shows_no_way_is_not_judged_by_it() -> None:
    angles = np.linspace(-math.pi, math.pi, 360, endpoint=False)
    check = MountCheck()
    noise = np.random.default_rng(3)
    for number in range(60):
        with np.errstate(divide='ignore'):
            ranges = np.minimum(1.0 / np.abs(np.sin(angles)), 8.0)
        ranges = np.where(ranges >= 8.0, np.inf, ranges + noise.normal(0, 0.01, 360))
        finding = check.see(Scan(angles, ranges, 8.0), (0.03 * number, 0.0, 0.0))
        assert finding is None


def test_nothing_more_is_looked_for_once_way_and_turn_fit(flat: Flat) -> None:
    check = MountCheck()
    pose = (1.0, 1.0, 0.3)
    for step in [(0.03, 0.0, 0.0)] * 14 + [(0.0, 0.0, 0.06)] * 14:
        pose = composed(pose, step)
        check.see(flat.scan(pose), pose)

    assert check.is_done
    assert check.finding is not None
    assert check.finding.fits
    assert check.finding.text == ''


@pytest.mark.parametrize('seed', range(6))
def test_short_parts_of_a_turn_name_no_angle(flat: Flat, seed: int) -> None:
    """Worn wheels, a noisy lidar some centimetres off its place, and a way of tight arcs."""
    flat.noise = np.random.default_rng(seed)
    check = MountCheck()
    pose, odometry = (2.5, 0.9, 0.0), (0.0, 0.0, 0.0)
    for _ in range(60):
        pose = composed(pose, (0.02, 0.0, 0.055))
        odometry = composed(odometry, (0.021, 0.0, 0.05))
        seen = flat.scan(composed(pose, (0.08, 0.05, 0.03)))
        ranges = seen.ranges + flat.noise.normal(0.0, 0.03, len(seen.ranges))
        finding = check.see(Scan(seen.angles, ranges, seen.range_max), odometry)
        assert finding is None or not finding.is_turned, finding
