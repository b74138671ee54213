"""Whether a lidar sits on its robot as it is said to, and odometry counts true metres.

What the scans say of a motion is held against what the odometry says of it. Scans are matched with
each other alone, from a guess of no motion, so that nothing of the odometry is in them. A lidar
that is turned on its robot sees it drive another way; one that hangs upside down sees it turn the
other way; wheels of another size than the driver believes make every way longer or shorter (the
idea of Censi, Franchi, Marchionni, Oriolo, "Simultaneous calibration of odometry and sensor
parameters for mobile robots", T-RO 2013, for what a few decimetres can tell).

Let the lidar sit at t, turned by m, and be believed to be turned by b. It goes by d, as the
odometry has it, in the frame of its robot where it began; the scans have it go by s. Written as
complex numbers, s = k exp(i (b - m)) d, and for a lidar that hangs the other way up than believed
conj(s) = k exp(-i (b + m)) d: k is the scale.
"""

from __future__ import annotations

import cmath
import math
from collections import deque
from dataclasses import dataclass, field
from statistics import median

import numpy as np

from lidar_navigation.exploration.scan_matching import Matcher, surface_of
from lidar_navigation.geometry import Mount, Pose, Scan, angle_between, relative

WAY = 0.28
"""Over this way, metres, the scale is judged,"""
DIRECTION_WAY = 0.12
"""over this one the direction,"""
TURN = 0.5
"""and over these turns, rad, the sense of turning."""
MOST_YAW = 0.3
"""A lidar that is turned by more than this against what is said of it sits wrong, rad."""
MOST_SCALE = 1.14
"""Odometry that is off by this factor counts wrong metres: a tenth is what wheels wear."""
MOST_TURN_SCALE = 1.4
"""Likewise of its turns: what skids about has no exact ones."""
_PART_WAY, _PART_TURN, _LEAST_WAY = 0.1, 0.2, 0.05
"""A motion is measured in parts of this way, metres, or turn, rad; of a turn's end shorter ways;"""
_BASE_WAY, _BASE_TURN = 0.3, 0.6
"""after this much of them the next scan is what others are matched with: what is in view changes,
and the odometry's turn may be off itself."""
_KEPT = 8
"""So many parts count; older ones are forgotten."""
_FEWEST_TURNS = 3
"""So many parts tell of turns: somebody who pushes the robot in one of them decides nothing."""
_LEAST_SHARE = 0.5
"""Where the scans have less than this share of a way or turn, or more by as much, wheels slip, or
somebody pushes."""
_JUMP = 0.5
"""No robot drives so far, or turns so much, between two scans, metres or rad."""
_WINDOW = 0.5, 0.6
"""How far and by which turn a motion is looked for, metres and rad."""
_AGREEMENT = 0.6
"""So much of a scan must lie on what the one before saw."""
_SURE = 0.012
"""The largest standard deviation of a motion that tells something, metres and rad; along a
corridor it is greater."""
_STEADY = 0.1
"""Parts of a way whose scales differ by more than this from all are no scale: wheels slip."""
_WAY_NOISE, _LEVER = 0.008, 0.08
"""Standard deviation of a part of a way, and of where the lidar sits: a turn shows that, metres."""
_LEAST_DOUBT = 0.01
"""A scale is never known better than this."""
_COHERENT = 0.97
"""So well must the directions of the parts agree, 0 to 1."""


