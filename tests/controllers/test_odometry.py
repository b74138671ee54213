"""Scans are joined with the odometry of their time: late ones, and those that take a while."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest

from surveillance_controllers.geometry import Pose, Scan, composed, relative
from surveillance_controllers.motion.localisation import Localiser
from surveillance_controllers.motion.odometry import ContinuousOdometry, OdometryBuffer, joined


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
