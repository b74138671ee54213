"""Docking by Nav2's docking server (opennav_docking), whoever drives the robot.

A robot that stands in a dock undocks before it drives, also one that was docked when the patrol
began; success alone counts. On the way to a station it is driven to the dock's staging pose, by the
server or by whoever drives the robot else, and the server docks it. What fails is tried again as
far as its error code lets hope, then a person is told, and the robot stays where it is.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import replace
from typing import Any

import numpy as np
from geometry_msgs.msg import PoseStamped
from sensor_msgs.msg import BatteryState

from floor_plans import Station
from floor_plans.parameters import station_at, stations_in
from lidar_navigation.geometry import Points, Pose
from state_machines.ros import GoalRun
from surveillance_controllers.controller_parameters import MotionSettings
from surveillance_controllers.motion.arrival import BaseMotion, MotionFailedError
from surveillance_controllers.motion.dock_contact import (
    NO_RETRY,
    NOT_MOVED_IN,
    WHAT_HELPS,
    Contact,
    DockMemory,
    stands_at,
)
from surveillance_controllers.motion.holding import Hold
from surveillance_controllers.motion.nav2_goals import Nav2Goals, nav2_actions, reason_of
from surveillance_runtime.conversions import pose_message
from surveillance_runtime.incidents import Severity
from surveillance_runtime.node import PatrolNode
from surveillance_runtime.place_changes import follow_place
from surveillance_runtime.qos import SENSOR_QOS
from surveillance_runtime.spin_in_place import bearing_of, spin_path
from surveillance_runtime.state_topics import StateSubscription

TRIES = 3
"""So often each of both is asked for before a person is told."""
PAUSE = 5.0
"""Time between two tries, seconds; each next one is twice as long."""
DEFAULT_STAGING = 0.7
"""Where nobody says how far before its dock a robot is staged, metres: as opennav_docking's simple
charging dock has it."""
SERVER_DRIVES = 2.0
"""So far before the dock the way of this project ends where the server drives to its staging pose,
metres: it plans from there by Nav2."""


class DockingMotion:
    """Moves as another motion does, and docks where a way ends at a station.

    Args:
        node: The motion controller's node.
        inner: Drives the robot.
        settings: The stations, how near to one a way must end, the dock's type and staging
            distance, and how long the server may take to appear and accept a goal.

    Raises:
        ParameterError: nav2_msgs is not installed.
    """

    def __init__(self, node: PatrolNode, inner: BaseMotion, settings: MotionSettings) -> None:
        self._node = node
        self._inner = inner
        self._settings = settings
        actions = nav2_actions('docking', 'opennav', 'none', 'DockRobot', 'UndockRobot')
        self._dock, self._undock = actions
        hold, servers, wait = inner.hold, ('docking_server',), settings.peer_timeout
        self._docker = Nav2Goals(node, hold, self._dock, 'dock_robot', servers, wait)
        self._undocker = Nav2Goals(node, hold, self._undock, 'undock_robot', servers, wait)
        self._memory = DockMemory()
        self._charging: bool | None = None
        follow_place(node, self._take_place)
        StateSubscription(
            node, BatteryState, 'battery_state', self._on_battery, each=True, qos=SENSOR_QOS
        )

    def _take_place(self, described: Mapping[str, Any]) -> None:
        """Take the stations of a place that was changed."""
        self._settings = replace(self._settings, stations=stations_in(described))

    def _on_battery(self, message: BatteryState) -> None:
        # `FULL` is no sign: some drivers say it of any full battery.
        status = message.power_supply_status
        known = status != BatteryState.POWER_SUPPLY_STATUS_UNKNOWN
        self._charging = status == BatteryState.POWER_SUPPLY_STATUS_CHARGING if known else None

    def follow(self, path: Points, run: GoalRun, report: Callable[[Points], None]) -> Points:
        """Undocks where that is needed, drives, and docks where the way ends at a station.

        Raises:
            MotionFailedError: One of the three failed.
        """
        last = (float(path[-1][0]), float(path[-1][1]))
        station = station_at(last, self._settings.stations, self._settings.dock_reach)
        if bearing_of(path.tolist()) is not None:
            station = None
        contact = self.contact()
        if station is not None and contact is Contact.DOCKED and self._is_in(station):
            return np.asarray(path[-1])
        if contact is not Contact.FREE and not self._leave(path[0], run):
            return np.asarray(path[0])
        if station is None:
            return self._inner.follow(path, run, report)
        end = self._stage(station, path, run, report)
        if run.interrupt.is_set():
            return end
        return path[-1] if self._enter(station, end, run) else end

    def contact(self) -> Contact:
        """Return whether the robot stands in a dock."""
        pose = self.pose
        near = None
        if pose is not None:
            near = any(self._is_near(station, pose) for station in self._settings.stations.values())
        return self._memory.look(self._charging, near)

    def _is_near(self, station: Station, pose: Pose) -> bool:
        return stands_at(pose, station.pose, self._settings.dock_reach)

    def _is_in(self, station: Station) -> bool:
        pose = self.pose
        return pose is not None and self._is_near(station, pose)

    def _leave(self, at: Points, run: GoalRun) -> bool:
        """Undock; False: interrupted.

        Raises:
            MotionFailedError: It could not; the robot stands in its dock.
        """
        goal = self._undock.Goal(dock_type=self._settings.dock_type)
        made_known = False
        for number in range(TRIES):
            end = self._undocker.send(lambda: goal, run)
            if end is None:
                return False
            code = int(getattr(end.result, 'error_code', 0))
            if end.status == 'succeeded' and end.result.success:
                self._free('the robot has left the dock')
                return True
            why = f'undocking: the docking server {end.status} the goal{reason_of(end.result)}'
            # Jazzy's server aborts without an error code where it does not know of a dock.
            if end.status == 'aborted' and not code:
                why = 'undocking: the docking server does not know that the robot is in a dock'
                if not made_known and self._make_known(run):
                    made_known = True
                    continue
                if not self._charging:
                    self._free('the docking server says that the robot is in no dock')
                    return not run.interrupt.is_set()
            if code in NO_RETRY or number == TRIES - 1:
                break
            self._node.get_logger().warn(f'{why}; trying again')
            if not run.sleep(PAUSE * 2**number):
                return False
        raise self._failed(why, code, at)

    def _free(self, text: str) -> None:
        self._memory.told = False
        self._is_over(text)

    def _make_known(self, run: GoalRun) -> bool:
        """Have the server learn of the dock that the robot stands in; tell whether it did.

        It was started since, and knows of no dock. A goal for this one, from where the robot
        stands, succeeds at once where the robot is in it.
        """
        pose = self.pose
        if pose is None:
            return False
        near = station_at(pose[:2], self._settings.stations, self._settings.dock_reach)
        if near is None:
            return False
        end = self._docker.send(lambda: self._goal(near, stages=False), run)
        return end is not None and end.status == 'succeeded' and bool(end.result.success)

    @property
    def _staging(self) -> float:
        """How far before the dock this project drives; 0: the server drives by itself."""
        given = self._settings.dock_staging
        return given or (DEFAULT_STAGING if self._settings.navigator == 'own' else 0.0)

    def _stage(
        self, station: Station, path: Points, run: GoalRun, report: Callable[[Points], None]
    ) -> Points:
        """Drive to where docking begins; return where the robot is then."""
        staging = self._staging
        way = without_end(path, staging or SERVER_DRIVES)
        if not staging:
            # From near by the server plans alone.
            return self._inner.follow(way, run, report) if len(way) > 1 else path[0]
        x, y, yaw = station.pose
        before = np.array([x - staging * math.cos(yaw), y - staging * math.sin(yaw), 0.0])
        end = self._inner.follow(np.vstack([way, before]), run, report)
        if run.interrupt.is_set():
            return end
        return self._inner.follow(np.array(spin_path((end[0], end[1]), yaw)), run, report)

    def _enter(self, station: Station, at: Points, run: GoalRun) -> bool:
        """Dock; False: interrupted.

        Raises:
            MotionFailedError: It could not.
        """
        state = 0

        def on_feedback(feedback: Any) -> None:
            nonlocal state
            state = int(feedback.state)

        why, code = '', 0
        for number in range(TRIES):
            # From now on it may come into the dock, whatever the server says afterwards.
            before, self._memory.told = self._memory.told, None
            end = self._docker.send(
                lambda: self._goal(station, stages=not self._staging), run, on_feedback
            )
            if end is None:
                return False
            code = int(getattr(end.result, 'error_code', 0))
            if end.status == 'succeeded' and end.result.success:
                self._is_over('the robot is in its dock')
                self._memory.told = True
                return True
            if code in NOT_MOVED_IN:
                self._memory.told = before
            why = f'docking: the docking server {end.status} the goal{reason_of(end.result)}'
            if code in NO_RETRY or number == TRIES - 1:
                break
            self._node.get_logger().warn(f'{why}; trying again')
            if not run.sleep(PAUSE * 2**number):
                return False
        raise self._failed(why, code, at)

    def _goal(self, station: Station, *, stages: bool) -> Any:
        pose = PoseStamped()
        pose.header.frame_id = self.map_frame
        pose.header.stamp = self._node.get_clock().now().to_msg()
        pose.pose = pose_message(station.pose)
        return self._dock.Goal(
            use_dock_id=bool(station.dock),
            dock_id=station.dock,
            dock_pose=pose,
            dock_type=self._settings.dock_type,
            navigate_to_staging_pose=stages,
        )

    def _failed(self, why: str, code: int, at: Points) -> MotionFailedError:
        """Tell a person; return what ends the way."""
        action = WHAT_HELPS.get(code, 'look after the robot at its dock')
        self._node.incidents.begin(('station', 'dock'), why, Severity.ALARM, action=action)
        return MotionFailedError(why, at)

    def _is_over(self, text: str) -> None:
        self._node.incidents.end(('station', 'dock'), text)

    def place_reached(self, goal: Points, end: Points) -> str:
        """As the motion that drives."""
        return self._inner.place_reached(goal, end)

    @property
    def map_frame(self) -> str:
        """As the motion that drives."""
        return self._inner.map_frame

    @property
    def hold(self) -> Hold:
        """As the motion that drives."""
        return self._inner.hold

    @property
    def pose(self) -> Pose | None:
        """As the motion that drives."""
        return self._inner.pose

    def look_around(self, run: GoalRun) -> None:
        """As the motion that drives; a docked robot stays as it is."""
        if self.contact() is Contact.FREE:
            self._inner.look_around(run)


def without_end(path: Points, distance: float) -> Points:
    """Return a path without what is nearer than so many metres to its end, as the crow flies.

    Returns:
        Shape (n, 3); of one point where all of it is as near.
    """
    gaps = np.linalg.norm(path[:, :2] - path[-1, :2], axis=1)
    far = np.flatnonzero(gaps > distance)
    if not len(far):
        return path[:1]
    last = int(far[-1])
    if last == len(path) - 1:
        return path
    # The part of the next leg that lies outside the circle around the end.
    start, step = path[last, :2] - path[-1, :2], path[last + 1, :2] - path[last, :2]
    a, b, c = float(step @ step), float(start @ step), float(start @ start) - distance**2
    share = (-b - math.sqrt(max(0.0, b * b - a * c))) / a if a > 0.0 else 0.0
    cut = path[last] + share * (path[last + 1] - path[last])
    return np.vstack([path[: last + 1], cut])
