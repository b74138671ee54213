"""Whether the lidars sit as the profile says and the odometry counts true metres: told while the
robot drives (`lidar_navigation.localisation.mount_check`), with the line of the profile to change.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from sensor_msgs.msg import LaserScan

from lidar_navigation import MountCheck, MountFinding
from lidar_navigation.geometry import Mount, Pose, Scan
from lidar_navigation.localisation.odometry import OdometryBuffer
from strict_files.settings import parameter
from surveillance_runtime.conversions import seconds_of
from surveillance_runtime.incidents import Severity
from surveillance_runtime.node import PatrolNode
from surveillance_runtime.sensing.transforms import ScanReader

CAUSE = ('robot', 'mount')
"""The cause of the incident."""
CAUTIOUS_SPEED, CAUTIOUS_WAY = 0.25, 1.0
"""Until it is known how the robot drives it drives no faster than this, m/s; over
this way, metres: some places never tell."""
_UPSIDE_DOWN = 3.1416
"""The roll of a lidar that hangs upside down, as the profile has it, rad."""


@dataclass(frozen=True)
class MountSettings:
    """Whether it is looked for."""

    check: bool = parameter(
        True,
        'Hold the odometry against the scans over the first decimetres, and stand where they '
        'contradict each other.',
        name='check_mounts',
    )


def profile_lines(finding: MountFinding, mounts: Sequence[Mount], index: int = 0) -> list[str]:
    """Return what to change in the robot's profile so that scans and odometry agree.

    Args:
        finding: What was found of one lidar.
        mounts: Where all lidars are believed to sit, in the order of `topics.scans`.
        index: Which of them it is.

    Returns:
        One line for each thing that is wrong, as the profile has it; empty where all fits.
    """
    lines = []
    if finding.is_turned or finding.is_mirrored:
        fitting = list(mounts)
        fitting[index] = finding.fitting
        rows = ', '.join(_row(mount) for mount in fitting)
        lines.append(f'lidars: {{mounts: [{rows}]}}')
    scales = []
    if finding.is_scaled:
        scales.append(f'scale: {finding.scale:.3f}')
    if finding.is_turn_scaled:
        scales.append(f'turn_scale: {abs(finding.turn_scale or 1.0):.3f}')
    if scales:
        lines.append(f'odometry: {{{", ".join(scales)}}}')
    return lines


def advice(finding: MountFinding, mounts: Sequence[Mount], index: int = 0) -> str:
    """Return what a person is to do, in one sentence; empty where all fits."""
    lines = profile_lines(finding, mounts, index)
    if not lines:
        return ''
    text = f'write into the robot profile {" and ".join(lines)}'
    if finding.is_mirrored:
        side = 'upside down' if finding.fitting.upside_down else 'upright'
        text += f' (the lidar hangs {side}; or the odometry turns the wrong way)'
    if finding.is_turned:
        text += f' (the lidar is turned by {round(finding.fitting.pose[2], 2) + 0.0:.2f} rad)'
    return text


def _row(mount: Mount) -> str:
    x, y, yaw = mount.pose
    roll = _UPSIDE_DOWN if mount.upside_down else 0.0
    return f'[{x:g}, {y:g}, {round(yaw, 2) + 0.0:.2f}, {roll:g}]'


class MountWatch:
    """Checks each lidar of a robot until it is known to fit.

    Args:
        node: The node that drives; it begins and ends the incident.
        lidar: What reads the scans.

    Attributes:
        problem: Why the robot is not to be driven, with what a person is to do; empty: it may be.
    """

    def __init__(self, node: PatrolNode, lidar: ScanReader) -> None:
        self._node, self._lidar = node, lidar
        self._is_wanted = node.declare_fields(MountSettings()).check
        self._readings = OdometryBuffer()
        self._checks: dict[str, MountCheck] = {}
        self._frames: dict[str, str] = {}
        self.problem = ''
        self._last: Pose | None = None
        self._way = 0.0

    @property
    def top_speed(self) -> float:
        """How fast the robot is to be driven, m/s, before direction and scale are known."""
        found = [check.finding for check in self._checks.values()]
        known = [each for each in found if each is not None and each.scale is not None]
        is_known = len(known) == len(self._lidar.settings.scans)
        cautious = self._is_wanted and not is_known and self._way < CAUTIOUS_WAY
        return CAUTIOUS_SPEED if cautious else math.inf

    @property
    def is_done(self) -> bool:
        """Whether nothing more is looked for."""
        topics = self._lidar.settings.scans
        known = [self._checks[topic].is_done for topic in topics if topic in self._checks]
        return not self._is_wanted or (len(known) == len(topics) and all(known))

    def move(self, odometry: Pose, measured: float) -> None:
        """Take a reading of the odometry, and when it was made, seconds."""
        if self.is_done:
            return
        self._readings.add(measured, odometry)
        if self._last is not None:
            self._way += math.dist(self._last[:2], odometry[:2])
        self._last = odometry

    def see(self, topic: str, scan: Scan, message: LaserScan) -> None:
        """Take a scan as it was read; its message has its stamp and its frame."""
        if self.is_done:
            return
        frame = message.header.frame_id
        mount = self._lidar.mount_of(frame, topic)
        check = self._checks.get(topic)
        if check is None or check.mount != mount:
            check = self._checks[topic] = MountCheck(mount)
        self._frames[topic] = frame
        sweep = 0.0 if scan.times is None else float(scan.times.max(initial=0.0))
        at = seconds_of(message.header.stamp) + sweep / 2
        if not self._readings.covers(at, at):
            return
        x, y, yaw = self._readings.at(np.array([at]))[0].tolist()
        before = check.finding
        finding = check.see(scan, (x, y, yaw))
        if finding is not None and finding is not before:
            self._tell(topic)

    def _tell(self, topic: str) -> None:
        topics = self._lidar.settings.scans
        mounts = [self._lidar.mount_of(self._frames.get(each, ''), each) for each in topics]
        wrong = [
            (index, check.finding)
            for index, check in enumerate(self._checks.get(each) for each in topics)
            if check is not None and check.finding is not None and not check.finding.fits
        ]
        if not wrong:
            self.problem = ''
            self._node.incidents.end(CAUSE, 'scans and odometry agree')
            return
        index, finding = wrong[0]
        name = self._lidar.streams[topics[index]].topic
        what = f'{name} contradicts the odometry: {finding.text}'
        action = f'{advice(finding, mounts, index)}, and start again'
        self.problem = f'{what}; {action}'
        self._node.incidents.begin(
            CAUSE, f'the robot stands: {what}', Severity.ALARM, action=action
        )
