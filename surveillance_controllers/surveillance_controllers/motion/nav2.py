"""Motion for `motion_controller` by Nav2: a path becomes a NavigateThroughPoses goal.

Nav2 so goes the way that was planned here, through the doors that are open. (Its action FollowPath
has the name of this project's own, `follow_path`.) Nav2's messages come with Nav2; without them
this way to move cannot start and says so.
"""

from __future__ import annotations

import math
import threading
from collections.abc import Callable, Mapping
from itertools import pairwise
from typing import Any

import numpy as np
from geometry_msgs.msg import PoseStamped, PoseWithCovarianceStamped
from nav_msgs.msg import OccupancyGrid

from surveillance_controllers import conversions
from surveillance_controllers.controller_parameters import (
    MotionSettings,
    door_segments,
    place_positions,
)
from surveillance_controllers.geometry import Points, equally_spaced, length, point_of
from surveillance_controllers.map_knowledge import MapKnowledge
from surveillance_controllers.motion.arrival import MotionFailedError, expect_place
from surveillance_controllers.motion.place_recording import PlaceRecorder
from surveillance_controllers.motion.place_regions import PlaceMap
from surveillance_fsm.ros import CallError, CallInterruptedError, GoalCaller, GoalRun
from surveillance_runtime.conversions import pose_from, pose_message
from surveillance_runtime.node import PatrolNode
from surveillance_runtime.parameters import ParameterError
from surveillance_runtime.qos import STATE_QOS

SPACING = 1.5
"""The largest distance of the poses that Nav2 is led through, metres."""
MOST_POSES = 10_000
"""A path that would need more poses is led through poses farther apart."""


def navigate_through_poses() -> Any:
    """Nav2's action type.

    Raises:
        ParameterError: nav2_msgs is not installed.
    """
    try:
        from nav2_msgs.action import NavigateThroughPoses
    except ImportError:
        raise ParameterError(
            'parameter navigator: got nav2, but the Python package nav2_msgs is not installed: '
            'install ros-jazzy-nav2-msgs and source its workspace, or use navigator:=own'
        ) from None
    return NavigateThroughPoses


class Nav2Motion:
    """Has a running Nav2 drive the base.

    Args:
        node: The motion controller's node.
        knowledge: Map and ontology.
        recorder: Is told the place that the robot is in, by the topics `amcl_pose` and `map`.
        settings: How long Nav2 may take to appear and accept a goal.

    Raises:
        ParameterError: nav2_msgs is not installed.
    """

    def __init__(
        self,
        node: PatrolNode,
        knowledge: MapKnowledge,
        recorder: PlaceRecorder,
        settings: MotionSettings,
    ) -> None:
        self._node = node
        self._recorder = recorder
        self._type = navigate_through_poses()
        self._timeout = settings.peer_timeout
        self._navigator = GoalCaller(node, self._type, 'navigate_through_poses')
        self._lock = threading.Lock()
        self._places = PlaceMap(door_segments(node).values())
        self._point: Points | None = None
        positions = place_positions(node)
        self._places.set_positions(positions)
        knowledge.assume(positions)
        knowledge.follow_places(self._set_positions)
        node.create_subscription(OccupancyGrid, 'map', self._on_map, STATE_QOS)
        node.create_subscription(PoseWithCovarianceStamped, 'amcl_pose', self._on_pose, STATE_QOS)

    def follow(self, path: Points, run: GoalRun, report: Callable[[Points], None]) -> Points:
        """Send the robot along a path of shape (n, 3).

        Returns:
            Where the robot is then, by `amcl_pose`, else as Nav2 said last, shape (3,).

        Raises:
            MotionFailedError: It did not get there.
        """
        position: Points | None = None

        def on_feedback(feedback: Any) -> None:
            nonlocal position
            point = conversions.array_from_points([feedback.current_pose.pose.position])[0]
            if np.isfinite(point).all():
                position = point
                report(point)

        try:
            end = self._navigator.run(
                self._type.Goal(poses=self._poses(path)),
                accept_timeout=self._timeout,
                interrupt=run.interrupt,
                on_feedback=on_feedback,
            )
        except CallInterruptedError:
            # It was cancelled, which is no failure.
            return path[0] if position is None else position
        except CallError as error:
            raise MotionFailedError(str(error), position) from error
        if end.status != 'succeeded':
            raise MotionFailedError(f'Nav2 {end.status} the goal{reason_of(end.result)}', position)
        if self._point is not None:
            return self._point
        # Nobody tells amcl_pose.
        position = path[-1] if position is None else position
        self._tell(position)
        return position

    def _poses(self, path: Points) -> list[PoseStamped]:
        """Return the poses behind the start, each facing along the path."""
        points = equally_spaced(path, max(SPACING, length(path) / MOST_POSES))
        if len(points) == 1:
            points = np.vstack([path[-1], path[-1]])
        stamp = self._node.get_clock().now().to_msg()
        poses = []
        for before, at in pairwise(points):
            pose = PoseStamped()
            pose.header.frame_id, pose.header.stamp = 'map', stamp
            yaw = math.atan2(at[1] - before[1], at[0] - before[0])
            pose.pose = pose_message((float(at[0]), float(at[1]), yaw))
            poses.append(pose)
        return poses

    def _on_pose(self, message: PoseWithCovarianceStamped) -> None:
        with conversions.refusing(self._node, 'amcl_pose'):
            self._point = point_of(pose_from(message.pose.pose))
            self._tell(self._point)

    def _on_map(self, message: OccupancyGrid) -> None:
        with conversions.refusing(self._node, 'map'):
            grid = conversions.grid_from(message)
            with self._lock:
                self._places.set_map(grid)
            self._tell(self._point)

    def _set_positions(self, positions: Mapping[str, Points]) -> None:
        with self._lock:
            self._places.set_positions(positions)
        self._tell(self._point)

    def _tell(self, point: Points | None) -> None:
        """Tell the place that the robot is in; where it is in none, that stays as it was."""
        with self._lock:
            place = None if point is None else self._places.place_at(point)
        if place is not None:
            self._recorder.tell(place)

    def place_reached(self, goal: Points, end: Points, _run: GoalRun) -> str:
        """Return the place that the robot is in, which is at `end`, shape (3,).

        Raises:
            MotionFailedError: It is not in the goal's place.
        """
        with self._lock:
            place, wanted = self._places.place_at(end), self._places.place_at(goal)
        return expect_place(place, wanted, end)

    def look_around(self, _run: GoalRun) -> None:
        """Nothing: Nav2's own behaviours turn the robot where that is wanted."""


def reason_of(result: Any) -> str:
    """Return what Nav2 says of a goal that it did not reach, in brackets; empty: nothing."""
    code = getattr(result, 'error_code', 0)
    text = ' '.join(str(getattr(result, 'error_msg', '')).split())
    name = _error_name(result, code) if code else ''
    said = [f'error code {code}{name and " " + name}'] * bool(code) + [text] * bool(text)
    return f' ({", ".join(said)})' if said else ''


def _error_name(result: Any, code: int) -> str:
    """Return the constant of an error code; empty: none has it.

    A navigator hands on the codes of its planner and controller, too, which stand in the results
    of their own actions; each action of Nav2 numbers its errors in a range of its own.
    """
    from nav2_msgs import action

    kinds = [getattr(kind, 'Result', None) for _, kind in sorted(vars(action).items())]
    for kind in (type(result), *kinds):
        for name in dir(kind):
            if name.isupper() and '__' not in name and getattr(kind, name) == code:
                return name
    return ''
