"""The node `explorer`: drives through a building that nobody has mapped, and maps it.

It reads `odom` and the lidars, commands `cmd_vel`, and publishes the growing `map`, where the robot
is on it (`amcl_pose`) and the transform from `map` to `odom`. With `mapping: topic` another program
maps, as slam_toolbox: then the node reads its `map`, and its transform or its `pose`. When nothing
is left to see it drives back to where it began, writes the map into `folder` and ends.
"""

from __future__ import annotations

import math
import threading
import time
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
from builtin_interfaces.msg import Time
from geometry_msgs.msg import PoseWithCovarianceStamped
from nav_msgs.msg import OccupancyGrid
from sensor_msgs.msg import LaserScan

from floor_plans import Grid
from floor_plans.occupancy_map import write_map
from lidar_navigation import (
    DriveParameters,
    Exploration,
    ForeignMap,
    FrontierParameters,
    MapBuilder,
    MappingParameters,
    Phase,
    PlanningParameters,
    Velocity,
)
from lidar_navigation.geometry import Pose, Scan, composed, relative
from lidar_navigation.localisation.odometry import (
    ContinuousOdometry,
    OdometryBuffer,
    joined_if_known,
)
from state_machines.ros import ClockWait
from strict_files.files import FileError, in_one_line, replace_text
from strict_files.settings import parameter
from surveillance_controllers import conversions
from surveillance_controllers.motion.command_publisher import CommandPublisher
from surveillance_controllers.motion.holding import Hold
from surveillance_runtime.conversions import (
    map_message,
    pose_estimate,
    pose_from,
    seconds_of,
)
from surveillance_runtime.incidents import Severity
from surveillance_runtime.node import PatrolNode
from surveillance_runtime.process import run_node
from surveillance_runtime.profile.parameters import declared_frames
from surveillance_runtime.sensing.conversions import refusing
from surveillance_runtime.sensing.mount_watch import MountWatch
from surveillance_runtime.sensing.sensors import OdometryReader
from surveillance_runtime.sensing.silence import SensorWatch
from surveillance_runtime.sensing.transforms import MapFrame, MapFrameReader, ScanReader
from surveillance_runtime.state_topics import OwnedTopic, StateSubscription

MAP_FILE = 'map.yaml'
"""In `folder`; with `map.pgm` beside it."""
DONE_FILE = 'explored'
"""In `folder`, once the robot has seen all that it can: what is left and why, a line each."""
OWN, TOPIC = 'own', 'topic'
_WAIT = 0.05
"""Seconds between two looks whether there is something to think about."""
_PUBLISH, _SAVE = 1.0, 10.0
"""Seconds of real time between two maps that are published, and two that are written."""
_SAME_GOAL = 2.0
"""A goal that moved by less than this is told once, metres."""
_TELL = 10.0
"""Seconds between two lines about what is missing."""


@dataclass(frozen=True)
class ExplorerSettings:
    """What the explorer is told by its parameters."""

    mapping: str = parameter(
        OWN,
        'Who maps: own, the node itself; topic, another program, whose map it follows.',
        choices=(OWN, TOPIC),
        read_only=True,
    )
    folder: str = parameter(
        '',
        'Folder for the map, map.yaml and map.pgm, written while it grows; empty: none is written.',
        read_only=True,
    )


