"""Motion for `motion_controller` by Nav2: the last point of a path becomes a NavigateToPose goal.

Nav2's messages come with Nav2; without them this way to move cannot start and says so.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any

import numpy as np
from geometry_msgs.msg import PoseStamped

from surveillance_controllers import conversions
from surveillance_controllers.controller_parameters import MotionSettings
from surveillance_controllers.geometry import Points
from surveillance_controllers.map_knowledge import MapKnowledge
from surveillance_controllers.motion.arrival import MotionFailedError, place_reached
from surveillance_runtime.action_server import GoalRun
from surveillance_runtime.calls import CallError, GoalCaller
from surveillance_runtime.node import PatrolNode, StartError


def navigate_to_pose() -> Any:
    """Nav2's action type.

    Raises:
        StartError: nav2_msgs is not installed.
    """
    try:
        from nav2_msgs.action import NavigateToPose
    except ImportError:
        raise StartError(
            'parameter navigator: got nav2, but the Python package nav2_msgs is not installed: '
            'install ros-jazzy-nav2-msgs and source its workspace, or use navigator:=own'
        ) from None
    return NavigateToPose


class Nav2Motion:
    """Has a running Nav2 drive the base.

    Args:
        node: The motion controller's node.
        knowledge: Map and ontology.
        settings: How long Nav2 may take to appear and accept a goal, and how near a place is.

    Raises:
        StartError: nav2_msgs is not installed.
    """

    def __init__(self, node: PatrolNode, knowledge: MapKnowledge, settings: MotionSettings) -> None:
        self._node = node
        self._knowledge = knowledge
        self._place_reach = settings.place_reach
        self._type = navigate_to_pose()
        self._timeout = settings.peer_timeout
        self._navigator = GoalCaller(node, self._type, 'navigate_to_pose')

    def follow(self, path: Points, run: GoalRun, report: Callable[[Points], None]) -> Points:
        """Sends the robot to the end of a path of shape (n, 3); Nav2 finds its own way there.

        Returns:
            Where the robot is then, as Nav2 said last, shape (3,).

        Raises:
            MotionFailedError: It did not get there.
        """
        goal = PoseStamped()
        goal.header.frame_id = 'map'
        goal.header.stamp = self._node.get_clock().now().to_msg()
        way = path[-1] - path[-2] if len(path) > 1 else np.array([1.0, 0.0, 0.0])
        goal.pose = conversions.pose_message(
            (float(path[-1][0]), float(path[-1][1]), math.atan2(way[1], way[0]))
        )
        position: Points | None = None

        def on_feedback(feedback: Any) -> None:
            nonlocal position
            position = conversions.array_from_points([feedback.current_pose.pose.position])[0]
            report(position)

        try:
            end = self._navigator.run(
                self._type.Goal(pose=goal),
                accept_timeout=self._timeout,
                interrupt=run.interrupt,
                on_feedback=on_feedback,
            )
        except CallError as error:
            raise MotionFailedError(str(error), position) from error
        if end.status != 'succeeded':
            raise MotionFailedError(f'Nav2 {end.status} the goal', position)
        return path[-1] if position is None else position

    def place_reached(self, _goal: Points, end: Points, run: GoalRun) -> str:
        """The place nearest to where the robot is, shape (3,).

        Raises:
            MotionFailedError: No place is within reach.
            KnowledgeError: Map or ontology do not answer.
        """
        return place_reached(self._knowledge.places(run.interrupt), end, self._place_reach)

    def look_around(self, _run: GoalRun) -> None:
        """Nothing: Nav2's own behaviours turn the robot where that is wanted."""
