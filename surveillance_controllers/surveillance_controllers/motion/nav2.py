"""Motion for `motion_controller` by Nav2, and docking by Nav2's docking server.

A path becomes a NavigateThroughPoses goal, so that Nav2 goes the way that was planned here, through
the doors that are open. (Its action FollowPath has the name of this project's own, `follow_path`.)
A path that only says where to turn (`spin_in_place`) becomes a Spin goal.
At the end of a way to the station a docking server (opennav_docking) may dock the robot, whoever
drove it there.

The messages of both come with Nav2, in nav2_msgs (Humble had opennav_docking_msgs); without them
neither can start, and says so.
"""

from __future__ import annotations

import math
import threading
from collections.abc import Callable, Mapping
from dataclasses import replace
from itertools import pairwise
from typing import Any

import numpy as np
from builtin_interfaces.msg import Duration
from geometry_msgs.msg import PoseStamped, PoseWithCovarianceStamped
from nav_msgs.msg import OccupancyGrid

from floor_plans.parameters import station_at, stations_in
from lidar_navigation import PlaceLocator
from lidar_navigation.geometry import (
    Points,
    angle_between,
    distance_nearest,
    equally_spaced,
    length,
    point_of,
    points_passed,
)
from state_machines import Interrupt
from state_machines.ros import CallError, CallInterruptedError, GoalCaller, GoalRun
from surveillance_controllers import conversions
from surveillance_controllers.controller_parameters import MotionSettings
from surveillance_controllers.map_knowledge import MapKnowledge
from surveillance_controllers.motion.arrival import BaseMotion, MotionFailedError, expect_place
from surveillance_controllers.motion.holding import Hold
from surveillance_controllers.motion.place_recording import PlaceRecorder
from surveillance_runtime.conversions import pose_from, pose_message, seconds_of
from surveillance_runtime.node import PatrolNode
from surveillance_runtime.parameters import ParameterError
from surveillance_runtime.place_changes import follow_place
from surveillance_runtime.place_parameters import door_segments, place_positions
from surveillance_runtime.profile.parameters import declared_frames
from surveillance_runtime.sensing.conversions import refusing
from surveillance_runtime.spin_in_place import bearing_of
from surveillance_runtime.state_topics import StateSubscription

SPACING = 1.5
"""The largest distance of the poses that Nav2 is led through, metres."""
SPIN_ALLOWANCE = Duration(sec=30)
"""So long a turn on the spot may take."""
MOST_POSES = 10_000
"""A path that would need more poses is led through poses farther apart."""


def nav2_actions(parameter: str, value: str, without: str, *names: str) -> list[Any]:
    """Return action types of Nav2 by their names.

    Args:
        parameter: Of the node, which asks for them,
        value: with this value.
        without: The value that does not need them.
        names: Of the types.

    Raises:
        ParameterError: nav2_msgs is not installed.
    """
    try:
        from nav2_msgs import action

        return [getattr(action, name) for name in names]
    except (ImportError, AttributeError):
        raise ParameterError(
            f'parameter {parameter}: got {value}, but the Python package nav2_msgs is not '
            'installed: install ros-jazzy-nav2-msgs and source its workspace, or use '
            f'{parameter}:={without}'
        ) from None


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
        self._type, self._spin = nav2_actions(
            'navigator', 'nav2', 'own', 'NavigateThroughPoses', 'Spin'
        )
        self._timeout = settings.peer_timeout
        self._frames = declared_frames(node, 'map')
        self._navigator = GoalCaller(node, self._type, 'navigate_through_poses')
        self._spinner = GoalCaller(node, self._spin, 'spin')
        self._hold = Hold(node)
        self._lock = threading.Lock()
        self._places = PlaceLocator(door_segments(node).values())
        self._point: Points | None = None
        self._yaw = math.nan
        positions = place_positions(node)
        self._places.set_positions(positions)
        knowledge.assume(positions)
        knowledge.follow_places(self._set_positions)
        StateSubscription(node, OccupancyGrid, 'map', self._on_map, owner='simulator')
        StateSubscription(
            node,
            PoseWithCovarianceStamped,
            'amcl_pose',
            self._on_pose,
            stamp=lambda told: seconds_of(told.header.stamp),
        )

    def follow(self, path: Points, run: GoalRun, report: Callable[[Points], None]) -> Points:
        """Send the robot along a path of shape (n, 3).

        Returns:
            Where the robot is then, by `amcl_pose`, else as Nav2 said last, shape (3,).

        Raises:
            MotionFailedError: It did not get there.
        """
        if (bearing := bearing_of(path.tolist())) is not None:
            return self._turn(bearing, path[0], run)
        position: Points | None = None

        def on_feedback(feedback: Any) -> None:
            nonlocal position
            point = conversions.array_from_points([feedback.current_pose.pose.position])[0]
            if np.isfinite(point).all():
                position = point
                report(point)

        while True:
            self._hold.await_end(run.interrupt)
            # A robot that is to stand has its goal cancelled, and gets what is left of it again.
            either = Interrupt()
            forget = run.interrupt.subscribe(either.set), self._hold.begun.subscribe(either.set)
            try:
                end = self._navigator.run(
                    self._type.Goal(poses=self._poses(path)),
                    accept_timeout=self._timeout,
                    interrupt=either,
                    on_feedback=on_feedback,
                )
                break
            except CallInterruptedError:
                if run.interrupt.is_set() or not either.is_set():
                    # It was cancelled, which is no failure.
                    return path[0] if position is None else position
                if position is not None:
                    path = rest_of(path, position)
            except CallError as error:
                raise MotionFailedError(str(error), position) from error
            finally:
                for each in forget:
                    each()
        if end.status != 'succeeded':
            raise MotionFailedError(f'Nav2 {end.status} the goal{reason_of(end.result)}', position)
        if self._point is not None:
            return self._point
        # Nobody tells amcl_pose.
        position = path[-1] if position is None else position
        self._tell(position)
        return position

    def _turn(self, bearing: float, at: Points, run: GoalRun) -> Points:
        """Turn on the spot, which Nav2 does by an angle; return where the robot is."""
        self._hold.await_end(run.interrupt)
        if not math.isfinite(self._yaw):
            raise MotionFailedError('amcl_pose: nobody tells where the robot points', at)
        goal = self._spin.Goal(
            target_yaw=angle_between(self._yaw, bearing), time_allowance=SPIN_ALLOWANCE
        )
        either = Interrupt()
        forget = run.interrupt.subscribe(either.set), self._hold.begun.subscribe(either.set)
        try:
            end = self._spinner.run(goal, accept_timeout=self._timeout, interrupt=either)
        except CallInterruptedError:
            if run.interrupt.is_set():
                return at
            raise MotionFailedError('the robot is to stand', at) from None
        except CallError as error:
            raise MotionFailedError(str(error), at) from error
        finally:
            for each in forget:
                each()
        if end.status != 'succeeded':
            raise MotionFailedError(f'Nav2 {end.status} the turn{reason_of(end.result)}', at)
        return at if self._point is None else self._point

    def _poses(self, path: Points) -> list[PoseStamped]:
        """Return the poses behind the start, each facing along the path."""
        points = equally_spaced(path, max(SPACING, length(path) / MOST_POSES))
        if len(points) == 1:
            points = np.vstack([path[-1], path[-1]])
        stamp = self._node.get_clock().now().to_msg()
        poses = []
        for before, at in pairwise(points):
            pose = PoseStamped()
            pose.header.frame_id, pose.header.stamp = self.map_frame, stamp
            yaw = math.atan2(at[1] - before[1], at[0] - before[0])
            pose.pose = pose_message((float(at[0]), float(at[1]), yaw))
            poses.append(pose)
        return poses

    def _on_pose(self, message: PoseWithCovarianceStamped) -> None:
        with refusing(self._node, 'amcl_pose'):
            pose = pose_from(message.pose.pose)
            self._point, self._yaw = point_of(pose), pose[2]
            self._tell(self._point)

    def _on_map(self, message: OccupancyGrid) -> None:
        with refusing(self._node, 'map'):
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

    def place_reached(self, goal: Points, end: Points) -> str:
        """Return the place that the robot is in, which is at `end`, shape (3,).

        Raises:
            MotionFailedError: It is not in the goal's place.
        """
        with self._lock:
            place, wanted = self._places.place_at(end), self._places.place_at(goal)
        return expect_place(place, wanted, end)

    @property
    def map_frame(self) -> str:
        """The name of the map's frame."""
        return self._frames.map

    def look_around(self, _run: GoalRun) -> None:
        """Nothing: Nav2's own behaviours turn the robot where that is wanted."""


