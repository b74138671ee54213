"""Scans are joined with the odometry of their time: late ones, and those that take a while."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest

from lidar_navigation import Localiser
from lidar_navigation.geometry import Pose, Scan, composed, relative
from lidar_navigation.localisation.odometry import (
    ContinuousOdometry,
    OdometryBuffer,
    began_anew,
    joined,
    joined_if_known,
)


def moving(at: float) -> Pose:
    """Return where a robot is that drives a curve."""
    return 2.0 + 0.5 * math.sin(0.8 * at), 1.2 + 0.2 * math.sin(at), 1.5 * math.sin(at)


def readings(until: float) -> OdometryBuffer:
    buffer = OdometryBuffer()
    for tick in range(round(until * 50) + 1):
        buffer.add(tick / 50, moving(tick / 50))
    return buffer


def swept(flat: Any, stamp: float, sweep: float) -> Scan:
    """Return a scan whose rays are measured one after the other."""
    first = flat.scan(moving(stamp))
    times = np.linspace(0.0, sweep, len(first.angles))
    ranges = np.empty(len(times))
    for part in np.array_split(np.arange(len(times)), 20):
        ranges[part] = flat.scan(moving(stamp + float(times[part].mean()))).ranges[part]
    return Scan(first.angles, ranges, first.range_max, times=times)


@pytest.mark.parametrize(('late', 'sweep'), [(0.3, 0.0), (0.1, 0.1), (0.3, 0.1)])
def test_a_late_scan_of_a_lidar_that_turns_tells_where_the_robot_is_now(
    flat: Any, late: float, sweep: float
) -> None:
    localiser = Localiser(flat.grid, moving(1.0))
    off, turned = [], []
    for step in range(10, 40):
        now = 0.1 * step
        buffer, stamp = readings(now), now - late
        localiser.move(moving(now))
        scan = swept(flat, stamp, sweep) if sweep else flat.scan(moving(stamp))
        localiser.see(joined(scan, buffer, stamp), now)
        x, y, yaw = moving(now)
        off.append(math.dist(localiser.pose[:2], (x, y)))
        turned.append(abs(math.remainder(localiser.pose[2] - yaw, math.tau)))
    assert np.median(off) < 0.03
    assert np.percentile(turned, 95) < 0.05


def test_a_scan_of_a_time_of_which_nothing_is_known_counts_as_made_now(flat: Any) -> None:
    scan = flat.scan(moving(0.0))
    assert joined(scan, OdometryBuffer(), 1.0) is scan
    assert joined(scan, readings(3.0), 0.5) is scan  # longer ago than is kept
    assert joined(scan, readings(3.0), 9.0) is scan


def test_where_the_clock_begins_anew_the_old_readings_are_forgotten() -> None:
    buffer = readings(1.0)
    last, near = moving(1.0), moving(1.04)
    buffer.add(0.95, near)
    assert buffer.latest == (1.0, last), 'a reading that is late counts for nothing'
    buffer.add(0.2, near)
    assert buffer.latest == (0.2, near)
    assert not buffer.covers(0.5, 0.5)
    buffer.add(-5.0, near)
    assert buffer.latest == (-5.0, near)


@pytest.mark.parametrize('step', [-3600.0, -1.5, 1.5, 3600.0])
def test_a_clock_that_is_set_while_the_robot_drives_costs_no_pose(flat: Any, step: float) -> None:
    localiser, buffer = Localiser(flat.grid, moving(1.0)), readings(1.0)
    off = []
    for tick in range(51, 200):
        now = tick / 50
        clock = now + (step if now > 2.0 else 0.0)
        buffer.add(clock, moving(now))
        localiser.move(moving(now))
        if tick % 5 == 0:
            scan = flat.scan(moving(now - 0.04))
            localiser.see(joined(scan, buffer, clock - 0.04), now)
            off.append(math.dist(localiser.pose[:2], moving(now)[:2]))
    assert max(off) < 0.06
    assert localiser.jumps == 0


def test_odometry_that_begins_anew_moves_no_scan(flat: Any) -> None:
    buffer, true = readings(1.0), moving(1.0)
    buffer.add(1.02, (0.0, 0.0, 0.0))
    assert buffer.latest == (1.02, (0.0, 0.0, 0.0))
    scan = flat.scan(true)
    assert joined(scan, buffer, 0.98) is scan
    odometry = ContinuousOdometry()
    for at in (0.0, 0.1, 0.2):
        assert odometry.take(moving(at)) == pytest.approx(moving(at))
    for at in (0.3, 0.4):
        # From here on the driver counts from where it began anew.
        expected = composed(moving(0.2), relative(moving(0.3), moving(at)))
        anew = relative(moving(0.3), moving(at))
        assert odometry.take(composed((5.0, -5.0, 2.0), anew)) == pytest.approx(expected)


def test_between_two_readings_and_a_little_after_the_last_the_robot_goes_on() -> None:
    buffer = OdometryBuffer()
    for tick in range(11):
        buffer.add(0.1 * tick, (0.1 * tick, 0.0, 3.1 + 0.01 * tick))
    first, last = buffer.at(np.array([0.55, 1.1])).tolist()
    assert first == pytest.approx([0.55, 0.0, 3.155])
    assert last == pytest.approx([1.1, 0.0, 3.21])


def test_where_each_ray_ended_stays_where_it_was() -> None:
    """Rays of a lidar that sits aside, of a robot that drives and turns, beside plain geometry."""
    buffer, rng = readings(1.0), np.random.default_rng(4)
    mount, stamp = (0.2, -0.1, 0.4), 0.8
    angles = np.linspace(-2.0, 2.0, 41)
    ranges = rng.uniform(4.0, 6.0, 41)
    ranges[[3, 20]] = np.inf, np.nan
    times = np.linspace(0.0, 0.1, 41)
    met = np.isfinite(ranges)
    ends = []
    for angle, reach, at in zip(angles[met], ranges[met], times[met], strict=True):
        lidar = composed(moving(stamp + at), mount)
        ends.append(composed(lidar, (reach * math.cos(angle), reach * math.sin(angle), 0.0))[:2])
    expected = np.array(ends)
    seen = joined(Scan(angles, ranges, 9.0, mount, times), buffer, stamp)
    told = np.array([composed(moving(1.0), (x, y, 0.0))[:2] for x, y in seen.points])
    assert (np.diff(seen.angles) >= 0.0).all()
    assert np.isinf(seen.ranges).sum() == np.isnan(seen.ranges).sum() == 1
    order, again = np.lexsort(np.round(told, 2).T), np.lexsort(np.round(expected, 2).T)
    assert told[order] == pytest.approx(expected[again], abs=0.003)
    # Seen from where the lidar was in the middle of its turn.
    middle = composed(moving(0.85), mount)
    assert composed(moving(1.0), seen.mount) == pytest.approx(middle, abs=0.003)
    still = OdometryBuffer()
    for tick in range(51):
        still.add(tick / 50, (1.0, 2.0, 0.5))
    same = joined(Scan(angles, ranges, 9.0, mount, times), still, 0.8)
    assert same.mount == pytest.approx(mount)
    assert same.times is None
    assert np.array_equal(same.angles, angles)
    plain = Scan(angles, ranges, 9.0, mount)
    assert joined(plain, still, 0.8) is plain


def test_a_scan_of_one_moment_is_seen_from_where_the_lidar_was_then() -> None:
    buffer, mount = readings(1.0), (0.2, -0.1, 0.4)
    scan = Scan(np.zeros(1), np.ones(1), 9.0, mount)
    seen = joined(scan, buffer, 0.5)
    assert composed(moving(1.0), seen.mount) == pytest.approx(composed(moving(0.5), mount))
    assert joined(scan, buffer, 1.0) is scan
    at_once = Scan(np.zeros(1), np.ones(1), 9.0, mount, np.zeros(1))
    assert joined(at_once, buffer, 0.5).mount == seen.mount


@pytest.mark.parametrize(
    ('step', 'seconds', 'anew'),
    [
        ((0.29, 0.0, 0.59), None, False),
        ((0.0, -0.31, 0.0), None, True),
        ((0.3, 0.3, 0.0), 0.02, True),
        ((0.0, 0.0, -0.7), 0.02, True),
        # Readings were lost: it drove on at .6 m/s, and turned at 1.5 rad/s.
        ((0.31, 0.0, 0.75), 0.5, False),
        ((1.2, 0.0, 3.0), 2.0, False),
        ((2.0, 0.0, 0.0), 0.5, True),
        ((0.5, 0.0, 0.0), -3.0, True),
    ],
)
def test_what_no_robot_drives_in_the_time_between_two_readings_is_a_new_beginning(
    step: Pose, seconds: float | None, anew: bool
) -> None:
    first = (1.0, 2.0, 3.0)
    assert began_anew(first, composed(first, step), seconds) is anew


def test_a_reading_near_zero_after_a_silence_is_a_new_beginning_and_one_driven_to_is_not() -> None:
    assert began_anew((0.5, 0.4, 0.2), (0.02, -0.01, 0.0), 1.0)
    assert not began_anew((0.05, 0.03, 0.0), (0.03, 0.02, 0.0), 0.02)


@pytest.mark.parametrize('silent', [0.1, 0.5, 2.0])
def test_a_silence_of_the_odometry_costs_no_pose(flat: Any, silent: float) -> None:
    """It turns at 1.5 rad/s, and drives; the reading after the gap is the truth."""
    true, localiser, off, turned = (2.0, 1.5, 0.0), Localiser(flat.grid, (2.0, 1.5, 0.0)), [], []
    buffer = OdometryBuffer()
    for tick in range(300):
        now = 0.02 * tick
        if not 2.0 < now < 2.0 + silent:
            localiser.move(true, now)
            buffer.add(now, true)
            if tick % 5 == 0:
                localiser.see(flat.scan(true), now)
                off.append(math.dist(localiser.pose[:2], true[:2]))
                turned.append(abs(math.remainder(localiser.pose[2] - true[2], math.tau)))
        true = composed(true, (0.006, 0.0, 0.03))
    assert max(off) < 0.1
    assert max(turned) < math.radians(3.0)
    assert localiser.jumps == 0


def test_where_the_odometry_began_anew_what_was_missed_widens_the_search(flat: Any) -> None:
    localiser, true = Localiser(flat.grid, (1.0, 0.8, 0.0)), (1.0, 0.8, 0.0)
    for tick in range(50):
        localiser.move(true, 0.02 * tick)
        if tick % 5 == 0:
            localiser.see(flat.scan(true), 0.02 * tick)
        true = composed(true, (0.012, 0.0, 0.0))
    true = composed(true, (0.2, 0.0, 0.1))
    localiser.move((0.01, 0.0, 0.0), 1.4)
    for step in range(4):
        localiser.see(flat.scan(true), 1.4 + 0.1 * step)
    assert math.dist(localiser.pose[:2], true[:2]) < 0.05


def test_a_scan_of_a_time_of_which_nothing_is_known_is_told_as_such(flat: Any) -> None:
    scan = flat.scan(moving(0.0))
    assert joined_if_known(scan, OdometryBuffer(), 1.0) is None
    assert joined_if_known(scan, readings(3.0), 0.5) is None
    assert joined_if_known(scan, readings(3.0), 2.9) is not None


def test_readings_are_kept_for_two_seconds_and_in_their_order() -> None:
    buffer = OdometryBuffer()
    assert buffer.latest is None
    assert not buffer.covers(0.0, 0.0)
    buffer.add(5.0, (0.0, 0.0, 0.0))
    assert buffer.covers(5.0, 5.2)
    assert not buffer.covers(4.99, 5.0)
    assert not buffer.covers(5.0, 5.21)
    buffer.add(5.0, (0.1, 0.0, 0.0))
    buffer.add(4.91, (0.1, 0.0, 0.0))
    assert buffer.latest == (5.0, (0.0, 0.0, 0.0)), 'late, or of the same time'
    buffer.add(6.9, (0.1, 0.0, 0.0))
    assert buffer.covers(5.0, 6.9)
    buffer.add(7.1, (0.2, 0.0, 0.0))
    assert not buffer.covers(5.0, 6.9)
    assert buffer.covers(6.9, 7.1)
    buffer.add(6.9, (0.2, 0.0, 0.0))
    assert buffer.latest == (6.9, (0.2, 0.0, 0.0)), 'the clock was set back'
    assert not buffer.covers(6.8, 6.8)
    buffer.add(8.9, (0.2, 0.0, 0.0))
    assert not buffer.covers(6.9, 8.9), 'nothing was heard for too long'


def test_a_robot_goes_on_with_the_velocity_of_the_last_tenth_of_a_second() -> None:
    buffer = OdometryBuffer()
    for tick in range(11):  # 0.5 m/s, for the last 0.1 s 1 m/s
        x = 0.5 * 0.05 * tick + (0.025 * max(0, tick - 8))
        buffer.add(0.05 * tick, (x, -x, 0.0))
    before, at, after = buffer.at(np.array([0.225, 0.5, 0.6]))
    assert before == pytest.approx([0.1125, -0.1125, 0.0])
    assert at == pytest.approx([0.3, -0.3, 0.0])
    assert after == pytest.approx([0.4, -0.4, 0.0])
    alone = OdometryBuffer()
    alone.add(1.0, (1.0, 2.0, 0.3))
    assert alone.at(np.array([1.1]))[0] == pytest.approx([1.0, 2.0, 0.3])