@dataclass(frozen=True)
class MountFinding:
    """What a motion told of a lidar's mount and of the odometry.

    Attributes:
        believed: Where the lidar is said to sit.
        fitting: Where it sits if the odometry's directions are right.
        scale: True metres for each metre of the odometry; None: not known yet.
        doubt: Standard deviation of the scale;
        yaw_doubt: of the angle, rad.
        turn_scale: True radians for each radian of the odometry; None: not known yet.
    """

    believed: Mount
    fitting: Mount
    scale: float | None = None
    turn_scale: float | None = None
    doubt: float = 0.0
    yaw_doubt: float = 0.0

    @property
    def is_turned(self) -> bool:
        """Whether the lidar is turned otherwise than is said of it."""
        off = abs(angle_between(self.believed.pose[2], self.fitting.pose[2]))
        return off - 2 * self.yaw_doubt > MOST_YAW

    @property
    def is_mirrored(self) -> bool:
        """Whether it hangs the other way up; or the odometry turns the wrong way."""
        return self.believed.upside_down != self.fitting.upside_down

    @property
    def is_scaled(self) -> bool:
        """Whether the odometry's metres are not true ones."""
        if self.scale is None:
            return False
        doubt = 2 * self.doubt
        return self.scale - doubt > MOST_SCALE or self.scale + doubt < 1 / MOST_SCALE

    @property
    def is_turn_scaled(self) -> bool:
        """Whether the odometry's turns are not true ones."""
        true = self.turn_scale
        return true is not None and not 1 / MOST_TURN_SCALE <= abs(true) <= MOST_TURN_SCALE

    @property
    def fits(self) -> bool:
        """Whether scans and odometry agree."""
        wrong = self.is_turned or self.is_mirrored or self.is_scaled or self.is_turn_scaled
        return not wrong

    @property
    def text(self) -> str:
        """What is wrong, in words; empty where all fits."""
        found = []
        if self.is_mirrored:
            found.append('turns the other way in the scans than in the odometry')
        if self.is_turned:
            off = math.degrees(angle_between(self.believed.pose[2], self.fitting.pose[2]))
            found.append(f'drives {abs(off):.0f} degrees to the {"right" if off > 0 else "left"}'
                         ' in the scans of where the odometry has it')  # fmt: skip
        if self.is_scaled:
            found.append(f'goes {self.scale:.2f} m in the scans for each metre of the odometry')
        if self.is_turn_scaled:
            found.append(
                f'turns {abs(self.turn_scale or 0):.2f} rad in the scans for each radian of the '
                'odometry'
            )
        return 'the robot ' + ', and '.join(found) if found else ''