def rest_of(path: Points, position: Points) -> Points:
    """Return what is left of a path from where the robot is, shape (n, 3), n of at least 2."""
    passed = points_passed(path, distance_nearest(path, position))
    return np.vstack([position, path[min(passed, len(path) - 1) :]])


class DockingMotion:
    """Moves as another motion does, and docks where a way ends at a station.

    Args:
        node: The motion controller's node.
        inner: Drives the robot.
        settings: The stations, how near to one a way must end, the dock's type, and how long the
            server may take to appear and accept a goal.

    Raises:
        ParameterError: nav2_msgs is not installed.
    """

    def __init__(self, node: PatrolNode, inner: BaseMotion, settings: MotionSettings) -> None:
        self._node = node
        self._inner = inner
        self._settings = settings
        actions = nav2_actions('docking', 'opennav', 'none', 'DockRobot', 'UndockRobot')
        self._dock, self._undock = actions
        self._docker = GoalCaller(node, self._dock, 'dock_robot')
        self._undocker = GoalCaller(node, self._undock, 'undock_robot')
        self._docked = False
        follow_place(node, self._take_place)

    def _take_place(self, described: Mapping[str, Any]) -> None:
        """Take the stations of a place that was changed."""
        self._settings = replace(self._settings, stations=stations_in(described))

    def follow(self, path: Points, run: GoalRun, report: Callable[[Points], None]) -> Points:
        """Undocks where that is needed, drives, and docks where the way ends at a station.

        Raises:
            MotionFailedError: One of the three failed.
        """
        if self._docked:
            self._docked = False
            goal = self._undock.Goal(dock_type=self._settings.dock_type)
            self._carry_out(self._undocker, goal, 'undocking', path[0], run)
        end = self._inner.follow(path, run, report)
        station = station_at((end[0], end[1]), self._settings.stations, self._settings.dock_reach)
        if station is None or run.interrupt.is_set():
            return end
        pose = PoseStamped()
        pose.header.frame_id = self.map_frame
        pose.header.stamp = self._node.get_clock().now().to_msg()
        pose.pose = pose_message(station.pose)
        goal = self._dock.Goal(
            use_dock_id=bool(station.dock),
            dock_id=station.dock,
            dock_pose=pose,
            dock_type=self._settings.dock_type,
            navigate_to_staging_pose=False,
        )
        self._carry_out(self._docker, goal, 'docking', end, run)
        self._docked = True
        return end

    def place_reached(self, goal: Points, end: Points) -> str:
        """As the motion that drives."""
        return self._inner.place_reached(goal, end)

    @property
    def map_frame(self) -> str:
        """As the motion that drives."""
        return self._inner.map_frame

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
