"""Planning for `planner_controller` in SIMULATED mode: routes over doors, paths over the map."""

from __future__ import annotations

import numpy as np

from surveillance_controllers.geometry.polyline import Points
from surveillance_controllers.map_knowledge import MapKnowledge
from surveillance_controllers.motion.robot_parameters import door_segments, planning_parameters
from surveillance_controllers.planning.door_watch import DoorWatch
from surveillance_controllers.planning.grid_planning import NoPath
from surveillance_controllers.planning.map_planner import MapPlanner
from surveillance_controllers.planning.route_planning import NoRoute, route
from surveillance_runtime.action_server import GoalAbortedError, GoalRun
from surveillance_runtime.node import PatrolNode


class SimulatedPlanning:
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
        """Where the robot is, shape (3,), once there is a route over doors from there to a place.

        Raises:
            GoalAbortedError: There is no route.
            KnowledgeError: Map or ontology do not answer.
        """
        place = self._knowledge.robot_place(run.interrupt)
        positions = self._knowledge.places(run.interrupt)
        rooms_of = self._doors.rooms_of(run.interrupt)
        try:
            doors = route(rooms_of, self._doors.closed(rooms_of), place, target, positions)
        except NoRoute as error:
            raise GoalAbortedError(str(error)) from error
        self._node.get_logger().info(
            f'{place} to {target}: through {", ".join(doors) or "no door"}'
        )
        pose = self._map.pose
        return positions[place] if pose is None else np.array([pose[0], pose[1], 0.0])

    def path(self, start: Points, goal: Points, run: GoalRun, what: str) -> Points:
        """The path between two points, shape (n, 3).

        Raises:
            GoalAbortedError: There is none; the text says what blocks it.
        """
        try:
            return self._map.plan(start, goal, self._timeout, run.interrupt)
        except NoPath as error:
            raise GoalAbortedError(f'{what}: {error}') from error
