"""Whether a robot moves as it is commanded, and its sensors tell the same of it: 30 cm forth and
back and a quarter turn, held against odometry, scans and commands. No ROS in here.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field

import numpy as np

from lidar_navigation import MountCheck, MountFinding
from lidar_navigation.exploration.scan_matching import Matcher, surface_of
from lidar_navigation.geometry import Mount, Pose, Scan, angle_between, relative
from surveillance_runtime.profile.record import MOST_TIMEOUT, RobotProfile
from surveillance_runtime.profile.truth_check import RobotDoubt

SPEED, TURN_SPEED = 0.15, 0.5
"""The commands, m/s and rad/s: slow enough for each robot."""
WAY, TURN = 0.3, math.pi / 2
"""How far it is to go, metres, and to turn, radians."""
SILENCE = 1.5
"""After the way forth nothing is commanded for so long, seconds; then that it is to stand."""
MOST_LAG = 0.3
"""Scans that are later than the odometry by more than this are late, seconds."""
MOST_DELAY = 0.6
"""A base that begins to move later than this after a command is slow, seconds."""
MOVED, TURNED = 0.05, 0.15
"""It has moved, or turned, when it is by more than this, metres and radians."""
UNSURE = 0.15
"""How much longer a time-out may seem by odometry that comes ten times a second, seconds."""
_LAGS = np.arange(0.0, 1.51, 0.05)
_WINDOW = 0.5, 0.7


@dataclass(frozen=True)
class MotionStep:
    """One part of the motion.

    Attributes:
        speed, turn: What is commanded, m/s and rad/s.
        seconds: For how long.
        silence: How long nothing is commanded afterwards, seconds.
    """

    speed: float
    turn: float
    seconds: float
    silence: float = 0.0


STEPS = (
    MotionStep(SPEED, 0.0, WAY / SPEED, SILENCE),
    MotionStep(-SPEED, 0.0, WAY / SPEED),
    MotionStep(0.0, TURN_SPEED, TURN / TURN_SPEED),
)
REST = 1.0
"""Between two of them the robot is commanded to stand for so long, seconds."""


@dataclass
class MotionRecord:
    """What was commanded and heard; all times are those when something was said or came, seconds of
    one clock.

    Attributes:
        began: When each step began.
        ceased: When its last command was given.
        odometry: Times and poses.
        scans: Times and scans, as read with the mount that the profile or tf_static says.
    """

    began: list[float] = field(default_factory=list)
    ceased: list[float] = field(default_factory=list)
    odometry: list[tuple[float, Pose]] = field(default_factory=list)
    scans: list[tuple[float, Scan]] = field(default_factory=list)

    def pose_at(self, time: float) -> Pose:
        """Return where the odometry had the robot at a time, between two readings in proportion."""
        times = np.array([each for each, _ in self.odometry])
        poses = np.array([pose for _, pose in self.odometry])
        yaws = np.unwrap(poses[:, 2])
        x, y = (float(np.interp(time, times, poses[:, i])) for i in (0, 1))
        return x, y, float(np.interp(time, times, yaws))


def motion_doubts(
    record: MotionRecord, profile: RobotProfile, mounts: Sequence[Mount] = (Mount(),)
) -> Iterator[RobotDoubt]:
    """Yield what a motion told, the gravest first.

    Args:
        record: What was commanded and heard on `STEPS`.
        profile: The robot.
        mounts: Where its lidars are believed to sit; the scans are of the first.
    """
    if len(record.began) < len(STEPS) or not record.odometry:
        yield RobotDoubt('the robot was not moved: nothing is known of how it obeys')
        return
    yield from _of_obedience(record, profile)
    if not record.scans:
        return
    lag = scan_lag(record)
    if lag is not None and lag > MOST_LAG:
        yield RobotDoubt(
            f'{profile.topics.scans[0]}: it is {lag:.1f} s later than the odometry: the driver or '
            'the network holds it back; the robot would turn with what it saw before'
        )
    finding = _mount_finding(record, mounts[0], lag or 0.0)
    if finding is not None and not finding.fits:
        yield from _of_mount(finding, mounts, record, profile)
    if finding is None or finding.scale is None:
        # So wrong that `MountCheck` takes it for slip.
        seen, told = _scan_motion(record), math.hypot(*_ways(record)[0][:2])
        if seen is not None and min(seen, told) > MOVED and not 1 / 1.6 < seen / told < 1.6:
            yield _wrong_scale(seen / told, profile)


def _ways(record: MotionRecord) -> list[Pose]:
    """Return how the odometry moved with each step, in the frame in which that began."""
    ends = [*record.began[1:], record.odometry[-1][0]]
    return [
        relative(record.pose_at(begin), record.pose_at(end))
        for begin, end in zip(record.began, ends, strict=True)
    ]


def _of_obedience(record: MotionRecord, profile: RobotProfile) -> Iterator[RobotDoubt]:
    forth, _, turn = _ways(record)
    command = profile.topics.command
    if abs(forth[0]) < MOVED and abs(turn[2]) < TURNED:
        seen = _scan_motion(record)
        if seen is not None and seen > MOVED:
            yield RobotDoubt(
                f'{profile.topics.odom}: it stands still while the scans move: it is not of this '
                'base, or its driver does not count the wheels'
            )
        else:
            yield RobotDoubt(
                f'{command}: the base does not move: an emergency stop, motors that are off, or '
                'another program commands it'
            )
        return
    if forth[0] < -MOVED:
        yield RobotDoubt(
            f'{command}: on a command forwards the odometry goes backwards: motors or encoders are '
            'reversed; mend it in the driver'
        )
    elif abs(math.atan2(forth[1], forth[0])) > 0.5 and math.hypot(*forth[:2]) > MOVED:
        yield RobotDoubt(
            f'{profile.topics.odom}: on a command forwards it goes to the side: its axes are not '
            'those of REP-103 (x forwards), or its child frame is turned on the robot'
        )
    yield from _of_timeout(record, profile)
    delay = _delay(record)
    if delay is not None and delay > MOST_DELAY:
        yield RobotDoubt(f'{command}: the base begins to move {delay:.1f} s after a command')


def _of_timeout(record: MotionRecord, profile: RobotProfile) -> Iterator[RobotDoubt]:
    """Yield that the base obeys its last command for too long, or longer than the profile says.

    The profile gets what was measured, rounded up, unless the base had not stood when it was
    commanded to.
    """
    timeout, key = _timeout(record, profile), 'drive.command_timeout'
    command, said = profile.topics.command, profile.drive.command_timeout
    has_stood = timeout < SILENCE - 0.25
    value = f'{max(1, math.ceil(10.0 * timeout - 0.2)) / 10:g}'
    line = (key, value) if has_stood else ('', '')
    if timeout > MOST_TIMEOUT and not profile.drive.long_timeout:
        yield RobotDoubt(
            f'{command}: the base obeys the last command for {"" if has_stood else "more than "}'
            f'{timeout:.1f} s after silence: expected {MOST_TIMEOUT:g} s at most (cmd_vel_timeout '
            f'of its driver; {key} in the profile); it drives on when the patrol dies, and is '
            'refused',
            *line,
        )
    elif has_stood and key not in profile.origins:
        yield RobotDoubt(
            f'{command}: the base stands {timeout:.1f} s after silence, and the profile does not '
            'say so',
            *line,
        )
    elif has_stood and timeout > said + UNSURE:
        yield RobotDoubt(
            f'{command}: the base stands {timeout:.1f} s after silence: the profile says {said:g} '
            's',
            *line,
        )


def _timeout(record: MotionRecord, profile: RobotProfile) -> float:
    """Return for how long the base went on after the first step's last command, seconds."""
    ceased = record.ceased[0]
    braking = SPEED / profile.drive.deceleration
    times = [at for at, _ in record.odometry if ceased <= at <= record.began[1]]
    last = ceased
    for at in times:
        before = record.pose_at(at - 0.1)
        if math.dist(before[:2], record.pose_at(at)[:2]) > 0.1 * 0.25 * SPEED:
            last = at
    # The last tenth looks back, and a base may take a moment to brake.
    return max(0.0, last - ceased - 0.1 - braking)


