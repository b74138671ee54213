"""Paths for `planner_controller` in SIMULATED mode, over the map, doors and obstacles it hears
of."""

from __future__ import annotations

import threading
from collections.abc import Callable
from typing import Any

import numpy as np
from geometry_msgs.msg import PoseWithCovarianceStamped
from nav_msgs.msg import OccupancyGrid
from sensor_msgs.msg import PointCloud2

from surveillance_controllers import conversions
from surveillance_controllers.geometry.polyline import Points
from surveillance_controllers.geometry.poses import Pose
from surveillance_controllers.planning.door_watch import DoorWatch
from surveillance_controllers.planning.grid_planning import GridPlanner, NoPath, PlanningParameters
from surveillance_runtime.conversions import points_from_cloud
from surveillance_runtime.node import PatrolNode
from surveillance_runtime.qos import STATE_QOS
from surveillance_runtime.waiting import Interrupt


class MapPlanner:
    """Plans on the latest map.

    Args:
        node: The planner's node.
        parameters: The robot's size and habits.
        doors: Which doors there are, and which are closed.
    """

    def __init__(self, node: PatrolNode, parameters: PlanningParameters, doors: DoorWatch) -> None:
        self._node = node
        self._parameters = parameters
        self._doors = doors
        self._lock = threading.Lock()
        self._has_map = Interrupt()
        self._planner: GridPlanner | None = None
        self._obstacles: Points = np.zeros((0, 2))
        self._pose: Pose | None = None
        node.create_subscription(OccupancyGrid, 'map', self._on_map, STATE_QOS)
        node.create_subscription(PointCloud2, 'obstacles', self._on_obstacles, STATE_QOS)
        node.create_subscription(PoseWithCovarianceStamped, 'amcl_pose', self._on_pose, STATE_QOS)

    @property
    def pose(self) -> Pose | None:
        """Where the robot is, as the motion controller says; None until it does."""
        return self._pose

    def plan(self, start: Points, goal: Points, timeout: float, interrupt: Interrupt) -> Points:
        """Finds the path between two points, shape (3,) each, metres.

        Args:
            start: Where it begins.
            goal: Where it ends.
            timeout: How long to wait for the first map, seconds of steady time.
            interrupt: Ends that wait.

        Returns:
            The path, shape (n, 3); its height goes evenly from the start's to the goal's.

        Raises:
            NoPath: There is none, or no map; the text says why.
        """
        unsubscribe = interrupt.subscribe(self._has_map.set)
        self._has_map.wait(timeout)
        unsubscribe()
        if self._planner is None:
            self._has_map.clear()
            raise NoPath(f'no map came on the topic map within {timeout:g} s')
        closed = self._doors.closed_segments(interrupt)
        with self._lock:
            self._planner.set_closed(closed)
            self._planner.set_obstacles(self._obstacles)
            path = self._planner.plan(start, goal)
        heights = np.linspace(start[2], goal[2], len(path))
        return np.column_stack([path, heights])

    def _on_map(self, message: OccupancyGrid) -> None:
        self._replace(lambda: GridPlanner(conversions.grid_from(message), self._parameters), 'map')

    def _on_obstacles(self, message: PointCloud2) -> None:
        try:
            self._obstacles = points_from_cloud(message)
        except ValueError as error:
            self._node.get_logger().error(f'obstacles: {error}')

    def _on_pose(self, message: PoseWithCovarianceStamped) -> None:
        try:
            self._pose = conversions.pose_from(message.pose.pose)
        except ValueError as error:
            self._node.get_logger().error(f'amcl_pose: {error}')

    def _replace(self, make: Callable[[], Any], topic: str) -> None:
        try:
            planner = make()
        except ValueError as error:
            self._node.get_logger().error(f'{topic}: {error}')
            return
        with self._lock:
            self._planner = planner
        self._has_map.set()
