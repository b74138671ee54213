"""The arm that carries the camera: where it looks, how it moves, and scans of all around."""

from surveillance_perception.arm.driver import ArmDriver
from surveillance_perception.arm.kinematics import Aim, ArmMotionError, look_at
from surveillance_perception.arm.scan import ScanOutcome, ScanPlan, scan
from surveillance_perception.arm.trajectory import (
    ArmState,
    ArmTrajectory,
    motion_to,
)
from surveillance_perception.arm.view_coverage import View, coverage, views_covering

__all__ = [
    'Aim',
    'ArmDriver',
    'ArmMotionError',
    'ArmState',
    'ArmTrajectory',
    'ScanOutcome',
    'ScanPlan',
    'View',
    'coverage',
    'look_at',
    'motion_to',
    'scan',
    'views_covering',
]
