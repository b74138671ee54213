"""Looking all around: from asked elevations to views the arm rested at, and what they covered."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field

import numpy as np

from surveillance_perception.arm.driver import ArmDriver
from surveillance_perception.arm.kinematics import ArmMotionError, direction_of, look_at
from surveillance_perception.arm.view_coverage import View, coverage, views_covering
from surveillance_runtime.robot_arm import Arm, Array

_FAR = 20.0


@dataclass(frozen=True)
class ScanPlan:
    """What to look at.

    Attributes:
        horizontal: The camera's horizontal field of view, rad.
        vertical: The vertical one, rad.
        overlap: Share of the image's angles at its edge that does not count.
        lowest: Lowest elevation, rad.
        highest: Highest elevation, rad.
        views: The views that show it all, in order.

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
        views = views_covering(
            self.horizontal, self.vertical, self.overlap, self.lowest, self.highest
        )
        object.__setattr__(self, 'views', tuple(views))

    def covered(self, views: list[View]) -> float:
        """Share of the asked directions that lie in the images of some views."""
        return coverage(views, self.horizontal, self.vertical, self.lowest, self.highest)


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