def _delay(record: MotionRecord) -> float | None:
    start = record.pose_at(record.began[0])
    for at, pose in record.odometry:
        if at > record.began[0] and math.dist(pose[:2], start[:2]) > 0.02:
            return at - record.began[0] - 0.02 / SPEED
    return None


def scan_lag(record: MotionRecord) -> float | None:
    """Return by how much the scans are later than the odometry, seconds; None: not known.

    The turn as the scans have it is held against the turn as the odometry has it, shifted in time;
    the shift that fits best is it. Neither the sense nor the scale of turning counts.
    """
    begin = record.began[2]
    scans = [(at, scan) for at, scan in record.scans if begin - 0.3 <= at <= begin + 3.5]
    if len(scans) < 6:
        return None
    matcher = Matcher(surface_of(scans[0][1]))
    times, turns = [], []
    for at, scan in scans:
        found = matcher.match(scan, surface_of(scan), (0.0, 0.0, 0.0), _WINDOW)
        if found is None or found.agreement < 0.5 or abs(found.pose[2]) > 0.6:
            break
        times.append(at)
        turns.append(abs(found.pose[2]))
    if len(times) < 4 or max(turns) < 0.2:
        return None
    first = record.pose_at(times[0])[2]
    errors = []
    for lag in _LAGS:
        driven = [abs(record.pose_at(at - lag)[2] - first) for at in times]
        errors.append(float(np.abs(np.array(turns) - driven).mean()))
    return float(_LAGS[int(np.argmin(errors))])


