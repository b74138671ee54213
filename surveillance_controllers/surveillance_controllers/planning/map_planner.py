"""Paths for `planner_controller` in SIMULATED mode: a route over doors between two places, and the
way on the map, around closed doors and the obstacles that the robot has seen."""

from __future__ import annotations

import heapq
import math
import threading
from collections import defaultdict
from collections.abc import Collection, Iterable, Mapping
from itertools import combinations
from typing import Any

import numpy as np
from geometry_msgs.msg import PoseWithCovarianceStamped
from nav_msgs.msg import OccupancyGrid
from numpy.typing import ArrayLike, NDArray
from sensor_msgs.msg import PointCloud2

from floor_plans import Grid
from floor_plans.parameters import zones_from
from lidar_navigation import GridPlanner, NoPathError, PlanningParameters
from lidar_navigation.geometry import Points, Pose, point_of
from state_machines import Interrupt
from state_machines.ros import GoalAbortedError, GoalRun
from surveillance_controllers import conversions
from surveillance_controllers.map_knowledge import MapKnowledge
from surveillance_controllers.planning.door_watch import DoorWatch
from surveillance_runtime.conversions import (
    points_from_cloud,
    pose_of_serialized,
    stamp_of_serialized,
    values_from_cloud,
)
from surveillance_runtime.node import PatrolNode
from surveillance_runtime.place_changes import follow_place
from surveillance_runtime.place_parameters import door_segments, door_segments_of, place_zones
from surveillance_runtime.sensing.conversions import refusing
from surveillance_runtime.state_topics import StateSubscription


class NavigationPlanning:
    """Plans for one robot on the latest map.

    Args:
        node: The planner's node.
        knowledge: Map and ontology.
        peer_timeout: How long map and ontology may take, seconds of steady time.
    """

    def __init__(self, node: PatrolNode, knowledge: MapKnowledge, peer_timeout: float) -> None:
        self._node = node
        self._knowledge = knowledge
        self._timeout = peer_timeout
        self._parameters = node.declare_fields(
            PlanningParameters(), prefix='planning.', mode='SIMULATED and ROBOT'
        )
        self._segments = door_segments(node)
        self._zones = place_zones(node)
        self._doors = DoorWatch(node, self._segments, knowledge, peer_timeout)
        self._lock = threading.Lock()
        self._has_map = Interrupt()
        self._planner: GridPlanner | None = None
        self._grid: Grid | None = None
        self._obstacles: tuple[Points, NDArray[np.bool_] | None] = np.zeros((0, 2)), None
        self._pose: Pose | None = None
        StateSubscription(node, OccupancyGrid, 'map', self._on_map, owner='simulator')
        follow_place(node, self._take_place)
        owner = 'motion_controller'
        StateSubscription(node, PointCloud2, 'obstacles', self._on_obstacles, owner=owner)
        StateSubscription(
            node,
            PoseWithCovarianceStamped,
            'amcl_pose',
            self._on_pose,
            raw=True,
            stamp=stamp_of_serialized,
            owner=owner,
        )

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
        return positions[place] if self._pose is None else point_of(self._pose)

    def path(self, start: Points, goal: Points, run: GoalRun, what: str) -> Points:
        """Return the path between two points of shape (3,); waits for the first map.

        Returns:
            Shape (n, 3); the height goes evenly from the start's to the goal's.

        Raises:
            GoalAbortedError: There is none; the text says what blocks it.
        """
        unsubscribe = run.interrupt.subscribe(self._has_map.set)
        self._has_map.wait(self._timeout)
        unsubscribe()
        if self._planner is None:
            self._has_map.clear()
            raise GoalAbortedError(
                f'{what}: no map came on the topic map within {self._timeout:g} s'
            )
        closed = self._doors.closed_segments(run.interrupt)
        with self._lock:
            self._planner.set_closed(closed)
            self._planner.set_obstacles(*self._obstacles)
            try:
                path = self._planner.plan(start, goal)
            except NoPathError as error:
                raise GoalAbortedError(f'{what}: {error}') from error
        return np.column_stack([path, np.linspace(start[2], goal[2], len(path))])

    def _on_map(self, message: OccupancyGrid) -> None:
        with refusing(self._node, 'map'):
            grid = conversions.grid_from(message)
            self._grid = grid
            self._plan_anew()

    def _plan_anew(self) -> None:
        assert self._grid is not None
        planner = GridPlanner(self._grid, self._parameters, self._segments, self._zones)
        with self._lock:
            self._planner = planner
        self._has_map.set()

    def _take_place(self, described: Mapping[str, Any]) -> None:
        self._segments, self._zones = door_segments_of(described), zones_from(described)
        self._doors.take_segments(self._segments)
        if self._grid is not None:
            self._plan_anew()

    def _on_obstacles(self, message: PointCloud2) -> None:
        with refusing(self._node, 'obstacles'):
            stays = values_from_cloud(message, 'stays')
            self._obstacles = points_from_cloud(message), None if stays is None else stays > 0

    def _on_pose(self, serialized: bytes) -> None:
        with refusing(self._node, 'amcl_pose'):
            self._pose = pose_of_serialized(serialized)


def route(
    rooms_of: Mapping[str, Collection[str]],
    closed: Collection[str],
    start: str,
    goal: str,
    positions: Mapping[str, ArrayLike],
) -> list[str]:
    """Return the doors to go through by the shortest way, in order; none when start and goal are
    one place.

    Places are the nodes of a graph; a door that leads into two places joins them, unless it is
    closed.

    Args:
        rooms_of: The places that each door leads into.
        closed: Doors that are closed.
        start: A place.
        goal: A place.
        positions: A point in each place, metres; the way through a place is measured by them.

    Raises:
        NoPathError: No open doors lead there; the text names the closed doors that would.
    """

    def doors_through(doors: Iterable[str]) -> list[str] | None:
        ways: defaultdict[str, list[tuple[float, str, str]]] = defaultdict(list)
        for door in sorted(doors):
            for first, second in combinations(sorted(rooms_of[door]), 2):
                at = [
                    np.asarray(positions[place], float)[:2]
                    for place in (first, second)
                    if place in positions
                ]
                length = math.dist(*at) if len(at) == 2 else 1.0
                ways[first].append((length, door, second))
                ways[second].append((length, door, first))
        # Dijkstra's shortest way; of two as long that through fewer doors.
        pending: list[tuple[float, int, str, list[str]]] = [(0.0, 0, start, [])]
        done: set[str] = set()
        while pending:
            metres, count, place, passed = heapq.heappop(pending)
            if place == goal:
                return passed
            if place not in done:
                done.add(place)
                for length, door, other in ways[place]:
                    way = (metres + length, count + 1, other, [*passed, door])
                    heapq.heappush(pending, way)
        return None

    doors = doors_through(door for door in rooms_of if door not in closed)
    if doors is not None:
        return doors
    shut = [door for door in doors_through(rooms_of) or () if door in closed]
    if not shut:
        raise NoPathError(f'no route from {start} to {goal}: no doors lead there')
    which = f'doors {", ".join(shut)} are' if len(shut) > 1 else f'door {shut[0]} is'
    raise NoPathError(f'no route from {start} to {goal}: the {which} closed')
