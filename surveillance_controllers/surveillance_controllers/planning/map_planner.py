"""Paths for `planner_controller` in SIMULATED mode, over the map, doors and obstacles it hears
of."""

from __future__ import annotations

import threading

import numpy as np
from geometry_msgs.msg import PoseWithCovarianceStamped
from nav_msgs.msg import OccupancyGrid
from sensor_msgs.msg import PointCloud2

from surveillance_controllers import conversions
from surveillance_controllers.geometry import Points, Pose
from surveillance_controllers.map_knowledge import MapKnowledge
from surveillance_controllers.motion.robot_parameters import door_segments, planning_parameters
from surveillance_controllers.planning.door_watch import DoorWatch
from surveillance_controllers.planning.grid_planning import (
    GridPlanner,
    NoPathError,
    PlanningParameters,
)
from surveillance_controllers.planning.route_planning import route
from surveillance_fsm import Interrupt
from surveillance_fsm.ros import GoalAbortedError, GoalRun
from surveillance_runtime.conversions import points_from_cloud
from surveillance_runtime.node import PatrolNode
from surveillance_runtime.qos import STATE_QOS


class MapPlanner:
    """Plans on the latest map.

    Args:
        node: The planner's node.
        parameters: The robot's size, margins and costs.
        doors: Which doors there are, and which are closed.

    Attributes:
        pose: Where the robot is, as the motion controller says; None until it does.
    """

    def __init__(self, node: PatrolNode, parameters: PlanningParameters, doors: DoorWatch) -> None:
        self._node = node
        self._parameters = parameters
        self._doors = doors
        self._lock = threading.Lock()
        self._has_map = Interrupt()
        self._planner: GridPlanner | None = None
        self._obstacles: Points = np.zeros((0, 2))
        self.pose: Pose | None = None
        node.create_subscription(OccupancyGrid, 'map', self._on_map, STATE_QOS)
        node.create_subscription(PointCloud2, 'obstacles', self._on_obstacles, STATE_QOS)
        node.create_subscription(PoseWithCovarianceStamped, 'amcl_pose', self._on_pose, STATE_QOS)

    def plan(self, start: Points, goal: Points, timeout: float, interrupt: Interrupt) -> Points:
        """Find the path between two points, shape (3,) each, metres.

        Args:
            start: Where it begins.
            goal: Where it ends.
            timeout: How long to wait for the first map, seconds of steady time.
            interrupt: Ends that wait.

        Returns:
            The path, shape (n, 3); its height goes evenly from the start's to the goal's.

        Raises:
            NoPathError: There is none, or no map; the text says why.
        """
        unsubscribe = interrupt.subscribe(self._has_map.set)
        self._has_map.wait(timeout)
        unsubscribe()
        if self._planner is None:
            self._has_map.clear()
            raise NoPathError(f'no map came on the topic map within {timeout:g} s')
        closed = self._doors.closed_segments(interrupt)
        with self._lock:
            self._planner.set_closed(closed)
            self._planner.set_obstacles(self._obstacles)
            path = self._planner.plan(start, goal)
        heights = np.linspace(start[2], goal[2], len(path))
        return np.column_stack([path, heights])

    def _on_map(self, message: OccupancyGrid) -> None:
        try:
            planner = GridPlanner(conversions.grid_from(message), self._parameters)
        except ValueError as error:
            self._node.get_logger().error(f'map: {error}')
            return
        with self._lock:
            self._planner = planner
        self._has_map.set()

    def _on_obstacles(self, message: PointCloud2) -> None:
        try:
            self._obstacles = points_from_cloud(message)
        except ValueError as error:
            self._node.get_logger().error(f'obstacles: {error}')

    def _on_pose(self, message: PoseWithCovarianceStamped) -> None:
        try:
            self.pose = conversions.pose_from(message.pose.pose)
        except ValueError as error:
            self._node.get_logger().error(f'amcl_pose: {error}')


class NavigationPlanning:
    """Plans for one robot.

    Args:
        node: The planner's node.
        knowledge: Map and ontology.
        peer_timeout: How long map and ontology may take, seconds of steady time.
    """

    def __init__(self, node: PatrolNode, knowledge: MapKnowledge, peer_timeout: float) -> None:
        self._node = node
        self._knowledge = knowledge
        self._timeout = peer_timeout
        self._doors = DoorWatch(node, door_segments(node), knowledge, peer_timeout)
        self._map = MapPlanner(node, planning_parameters(node), self._doors)

    def start(self, target: str, run: GoalRun) -> Points:
        """Return where the robot is, shape (3,), once there is a route over doors from there to a
        place.

        Raises:
            GoalAbortedError: There is no route.
            OntologyNotReadyError: Map or ontology do not answer.
        """
        place = self._knowledge.robot_place(run.interrupt)
        positions = self._knowledge.places(run.interrupt)
        rooms_of = self._doors.rooms_of(run.interrupt)
        try:
            doors = route(rooms_of, self._doors.closed(rooms_of), place, target, positions)
        except NoPathError as error:
            raise GoalAbortedError(str(error)) from error
        self._node.get_logger().info(
            f'{place} to {target}: through {", ".join(doors) or "no door"}'
        )
        pose = self._map.pose
        return positions[place] if pose is None else np.array([pose[0], pose[1], 0.0])

    def path(self, start: Points, goal: Points, run: GoalRun, what: str) -> Points:
        """Return the path between two points, shape (n, 3).

        Raises:
            GoalAbortedError: There is none; the text says what blocks it.
        """
        try:
            return self._map.plan(start, goal, self._timeout, run.interrupt)
        except NoPathError as error:
            raise GoalAbortedError(f'{what}: {error}') from error
