"""Looking all around: from asked elevations to views the arm rested at, and what they covered."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from surveillance_perception.arm_driver import ArmDriver
from surveillance_perception.arm_kinematics import UnreachableError, direction_of, look_at
from surveillance_perception.view_coverage import View, coverage, views_covering
from surveillance_runtime.robot_arm import Array

_FAR = 20.0


@dataclass(frozen=True)
class ScanPlan:
    """What to look at.

    Attributes:
        horizontal: The camera's horizontal field of view, rad.
        vertical: The vertical one, rad.
        overlap: Share of the picture's angles at its edge that does not count.
        lowest: Lowest elevation, rad.
        highest: Highest elevation, rad.
    """

    horizontal: float
    vertical: float
    overlap: float
    lowest: float
    highest: float

    def views(self) -> list[View]:
        """The views, in order.

        Raises:
            ValueError: An angle or the overlap is out of range.
        """
        return views_covering(
            self.horizontal, self.vertical, self.overlap, self.lowest, self.highest
        )

    def covered(self, views: list[View]) -> float:
        """Share of the asked directions that lie in the pictures of some views."""
        return coverage(views, self.horizontal, self.vertical, self.lowest, self.highest)


@dataclass
class ScanOutcome:
    """What came of a scan.

    Attributes:
        rested: Views at which the camera rested for the whole time.
        unreachable: Views that the joints' limits forbid.
    """

    rested: list[View]
    unreachable: list[View]


def scan(
    driver: ArmDriver,
    views: list[View],
    dwell: Callable[[], bool],
    tell: Callable[[int, View, bool], None],
    ended: Callable[[], bool],
    outcome: ScanOutcome,
) -> None:
    """Look in each direction in turn.

    Args:
        driver: The arm.
        views: Where to look.
        dwell: Rests at a view; False when the scan shall end.
        tell: Told the index of each view when the arm sets out and when it rests there.
        ended: Tells whether the scan shall end; the arm is stopped then.
        outcome: Filled in as the scan goes on, so that it holds what was done when it ends early.

    Raises:
        ArmError: The arm does not get somewhere, or another motion took over.
    """
    for index, view in enumerate(views):
        try:
            positions = _aim(driver, view)
        except UnreachableError:
            outcome.unreachable.append(view)
            continue
        tell(index, view, False)
        driver.move(positions, ended)
        tell(index, view, True)
        if not dwell():
            return
        outcome.rested.append(view)


def _aim(driver: ArmDriver, view: View) -> Array:
    arm = driver.arm
    start = np.array(arm.home) if driver.positions is None else driver.positions
    shoulder = arm.camera_frame(arm.home)[:3, 3]
    return look_at(
        arm, shoulder + _FAR * direction_of(view.azimuth, view.elevation), start
    ).positions
