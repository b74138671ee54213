"""Where the camera was, by stamps: the base, the joints that turn it, and how sure that is."""

from __future__ import annotations

import math
import re
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from indoor_watch.hung_markers import CameraView
from indoor_watch.reference_views import Viewpoint
from lidar_navigation.geometry import Pose
from marker_detection import CameraModel
from surveillance_perception.observing.base_history import STILL, BaseHistory
from surveillance_runtime.robot_arm import ARM
from surveillance_runtime.stamped_readings import SAME_TIME, StampedReadings

Matrix = NDArray[np.float64]

SETTLED = 0.5
"""The camera has to stand for so long before a picture that is compared, seconds."""
LEAST_DOUBT = 0.01, 0.005
"""Standard deviation of a pose at least, metres and rad: some localisations tell none."""
MOST_JOINTS = 1000
"""In one message."""
MOST_JOINT_GROUPS = 10
"""Joints are followed of so many drivers, each of which tells its own."""
_WHEEL = re.compile('wheel|caster', re.IGNORECASE)


@dataclass(frozen=True, eq=False)
class CameraAt:
    """Where the arm held the camera.

    Attributes:
        pose: (4, 4), from its optical frame to the map, metres.
        lens: What it is like.
        deviation, turn: Standard deviations of the pose, metres and rad.
    """

    pose: Matrix
    lens: CameraModel
    deviation: float
    turn: float

    def view_of(self, picture: NDArray[np.uint8]) -> CameraView | None:
        """Return from where a picture was taken; None: it has another shape than the camera's."""
        rows, columns = picture.shape[:2]
        lens = self.lens.scaled_to(columns, rows)
        if lens is None:
            return None
        return CameraView(self.pose, lens.matrix, self.deviation, self.turn)


class CameraTracker:
    """Where the camera was lately; owned by the executor's thread.

    Args:
        base: Where the base was.
        doubt: Returns how sure the localisation is of its last pose: standard deviations, metres
            and rad; None: it does not tell.
    """

    def __init__(self, base: BaseHistory, doubt: Callable[[], tuple[float, float] | None]) -> None:
        self._base, self._doubt = base, doubt
        self._joints: dict[tuple[str, ...], StampedReadings] = {}
        self.lens: CameraModel | None = None

    @property
    def angle(self) -> float | None:
        """How much of the horizon a picture shows, rad; None: the lens is not known."""
        if self.lens is None:
            return None
        return float(2.0 * math.atan(self.lens.width / 2.0 / self.lens.matrix[0, 0]))

    def take_joints(self, measured: float, joints: Mapping[str, float]) -> None:
        """Take where the joints of a driver stood at a time, rad; seconds."""
        names = tuple(joints)
        if names not in self._joints:
            if not joints or len(self._joints) >= MOST_JOINT_GROUPS:
                return
            self._joints[names] = StampedReadings(STILL)
        self._joints[names].add(measured, tuple(joints.values()))

    def viewpoint(self, first: float, last: float) -> Viewpoint | None:
        """Return where the camera stood between two stamps and shortly before; None: unknown."""
        first -= SETTLED
        pose, joints = self._base.stood(first, last), self._stood(first, last)
        return None if pose is None or joints is None else (*pose, *joints)

    def is_told(self, first: float, last: float) -> bool:
        """Tell whether it is known how base and arm moved before and between two stamps.

        Before the robot knows where it is, nobody can say.
        """
        first -= SETTLED
        return not self._base.is_localised or (
            self._base.covers(first, last)
            and all(each.covers(first, last) for each in self._turning())
        )

    def passing(self, taken: float) -> Matrix | None:
        """Return where the camera was at a time on the way, (4, 4); None: nobody knows."""
        base, joints = self._base.passing(taken), self._stood(taken - SAME_TIME, taken)
        return None if base is None or joints is None else self.pose_of((*base, *joints))

    def pose_of(self, viewpoint: Viewpoint) -> Matrix | None:
        """Return where the arm holds the camera, (4, 4); None: there is no such arm."""
        if ARM.names not in self._joints:
            return None
        x, y, yaw, *joints = viewpoint
        return np.asarray(matrix_of((x, y, yaw)) @ ARM.camera_frame(joints), float)

    def bearing_of(self, viewpoint: Viewpoint) -> float | None:
        """Return where the camera looked to, map frame, rad; None: nobody knows."""
        pose = self.pose_of(viewpoint)
        if pose is not None:
            return math.atan2(pose[1, 2], pose[0, 2])
        # Without joints the camera looks ahead.
        return viewpoint[2] if len(viewpoint) == 3 else None

    def camera_at(self, viewpoint: Viewpoint) -> CameraAt | None:
        """Return where the camera is, and how sure that is; None: nobody says."""
        pose = self.pose_of(viewpoint)
        if pose is None or self.lens is None or (doubt := self._doubt()) is None:
            return None
        deviation, turn = map(max, doubt, LEAST_DOUBT)
        return CameraAt(pose, self.lens, deviation, turn)

    def _turning(self) -> list[StampedReadings]:
        """Return the joints that tell how the camera is held: those of the arm, if it is there."""
        if ARM.names in self._joints:
            return [self._joints[ARM.names]]
        return [readings for _, readings in sorted(self._joints.items())]

    def _stood(self, first: float, last: float) -> tuple[float, ...] | None:
        """Return where the joints stood between two stamps; None: they moved, or nobody knows."""
        found: list[float] = []
        for each in self._turning():
            if (values := each.stood(first, last)) is None:
                return None
            found += values
        return tuple(found)


def camera_joints(names: Sequence[str], positions: Sequence[float]) -> dict[str, float]:
    """Return the joints that may turn the camera, and where they are, rad.

    Those are the arm's where the message has them, else all but wheels: without its arm's names it
    is not known which joint carries the camera, but that no wheel does.

    Raises:
        ValueError: There are fewer positions than names, or one is not finite.
    """
    if not len(positions):
        return {}  # of speeds, or forces, alone
    if len(names) > MOST_JOINTS:
        raise ValueError(f'{len(names)} joints: expected at most {MOST_JOINTS}')
    if len(positions) < len(names):
        raise ValueError(f'{len(positions)} positions: expected one for each of {len(names)} names')
    told = dict(zip(names, map(float, positions), strict=False))
    if told.keys() >= set(ARM.names):
        told = {name: told[name] for name in ARM.names}
    else:
        told = {name: at for name, at in told.items() if not _WHEEL.search(name)}
    if not all(map(math.isfinite, told.values())):
        raise ValueError('a position that is not finite: expected finite numbers')
    return told


def matrix_of(pose: Pose) -> Matrix:
    """Return the transform (4, 4) from the frame of a pose in the plane."""
    x, y, yaw = pose
    cosine, sine = math.cos(yaw), math.sin(yaw)
    matrix = np.eye(4)
    matrix[:2, :2] = [[cosine, -sine], [sine, cosine]]
    matrix[:2, 3] = x, y
    return matrix