class Explorer(PatrolNode):
    """Explores with one robot; the thinking is done on one thread of its own.

    Attributes:
        exploration: What it has found, and where it is going.
    """

    def __init__(self, **node_options: Any) -> None:
        super().__init__('explorer', **node_options)
        self._settings = self.declare_fields(ExplorerSettings())
        drive = self.declare_fields(DriveParameters(), prefix='drive.')
        planning = replace(
            self.declare_fields(
                PlanningParameters(), prefix='planning.', without=('radius', 'footprint')
            ),
            radius=drive.radius,
            footprint=drive.footprint,
        )
        frontiers = self.declare_fields(FrontierParameters(), prefix='frontiers.')
        mapping = self.declare_fields(MappingParameters(), prefix='mapping.')
        self._frames = declared_frames(self, 'map', 'odom', 'base', 'transform_tolerance')
        self._lidar = ScanReader(self, drive.radius, self._frames.base)
        self._mounts = MountWatch(self, self._lidar)
        self._foreign = ForeignMap() if self._settings.mapping == TOPIC else None
        self.exploration = Exploration(
            self._foreign or MapBuilder(parameters=mapping), drive, planning, frontiers
        )
        self._readings = OdometryBuffer()
        # Another program that maps has its own way with odometry that begins anew.
        self._continuous = ContinuousOdometry() if self._foreign is None else None
        self._odometry: Pose | None = None
        self._owed: Velocity | None = None
        self._heard_scan = False
        self._scans = self._left_out = self._told_left_out = 0
        # No setting of the clock makes a drive wait, or give up.
        self._wait = ClockWait(self)
        self._lock, self._saving = threading.Lock(), threading.Lock()
        self._saved_at = self._published_at = 0.0
        self._base = CommandPublisher(
            self,
            'cmd_vel',
            (*self._lidar.settings.scans, 'odom'),
            drive.deceleration,
            lambda topic: self.get_logger().warn(f'nothing on the topic {topic}: the robot stands'),
            frame=self._frames.base,
        )
        self._hold = Hold(self, self._on_hold)
        self._poses = OwnedTopic(self, PoseWithCovarianceStamped, 'amcl_pose', repeat=None)
        self._maps: OwnedTopic[OccupancyGrid] | None = None
        if self._foreign is None:
            self._maps = OwnedTopic(self, OccupancyGrid, 'map', repeat=5.0)
            self._map_frame = MapFrame(self, self._frames)
        else:
            self._follow_foreign()
        self._odometer = OdometryReader(self, self._on_odometry, self._frames)
        self._lidar.subscribe(self._on_scan)
        self._watch = SensorWatch(
            self,
            self._frames,
            self._lidar.streams,
            self._odometer.stream,
            None if self._foreign is None else self._awaits_map,
        )
        self.spawn(self._explore, 'explore')

    def _follow_foreign(self) -> None:
        """Read the map of another program, and where it has the robot."""
        assert self._foreign is not None
        StateSubscription(self, OccupancyGrid, 'map', self._on_map)
        self.create_subscription(PoseWithCovarianceStamped, 'pose', self._on_pose, 5)
        MapFrameReader(self, self._frames, self._foreign.take_correction)

    def _on_map(self, message: OccupancyGrid) -> None:
        assert self._foreign is not None
        with refusing(self, 'map'):
            self._foreign.take_map(conversions.grid_from(message))

    def _on_pose(self, message: PoseWithCovarianceStamped) -> None:
        assert self._foreign is not None
        with refusing(self, 'pose'):
            pose, stamp = pose_from(message.pose.pose), seconds_of(message.header.stamp)
            with self._lock:
                odometry = self._odometry_at(stamp)
            if odometry is not None:
                back = relative(odometry, (0.0, 0.0, 0.0))
                self._foreign.take_correction(composed(pose, back))

    def _odometry_at(self, stamp: float) -> Pose | None:
        if not self._readings.covers(stamp, stamp):
            return self._odometry
        x, y, yaw = self._readings.at(np.array([stamp]))[0].tolist()
        return (x, y, yaw)

    def _on_odometry(self, reading: Pose, measured: float) -> None:
        with self._lock:
            self._base.hear('odom')
            pose = reading if self._continuous is None else self._continuous.take(reading, measured)
            self._readings.add(measured, pose)
            self._mounts.move(pose, measured)
            self._odometry = pose

    def _on_scan(self, topic: str, scan: Scan, message: LaserScan) -> None:
        stamp = message.header.stamp
        with self._lock:
            self._base.hear(topic)
            if self._odometry is None:
                return
            odometry, reading = self._odometry, self._odometer.reading
            self._mounts.see(topic, scan, message)
            seen = joined_if_known(scan, self._readings, seconds_of(stamp))
            self._heard_scan = True
            self._scans += 1
            self._left_out += seen is None
            wrong = self._mounts.problem
            stands = self._hold.active or self.stopping.is_set() or bool(wrong)
            passed = self._wait.elapsed()
            # Where it was made is not known: it is driven by, and no part of the map.
            velocity = self.exploration.see(
                scan if seen is None else seen,
                odometry,
                passed,
                stands=stands,
                maps=seen is not None,
            )
            velocity = velocity.slowed_to(self._mounts.top_speed)
            if self.exploration.is_behind(odometry):
                # What was seen first goes into the map. Simulated time waits for a command.
                self._owed = velocity
                if not self.is_simulated:
                    self._base.command(Velocity())
            else:
                self._owed = None
                self._base.command(velocity)
        self._tell_pose(odometry, reading, stamp)

    def _on_hold(self) -> None:
        with self._lock:
            if self._hold.active:
                self._base.command(Velocity())

    def _tell_pose(self, odometry: Pose, reading: Pose | None, stamp: Time) -> None:
        if self.exploration.correction is None:
            return
        pose = self.exploration.pose(odometry)
        estimate = PoseWithCovarianceStamped(pose=pose_estimate(pose, 0.03, 0.02))
        estimate.header.frame_id, estimate.header.stamp = self._frames.map, stamp
        self._poses.publish(estimate)
        if self._foreign is None and reading is not None:
            self._map_frame.publish(pose, reading, stamp, self._odometer.stream.offset)

    def _explore(self) -> None:
        """Think until all is seen; the thread's work."""
        told, phase, goal = time.monotonic() - _TELL, self.exploration.phase, None
        while not self.stopping.is_set():
            changed = self.exploration.think()
            self._pay()
            if self.stopping.is_set():
                return  # it was told to end, and has not seen all
            if changed:
                self._show(time.monotonic())
            if self.exploration.phase is Phase.DONE:
                self._end()
                return
            if self.exploration.phase is not phase:
                phase = self.exploration.phase
                self.get_logger().info(f'{phase.value}')
            aim = self.exploration.goal
            if aim is not None and aim is not goal:
                x, y = aim.middle
                is_another = goal is None or math.dist(goal.middle, aim.middle) > _SAME_GOAL
                goal = aim
                if is_another:
                    self.get_logger().info(
                        f'to ({x:.1f}, {y:.1f}), {aim.path_length:.1f} m away: {aim.length:.1f} m '
                        'of the unknown begin there'
                    )
            self._tell_left_out()
            missing = self._missing()
            if missing and time.monotonic() - told >= _TELL:
                told = time.monotonic()
                self.get_logger().info(f'waiting for {missing}')
            if not changed:
                self.stopping.wait(_WAIT)

    def _pay(self) -> None:
        """Give the command that waited until what was seen was in the map."""
        with self._lock:
            if self._owed is not None:
                self._base.command(Velocity() if self._hold.active else self._owed)
                self._owed = None

    def _tell_left_out(self) -> None:
        """Say that scans are left out, when there are more than were told by a tenth of all."""
        if self._left_out - self._told_left_out > max(10, self._scans / 10):
            self._told_left_out = self._left_out
            self.get_logger().warn(
                f'{self._left_out} of {self._scans} scans are left out of the map: no odometry of '
                'their time came (a busy machine or network, or stamps of different clocks)'
            )

    def _missing(self) -> str:
        """Return what has not come yet; empty when the robot can begin."""
        names = ['odom' if self._odometry is None else '', '' if self._heard_scan else 'scan']
        if self._foreign is not None:
            names.append(self._foreign.missing)
        return ', '.join(name for name in names if name)

    def _awaits_map(self) -> bool:
        return self._foreign is not None and self._foreign.missing == 'map'

    def _show(self, now: float) -> None:
        """Publish and write the map, each not too often."""
        grid = self.exploration.grid
        assert grid is not None
        if self._maps is not None and now - self._published_at >= _PUBLISH:
            self._published_at = now
            self._maps.publish(map_message(grid, self._frames.map, self.get_clock().now().to_msg()))
        if now - self._saved_at >= _SAVE:
            self._saved_at = now
            self._save(grid)

    def _save(self, grid: Grid) -> None:
        if not self._settings.folder:
            return
        try:
            file = Path(self._settings.folder, MAP_FILE)
            with self._saving:  # a stop may come while the map is written
                write_map(file, grid.cells[::-1], grid.resolution, (*grid.origin, 0.0), 'pgm')
        except FileError as error:
            self.get_logger().error(f'the map is not kept: {error}')

    def _end(self) -> None:
        """Say what was found and what was left, and end the process."""
        with self._lock:
            self._base.command(Velocity())
        exploration, logger = self.exploration, self.get_logger()
        self._saved_at = self._published_at = 0.0
        self._show(time.monotonic())
        left = [
            f'({each.point[0]:.1f}, {each.point[1]:.1f}), {each.length:.1f} m: {each.reason}'
            for each in exploration.unreached
        ]
        if exploration.bent:
            x, y, _ = exploration.bent[0]
            left.append(
                f'the map contradicts itself, as near ({x:.1f}, {y:.1f}): walls are bent or drawn '
                'twice; explore again, more slowly, and use no part of it before'
            )
        if exploration.reason:
            left.append(f'the robot is not back at its start: {exploration.reason}')
        for each in left:
            logger.warn(f'left: {each}')
        if self._settings.folder:
            try:
                text = ''.join(f'{each}\n' for each in left)
                replace_text(Path(self._settings.folder, DONE_FILE), text)
            except OSError as error:
                logger.error(f'what is left is not kept: {in_one_line(error)}')
        if self._left_out:
            logger.info(f'{self._left_out} of {self._scans} scans were left out of the map')
        if exploration.bent:
            self.incidents.begin(('robot', 'map'), left[-1], Severity.ALARM)
            logger.error('the map is not to be trusted: it contradicts itself')
        else:
            logger.info('all that can be reached has been seen')
        self.finish()

    def on_stop(self) -> None:
        """Stand, and keep the map as it is."""
        with self._lock:
            self._base.command(Velocity())
        self.exploration.stop()
        if self.exploration.grid is not None:
            self._save(self.exploration.grid)

    def _now(self) -> float:
        return float(self.get_clock().now().nanoseconds) / 1e9


def main(args: Sequence[str] | None = None) -> int:
    """Run the node."""
    return run_node(Explorer, args)
