"""Scans: directions in which to look so that none stays unseen, and the arm that takes them.

Views stand in rows of equal elevation. How far a row may be from the next, and a view from the one
beside it, follows from what a rectangular image covers: the condition is looked at exactly, at
closely spaced directions of each row's band, instead of taking the image for a rectangle of
angles, which it is not away from the horizon.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field

import numpy as np
import numpy.typing as npt

from surveillance_perception.arm.driver import ArmDriver
from surveillance_perception.arm.kinematics import ArmMotionError, direction_of, look_at
from surveillance_runtime.robot_arm import Arm, Array

_FAR = 20.0
_BAND_SAMPLES = 25
_AZIMUTH_STEP = math.radians(0.5)
_MOST_ROWS = 24
_COVERAGE_SAMPLES = 4000


@dataclass(frozen=True)
class View:
    """A line of sight.

    Attributes:
        azimuth: From x towards y, rad, -pi to pi.
        elevation: Above the horizon, rad.
    """

    azimuth: float
    elevation: float


@dataclass(frozen=True)
class ScanPlan:
    """What to look at: every direction between two elevations, all the way around.

    Attributes:
        horizontal: The camera's field of view along the image's rows, rad.
        vertical: The one along its columns, rad.
        overlap: Share of the image's angles at its edge that does not count, 0 to 0.8, so that
            what lies on the border of a view is whole in some view.
        lowest: Lowest elevation, rad, from -pi/2.
        highest: Highest elevation, rad, to pi/2.
        views: The views that show it all, in an order with short ways between them.

    Raises:
        ValueError: An angle or the overlap is out of range.
    """

    horizontal: float
    vertical: float
    overlap: float
    lowest: float
    highest: float
    views: tuple[View, ...] = field(init=False)

    def __post_init__(self) -> None:
        if not 0.0 < self.horizontal < math.pi or not 0.0 < self.vertical < math.pi:
            raise ValueError('fields of view must lie between 0 and pi rad')
        if not 0.0 <= self.overlap <= 0.8:
            raise ValueError(f'overlap must be 0 to 0.8, got {self.overlap:g}')
        if not -math.pi / 2 - 1e-9 <= self.lowest <= self.highest <= math.pi / 2 + 1e-9:
            raise ValueError(
                f'elevations must run upwards within -pi/2 and pi/2, got {self.lowest:g} to '
                f'{self.highest:g}'
            )
        views: list[View] = []
        for index, (elevation, count) in enumerate(self._fewest_rows()):
            azimuths = [-math.pi + (k + 0.5) * 2.0 * math.pi / count for k in range(count)]
            # every other row is taken backwards: its first view is near the last one
            views += [View(each, elevation) for each in (azimuths, azimuths[::-1])[index % 2]]
        object.__setattr__(self, 'views', tuple(views))

    def _fewest_rows(self) -> list[tuple[float, int]]:
        """Return elevation and number of views of each row of the plan with the fewest views."""
        half_width = self.horizontal / 2.0 * (1.0 - self.overlap)
        half_height = self.vertical / 2.0 * (1.0 - self.overlap)
        fewest = max(1, math.ceil((self.highest - self.lowest) / (2.0 * half_height) - 1e-9))
        plans = []
        for rows in range(fewest, fewest + _MOST_ROWS):
            plan = _rows(rows, half_width, half_height, self.lowest, self.highest)
            if plan is not None:
                plans.append(plan)
                if len(plans) == 3:
                    break
        if not plans:
            raise ValueError('the field of view is too narrow to cover the sphere')
        return min(plans, key=lambda plan: sum(count for _, count in plan))

    def covered(self, views: Sequence[View]) -> float:
        """Share of the asked directions that lie in the images of some views."""
        # evenly spread directions: the golden angle between neighbours on a spiral
        index: Array = np.arange(_COVERAGE_SAMPLES, dtype=float) + 0.5
        low, high = math.sin(self.lowest), math.sin(self.highest)
        sine = low + (high - low) * index / _COVERAGE_SAMPLES
        elevation = np.asarray(np.arcsin(np.clip(sine, -1.0, 1.0)), dtype=float)
        azimuth = index * math.pi * (3.0 - math.sqrt(5.0))
        seen = np.zeros(_COVERAGE_SAMPLES, bool)
        half_width, half_height = self.horizontal / 2.0, self.vertical / 2.0
        for view in views:
            offset = azimuth - view.azimuth
            seen |= _seen(offset, elevation, view.elevation, half_width, half_height)
        return float(seen.mean())


def _rows(
    rows: int, half_width: float, half_height: float, lowest: float, highest: float
) -> list[tuple[float, int]] | None:
    """Elevation and number of views of each row; None when a row has gaps."""
    height = (highest - lowest) / rows
    plan = []
    for row in range(rows):
        bottom = lowest + row * height
        middle = bottom + height / 2.0
        # a row next to a pole looks at the pole when it can see all of its band from there
        for elevation in {middle, math.copysign(math.pi / 2, middle)}:
            reach = _reach(bottom, bottom + height, elevation, half_width, half_height)
            if reach >= math.pi - 1e-9:
                plan.append((elevation, 1))
                break
        else:
            reach = _reach(bottom, bottom + height, middle, half_width, half_height)
            if reach < _AZIMUTH_STEP:
                return None
            plan.append((middle, math.ceil(math.pi / reach - 1e-9)))
    return plan


def _reach(
    bottom: float, top: float, elevation: float, half_width: float, half_height: float
) -> float:
    """Azimuth to both sides within which a view shows its whole band, rad."""
    band = np.linspace(bottom, top, _BAND_SAMPLES)[:, None]
    offsets = np.arange(0.0, math.pi + _AZIMUTH_STEP, _AZIMUTH_STEP).clip(max=math.pi)[None, :]
    whole = _seen(offsets, band, elevation, half_width, half_height).all(axis=0)
    gaps = np.flatnonzero(~whole)
    if not len(gaps):
        return math.pi
    return float(offsets[0, gaps[0] - 1]) if gaps[0] > 0 else 0.0


def _seen(
    offset: Array, elevation: Array, view: float, half_width: float, half_height: float
) -> npt.NDArray[np.bool_]:
    """Tell whether directions lie in the image of a view at azimuth 0."""
    flat, up = np.cos(elevation), np.sin(elevation)
    depth = flat * np.cos(offset) * math.cos(view) + up * math.sin(view)
    right = flat * np.sin(offset)
    above = up * math.cos(view) - flat * np.cos(offset) * math.sin(view)
    return np.asarray(
        (depth > 1e-9)
        & (np.abs(right) <= depth * math.tan(half_width) + 1e-9)
        & (np.abs(above) <= depth * math.tan(half_height) + 1e-9)
    )


@dataclass
class ScanOutcome:
    """What came of a scan.

    Attributes:
        rested: How many views the camera rested at for the whole time.
        unreachable: How many views the joints' limits forbid.
        covered: Share of the asked directions that a resting camera has seen.
        failure: Why the scan ended before its last view, '' where nothing failed.
    """

    rested: int = 0
    unreachable: int = 0
    covered: float = 0.0
    failure: str = ''


def scan(
    driver: ArmDriver,
    plan: ScanPlan,
    dwell: Callable[[], bool],
    tell: Callable[[int, View, bool], None],
    ended: Callable[[], bool],
) -> ScanOutcome:
    """Look in each direction in turn, from the end of the plan that is nearer to the arm.

    Args:
        driver: The arm.
        plan: Where to look.
        dwell: Rests at a view; False when the scan shall end.
        tell: Told the index of each view when the arm sets out and when it rests there.
        ended: Tells whether the scan shall end; the arm is stopped then.
    """
    outcome = ScanOutcome()
    rested: list[View] = []
    for index, view in enumerate(from_nearer_end(driver.arm, plan.views, driver.posture)):
        try:
            positions = aim_at(driver.arm, view, driver.posture)
        except ArmMotionError:
            outcome.unreachable += 1
            continue
        tell(index, view, False)
        try:
            driver.move(positions, ended)
        except ArmMotionError as error:
            outcome.failure = f'view {index + 1} of {len(plan.views)}: {error}'
            break
        tell(index, view, True)
        if not dwell():
            break
        rested.append(view)
    outcome.rested, outcome.covered = len(rested), plan.covered(rested)
    return outcome


def from_nearer_end(arm: Arm, views: Sequence[View], posture: Array) -> Sequence[View]:
    """Return the views in their order or backwards: the first is what the arm is nearer to.

    An arm with a stop behind it would otherwise begin with a swing all around.
    """

    def travel(view: View) -> float:
        try:
            return float(np.abs(aim_at(arm, view, posture) - posture).max())
        except ArmMotionError:
            return math.inf

    return views[::-1] if travel(views[-1]) < travel(views[0]) else views


def aim_at(arm: Arm, view: View, posture: Array) -> Array:
    """Return joint positions (n,) that look in a view's direction, near a posture (n,).

    Raises:
        ArmMotionError: The joints' limits forbid it.
    """
    shoulder = arm.camera_frame(arm.home)[:3, 3]
    target = shoulder + _FAR * direction_of(view.azimuth, view.elevation)
    return look_at(arm, target, posture).positions