@dataclass(eq=False)
class MountCheck:
    """Checks one lidar, while its robot drives anywhere.

    Args:
        mount: Where it is said to sit.

    Attributes:
        finding: What is found; None until something is.
        is_done: Whether way and turn are known to fit, so that nothing more is looked for.
    """

    mount: Mount = field(default_factory=Mount)
    finding: MountFinding | None = field(default=None, init=False)
    is_done: bool = field(default=False, init=False)

    def __post_init__(self) -> None:
        self._base: tuple[Matcher, Pose] | None = None
        self._last: Pose | None = None
        # By odometry and by scans: from where in the base's frame the next part is measured.
        self._way_from: tuple[Pose, Pose] = _NOTHING, _NOTHING
        self._turn_from: tuple[Pose, Pose] = _NOTHING, _NOTHING
        self._ways: deque[tuple[complex, complex]] = deque(maxlen=_KEPT)
        self._bends: deque[float] = deque(maxlen=_KEPT)
        self._turns: deque[tuple[float, float]] = deque(maxlen=_KEPT)

    def see(self, scan: Scan, odometry: Pose) -> MountFinding | None:
        """Take a scan, and where the odometry had the robot when it was made.

        Args:
            scan: As read with the mount that is believed.
            odometry: In the odometry's own frame.

        Returns:
            What is found; None until something is.
        """
        if self.is_done:
            return self.finding
        step = _NOTHING if self._last is None else relative(self._last, odometry)
        self._last = odometry
        if self._base is None or math.hypot(*step[:2]) > _JUMP or abs(step[2]) > _JUMP:
            self._begin(scan, odometry)
            return self.finding
        matcher, start = self._base
        driven = relative(start, odometry)
        way = self._lidar_way(driven) - self._lidar_way(self._way_from[0])
        turn = angle_between(self._turn_from[0][2], driven[2])
        if abs(way) < _PART_WAY and abs(turn) < _PART_TURN:
            return self.finding
        found = matcher.match(scan, surface_of(scan), _NOTHING, _WINDOW)
        if found is None or found.agreement < _AGREEMENT:
            self._begin(scan, odometry)
            return self.finding
        covariance = np.linalg.inv(found.information + 1e-6 * np.eye(3))
        deviation = np.sqrt(covariance.diagonal())
        is_over = math.hypot(*driven[:2]) >= _BASE_WAY or abs(driven[2]) >= _BASE_TURN
        if abs(turn) >= _PART_TURN:
            turned = angle_between(self._turn_from[1][2], found.pose[2])
            if deviation[2] <= _SURE and _is_driven(turned / turn):
                self._turns.append((turn, turned))
            self._turn_from = driven, found.pose
        if abs(way) >= (_LEAST_WAY if is_over else _PART_WAY):
            seen = self._lidar_way(found.pose) - self._lidar_way(self._way_from[1])
            if _is_driven(abs(seen) / abs(way)) and deviation.max() <= _SURE:
                self._ways.append((way, seen))
                bent = abs(angle_between(self._way_from[0][2], driven[2]))
                self._bends.append((_WAY_NOISE + _LEVER * bent) / abs(way))
            self._way_from = driven, found.pose
        if is_over:
            self._begin(scan, odometry)
        self._judge()
        return self.finding

    def _begin(self, scan: Scan, odometry: Pose) -> None:
        """Match what comes with this scan."""
        surface = surface_of(scan)
        self._base = (Matcher(surface), odometry) if len(surface.points) else None
        self._way_from = self._turn_from = _NOTHING, _NOTHING

    def _lidar_way(self, step: Pose) -> complex:
        """Return how far the lidar goes with a step of its robot, in the frame where that began."""
        x, y, yaw = step
        at = complex(*self.mount.pose[:2])
        return complex(x, y) + (cmath.exp(1j * yaw) - 1.0) * at

    def _judge(self) -> None:
        """Draw what follows from the parts that are kept."""
        turn_scale = self._scale_of_turns()
        is_flipped = turn_scale is not None and turn_scale < 0.0
        fitting, scale = self.mount, None
        if self._length >= DIRECTION_WAY:
            believed = self.mount.pose[2]
            ratio, is_coherent = self._ratio(is_flipped)
            if is_coherent:
                yaw = believed - cmath.phase(ratio)
                if is_flipped:
                    yaw = -cmath.phase(ratio) - believed
                fitting = self.mount._replace(
                    pose=(*self.mount.pose[:2], math.remainder(yaw, math.tau))
                )
                if self._length >= WAY and self._is_steady(abs(ratio)):
                    scale = abs(ratio)
        if is_flipped:
            fitting = fitting._replace(upside_down=not self.mount.upside_down)
        if self._length < DIRECTION_WAY and turn_scale is None:
            return
        doubt = 0.0 if scale is None else self._doubt(scale)
        yaw_doubt = self._yaw_doubt() if self._ways else 0.0
        self.finding = MountFinding(self.mount, fitting, scale, turn_scale, doubt, yaw_doubt)
        self.is_done = self.finding.fits and scale is not None and turn_scale is not None

    @property
    def _length(self) -> float:
        """The way that was measured, metres."""
        return sum(abs(way) for way, _ in self._ways)

    def _scale_of_turns(self) -> float | None:
        """Return how much the robot turned in the scans for each radian of the odometry."""
        is_long = sum(abs(turn) for turn, _ in self._turns) >= TURN
        if not is_long or len(self._turns) < _FEWEST_TURNS:
            return None
        ratio = median(seen / turn for turn, seen in self._turns)
        return ratio if abs(ratio) >= _LEAST_SHARE else None

    def _ratio(self, is_flipped: bool) -> tuple[complex, bool]:
        """Return how the scans' ways follow from the odometry's, and whether all agree."""
        pairs = [(way, seen.conjugate() if is_flipped else seen) for way, seen in self._ways]
        products = [seen * way.conjugate() for way, seen in pairs]
        total = sum(products)
        is_coherent = abs(total) >= _COHERENT * sum(map(abs, products))
        return total / sum(abs(way) ** 2 for way, _ in pairs), is_coherent

    def _yaw_doubt(self) -> float:
        """Return the standard deviation of the direction: long parts count more."""
        weights = [abs(way) ** 2 for way, _ in self._ways]
        off = [weight * bend for weight, bend in zip(weights, self._bends, strict=True)]
        return math.hypot(*off) / sum(weights)

    def _doubt(self, scale: float) -> float:
        off = [abs(seen) / abs(way) - scale for way, seen in self._ways]
        spread = math.sqrt(sum(each * each for each in off) / len(off))
        return max(_LEAST_DOUBT, spread / math.sqrt(len(off)))

    def _is_steady(self, scale: float) -> bool:
        return all(abs(abs(seen) / abs(way) - scale) <= _STEADY for way, seen in self._ways)


def _is_driven(share: float) -> bool:
    """Tell whether the wheels moved the robot, by what the scans have of the odometry's part."""
    return _LEAST_SHARE <= abs(share) <= 1 / _LEAST_SHARE


_NOTHING: Pose = (0.0, 0.0, 0.0)
"""No motion."""