def _scan_motion(record: MotionRecord) -> float | None:
    """Return how far the scans went forth, metres; None: not known."""
    scans = [(at, scan) for at, scan in record.scans if record.began[0] <= at <= record.began[1]]
    if len(scans) < 2:
        return None
    matcher = Matcher(surface_of(scans[0][1]))
    last = scans[-1][1]
    found = matcher.match(last, surface_of(last), (0.0, 0.0, 0.0), _WINDOW)
    return None if found is None else math.hypot(*found.pose[:2])


def _mount_finding(record: MotionRecord, mount: Mount, lag: float) -> MountFinding | None:
    check = MountCheck(mount)
    finding = None
    for at, scan in record.scans:
        finding = check.see(scan, record.pose_at(at - lag)) or finding
        if check.is_done:
            break
    return finding


def _of_mount(
    finding: MountFinding, mounts: Sequence[Mount], record: MotionRecord, profile: RobotProfile
) -> Iterator[RobotDoubt]:
    turn = _ways(record)[2][2]
    scan = profile.topics.scans[0]
    if finding.is_mirrored and turn < -TURNED:
        # The command breaks the tie: it was to the left.
        yield RobotDoubt(
            f'{profile.topics.odom}: it turns to the right on a command to the left, and the scans '
            'turn to the left: its sense of turning is wrong; mend it in the driver (left and '
            'right encoder)'
        )
        return
    if finding.is_mirrored or finding.is_turned:
        fitting = [finding.fitting, *mounts[1:]]
        rows = ', '.join(
            f'[{m.pose[0]:g}, {m.pose[1]:g}, {round(m.pose[2], 2) + 0.0:.2f}, '
            f'{3.1416 if m.upside_down else 0:g}]'
            for m in fitting
        )
        what = []
        if finding.is_mirrored:
            hangs = 'upside down' if finding.fitting.upside_down else 'upright'
            what.append(f'is mirrored: the lidar hangs {hangs}')
        if finding.is_turned:
            off = abs(angle_between(finding.believed.pose[2], finding.fitting.pose[2]))
            what.append(f'is turned by {off:.2f} rad against the profile')
        yield RobotDoubt(f'{scan}: it {", and ".join(what)}', 'lidars.mounts', f'[{rows}]')
    if finding.is_scaled:
        yield _wrong_scale(finding.scale or 1.0, profile)
    if finding.is_turn_scaled:
        yield RobotDoubt(
            f'{profile.topics.odom}: it counts {1 / abs(finding.turn_scale or 1.0):.2f} rad for '
            "each radian that the scans see: the driver's wheel separation is wrong",
            'odometry.turn_scale',
            f'{abs(finding.turn_scale or 1.0):.3f}',
        )


def _wrong_scale(scale: float, profile: RobotProfile) -> RobotDoubt:
    """Return what is said of odometry that counts wrong metres: `scale` true ones for each."""
    return RobotDoubt(
        f'{profile.topics.odom}: it counts {1 / scale:.2f} m for each metre that the scans see: '
        "the driver's wheel radius is wrong",
        'odometry.scale',
        f'{scale:.3f}',
    )
