"""Docking by a docking server (opennav_docking) at the end of a way to the station.

In Jazzy the server's messages stand in nav2_msgs (Humble had opennav_docking_msgs); without them
docking cannot start and says so.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any

from geometry_msgs.msg import PoseStamped

from surveillance_controllers.controller_parameters import MotionSettings
from surveillance_controllers.geometry import Points
from surveillance_controllers.motion.arrival import Motion, MotionFailedError
from surveillance_controllers.motion.nav2 import reason_of
from surveillance_fsm.ros import CallError, GoalCaller, GoalRun
from surveillance_runtime.conversions import pose_message
from surveillance_runtime.node import PatrolNode
from surveillance_runtime.parameters import ParameterError


def docking_actions() -> tuple[Any, Any]:
    """Return the docking server's action types, to dock and to undock.

    Raises:
        ParameterError: nav2_msgs is not installed.
    """
    try:
        from nav2_msgs.action import DockRobot, UndockRobot
    except ImportError:
        raise ParameterError(
            'parameter docking: got opennav, but the Python package nav2_msgs is not installed: '
            'install ros-jazzy-nav2-msgs and source its workspace, or use docking:=none'
        ) from None
    return DockRobot, UndockRobot


class DockingMotion:
    """Moves as another motion does, and docks where a way ends at the station.

    Args:
        node: The motion controller's node.
        inner: Drives the robot.
        settings: The station, how near to it a way must end, the dock's type, and how long the
            server may take to appear and accept a goal.

    Raises:
        ParameterError: nav2_msgs is not installed.
    """

    def __init__(self, node: PatrolNode, inner: Motion, settings: MotionSettings) -> None:
        self._node = node
        self._inner = inner
        self._settings = settings
        self._dock, self._undock = docking_actions()
        self._docker = GoalCaller(node, self._dock, 'dock_robot')
        self._undocker = GoalCaller(node, self._undock, 'undock_robot')
        self._docked = False

    def follow(self, path: Points, run: GoalRun, report: Callable[[Points], None]) -> Points:
        """Undocks where that is needed, drives, and docks where the way ends at the station.

        Raises:
            MotionFailedError: One of the three failed.
        """
        if self._docked:
            self._docked = False
            goal = self._undock.Goal(dock_type=self._settings.dock_type)
            self._carry_out(self._undocker, goal, 'undocking', path[0], run)
        end = self._inner.follow(path, run, report)
        if (
            math.dist(end[:2], self._settings.station[:2]) > self._settings.dock_reach
            or run.interrupt.is_set()
        ):
            return end
        pose = PoseStamped()
        pose.header.frame_id = 'map'
        pose.header.stamp = self._node.get_clock().now().to_msg()
        pose.pose = pose_message(self._settings.station)
        goal = self._dock.Goal(
            use_dock_id=False,
            dock_pose=pose,
            dock_type=self._settings.dock_type,
            navigate_to_staging_pose=False,
        )
        self._carry_out(self._docker, goal, 'docking', end, run)
        self._docked = True
        return end

    def place_reached(self, goal: Points, end: Points, run: GoalRun) -> str:
        """As the motion that drives."""
        return self._inner.place_reached(goal, end, run)

    def look_around(self, run: GoalRun) -> None:
        """As the motion that drives; a docked robot stays as it is."""
        if not self._docked:
            self._inner.look_around(run)

    def _carry_out(
        self, caller: GoalCaller, goal: Any, what: str, at: Points, run: GoalRun
    ) -> None:
        try:
            end = caller.run(
                goal, accept_timeout=self._settings.peer_timeout, interrupt=run.interrupt
            )
        except CallError as error:
            raise MotionFailedError(f'{what}: {error}', at) from error
        if end.status != 'succeeded' or not end.result.success:
            why = reason_of(end.result)
            raise MotionFailedError(f'{what}: the docking server {end.status} the goal{why}', at)
