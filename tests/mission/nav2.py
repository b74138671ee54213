"""A small Nav2: a map server, a localiser, and a navigator that answers goals by script."""

from __future__ import annotations

import threading
from pathlib import Path
from typing import Any

import numpy as np
from geometry_msgs.msg import PoseStamped, PoseWithCovarianceStamped
from nav_msgs.msg import OccupancyGrid

from floor_plans import read_place
from lidar_navigation.geometry import equally_spaced
from state_machines.ros import GoalAbortedError, GoalRun, GoalServer
from surveillance_runtime.conversions import map_message, pose_estimate, pose_from, pose_message
from surveillance_runtime.node import PatrolNode
from surveillance_runtime.qos import STATE_QOS

SPEED = 0.5
"""Of the robot, m/s."""
STEP = 0.25
"""How far it moves from one pose to the next that is told, metres."""
REJECT, DIE = 'reject', 'die'


class MapServer(PatrolNode):
    """Serves the map of a place's file, latched, as Nav2's map server does."""

    def __init__(self, place: Path, **options: Any) -> None:
        super().__init__('map_server', **options)
        plan = read_place(place).plan
        assert plan is not None
        grid = plan.grid()
        topic = self.create_publisher(OccupancyGrid, 'map', STATE_QOS)
        topic.publish(map_message(grid, 'map', self.get_clock().now().to_msg()))


class Navigator(PatrolNode):
    """Serves `navigate_through_poses`, and tells `amcl_pose`, latched, where the robot is.

    As Nav2's, it is at its goal when it is near it, aborts with the error code of its planner or
    controller, and tells in its feedback where the robot is.

    Args:
        actions: The module `nav2_msgs.action`.
        at: Where the robot is, x and y in metres.

    Attributes:
        script: How the next goals go: `REJECT`, `DIE` halfway, or an error code to abort halfway
            with; each goal after the last one succeeds.
        at: Where the robot is.
        driven: The points that the robot came through, metres.
        died: Set when the navigator stands still in the middle of a goal, to be taken away.
        released: To be set once it was.
    """

    def __init__(self, actions: Any, at: tuple[float, float], **options: Any) -> None:
        super().__init__('bt_navigator', **options)
        self._type = actions.NavigateThroughPoses
        self.at = at
        self.script: list[str | int] = []
        self.driven: list[tuple[float, float]] = [at]
        self.died, self.released = threading.Event(), threading.Event()
        self._poses = self.create_publisher(PoseWithCovarianceStamped, 'amcl_pose', STATE_QOS)
        self._tell((*at, 0.0))
        GoalServer(self, self._type, 'navigate_through_poses', self._navigate, self._accepts)

    def _accepts(self, _goal: Any) -> bool:
        if self.script and self.script[0] == REJECT:
            self.script.pop(0)
            return False
        return True

    def _navigate(self, goal: Any, run: GoalRun) -> Any:
        turn = self.script.pop(0) if self.script else 0
        poses = [pose_from(stamped.pose) for stamped in goal.poses]
        assert all(stamped.header.frame_id == 'map' for stamped in goal.poses)
        for number, pose in enumerate(poses):
            if turn and number >= len(poses) // 2:
                if turn == DIE:
                    self.died.set()
                    self.released.wait(60.0)
                    break
                text = f'broke off at pose {number}'
                result = self._type.Result(error_code=turn, error_msg=text)
                raise GoalAbortedError(text, result)
            for at in equally_spaced(np.array([(*self.at, 0.0), (*pose[:2], 0.0)]), STEP)[1:]:
                if not run.sleep(STEP / SPEED):
                    return self._type.Result()
                self._come_to((float(at[0]), float(at[1]), pose[2]))
                here = PoseStamped(pose=pose_message((*self.at, pose[2])))
                run.feedback(self._type.Feedback(current_pose=here))
        return self._type.Result()

    def _come_to(self, pose: tuple[float, float, float]) -> None:
        self.at = pose[:2]
        self.driven.append(self.at)
        self._tell(pose)

    def _tell(self, pose: tuple[float, float, float]) -> None:
        message = PoseWithCovarianceStamped(pose=pose_estimate(pose, 0.1, 0.1))
        message.header.frame_id = 'map'
        message.header.stamp = self.get_clock().now().to_msg()
        self._poses.publish(message)
