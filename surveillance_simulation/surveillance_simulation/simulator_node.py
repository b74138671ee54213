"""The node `simulator`: the robot's hardware and the place around it, on ROS topics."""

from __future__ import annotations

import math
import threading
import time
from collections.abc import Sequence
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
from action_msgs.msg import GoalStatus, GoalStatusArray
from builtin_interfaces.msg import Time
from geometry_msgs.msg import PoseWithCovarianceStamped, Twist, TwistStamped
from rclpy.clock import Clock as RclpyClock
from rclpy.clock import ClockType
from std_msgs.msg import Bool
from trajectory_msgs.msg import JointTrajectory

from surveillance_interfaces.msg import MarkerDetectionArray, RobotPlace
from surveillance_runtime.conversions import (
    seconds_of,
    stamp_of_serialized,
    trajectory_from,
)
from surveillance_runtime.files import FileError, LineFile
from surveillance_runtime.node import PatrolNode
from surveillance_runtime.parameters import ParameterError
from surveillance_runtime.place import PlaceError
from surveillance_runtime.place.rooms import PLACE_TABLES, nested
from surveillance_runtime.process import run_node
from surveillance_runtime.profile.parameters import CommandSettings
from surveillance_runtime.qos import STATE_QOS
from surveillance_runtime.state_file import StateFile
from surveillance_runtime.state_topics import StateSubscription
from surveillance_simulation import conversions
from surveillance_simulation.clock_rate import (
    DRIVING,
    OBEYS_WITHIN,
    PLANNING,
    ClockRate,
    ClockRateModel,
)
from surveillance_simulation.feeds.camera_feed import CameraFeed
from surveillance_simulation.feeds.fault_services import FaultServices
from surveillance_simulation.feeds.sensor_feed import SensorFeed
from surveillance_simulation.physics.model import PhysicsModel
from surveillance_simulation.robot.base import BaseModel
from surveillance_simulation.robot.lidar import LidarModel
from surveillance_simulation.robot.robot import Robot
from surveillance_simulation.staging import Happening, Stage, check_script, read_script
from surveillance_simulation.world.people import People, PeopleModel
from surveillance_simulation.world.world import World

_UNDER_WAY = (
    GoalStatus.STATUS_ACCEPTED,
    GoalStatus.STATUS_EXECUTING,
    GoalStatus.STATUS_CANCELING,
)


LOOK_PERIOD = 0.5
"""Real seconds between two looks whether a program that time waits for is to be given up."""


class Simulator(PatrolNode):
    """Steps the robot in time, carries out its commands and publishes its sensors' measurements.

    Attributes:
        robot: The robot in its world, for whoever runs the node in their own process.
    """

    def __init__(self, **node_options: Any) -> None:
        super().__init__('simulator', **node_options)
        seed = self.parameter('random_seed', 0, 'Seed of all noise: the same seed, the same run.')
        rate = self.declare_fields(ClockRateModel())
        try:
            world = World.from_parameters(_place_parameters(self))
        except PlaceError as error:
            raise ParameterError(f'simulator: {error}') from None
        model = self.declare_fields(PeopleModel(), prefix='people.')
        engine = self.parameter(
            'engine',
            'kinematic',
            'What moves the robot: kinematic, exact and fast; mujoco, physics with friction and '
            'slip (needs the package mujoco).',
            choices=('kinematic', 'mujoco'),
            read_only=True,
        )
        physics = self.declare_fields(PhysicsModel(), prefix='physics.')
        people = People(world.plan, model, np.random.default_rng(seed)) if model.count else None
        try:
            self.robot = Robot(
                world,
                self.declare_fields(BaseModel(), prefix='base.'),
                self.declare_fields(LidarModel(), prefix='lidar.'),
                rng=np.random.default_rng(seed),
                people=people,
                physics=physics if engine == 'mujoco' else None,
            )
        except ImportError as error:
            raise ParameterError(f'simulator: engine {error}') from None
        kept = self.parameter(
            'state_file',
            '',
            "File that keeps the robot's pose, the time and the doors over a restart of the "
            'process; empty: nothing is kept.',
            read_only=True,
        )
        self._kept = StateFile(self, kept)
        if self._kept.found and not self.robot.restore(self._kept.found):
            self.get_logger().warn('parameter state_file: the saved state belongs to another place')
        self._kept_pose = self.robot.base.pose
        self._changing = threading.RLock()
        self._drives_clock = rate.speed != 1.0 or bool(self.get_parameter('use_sim_time').value)
        self.stage = self._staged()
        # As fast as possible, there is a measurement after each step of time.
        self._measurement_period = rate.step if rate.speed else 0.0
        self._next_measurement = self.robot.time + self._measurement_period
        if rate.speed:
            rate = replace(rate, step=min(rate.step, OBEYS_WITHIN * rate.speed))
        self._sensors = SensorFeed(self, self.robot, drives_clock=self._drives_clock)
        try:
            self._camera = CameraFeed(self, self.robot, seed, self._changing, self._stamp)
        except (PlaceError, ImportError) as error:
            raise ParameterError(f'simulator: {error}') from None
        rate = replace(rate, look_window=self._camera.period + rate.step)
        self._rate = ClockRate(rate, time.monotonic())
        FaultServices(self, self.robot, self.stage, self._changing, self._changed, self._seconds)
        stamped = self.declare_fields(CommandSettings()).command_type == 'TwistStamped'
        # Past a collision monitor nobody stamps a command.
        self._unmonitored = (
            None if stamped else self.create_subscription(Twist, 'cmd_vel', self._obey, 1)
        )
        self.create_subscription(
            TwistStamped if stamped else Twist, 'cmd_vel_monitored', self._on_monitored, 1
        )
        motion = 'motion_controller'
        StateSubscription(
            self,
            PoseWithCovarianceStamped,
            'amcl_pose',
            self._on_estimate,
            raw=True,
            owner=motion,
        )
        # The same word twice is two waits.
        StateSubscription(
            self,
            Time,
            'mission_waits_until',
            self._on_mission_waits,
            each=True,
            owner='robot_behavior',
        )
        StateSubscription(self, RobotPlace, 'robot_place', self._on_place, owner=motion)
        StateSubscription(self, Time, 'robot_place_written', self._on_place_written, owner=motion)
        for action in (*PLANNING, *DRIVING):
            self.create_subscription(
                GoalStatusArray,
                f'{action}/_action/status',
                partial(self._on_goals, action),
                STATE_QOS,
            )
        self.create_subscription(JointTrajectory, 'arm/joint_trajectory', self._on_trajectory, 1)
        StateSubscription(self, Bool, 'arm/at_rest', self._on_arm_rest, owner='arm_controller')
        self.create_subscription(
            MarkerDetectionArray, 'aruco_detector/detections', self._on_detections, 10
        )
        steady = RclpyClock(clock_type=ClockType.STEADY_TIME)
        self._sensors.publish(self._stamp())
        self._timer = self.create_timer(rate.period, self._tick, clock=steady)
        self.create_timer(LOOK_PERIOD, self._look_again, clock=steady)
        if self._drives_clock:
            self._told_of_clock = False
            self.create_timer(1.0, self._look_for_another_clock, clock=steady)

    def _staged(self) -> Stage:
        """Return the stage, with its script and what was staged before a restart."""
        script_file = self.parameter(
            'stage_file',
            '',
            'What happens in the place at which times, stage.yaml; empty: nothing.',
        )
        truth_file = self.parameter(
            'truth_file',
            '',
            'File for what was staged, one line of JSON each; no node reads it; empty: none.',
            read_only=True,
        )
        script: list[Happening] = []
        if script_file:
            try:
                script = read_script(script_file)
            except FileError as error:
                raise ParameterError(f'simulator: {error}') from None
            if problem := check_script(Robot(World(self.robot.world.plan)), script):
                raise ParameterError(f'simulator: {script_file}: {problem}')
        truth: LineFile | None = None

        def write(line: str) -> None:
            nonlocal truth
            if not truth_file:
                return
            try:
                truth = truth or LineFile(Path(truth_file))
                truth.append(f'{line}\n'.encode())
            except OSError as error:
                self.get_logger().warn(
                    f'truth_file {truth_file}: {error.strerror}', throttle_duration_sec=600.0
                )

        stage = Stage(self.robot, write, script, self._seconds())
        if kept := self._kept.found.get('stage'):
            try:
                stage.restore(str(kept), self._seconds())
            except (ValueError, KeyError, TypeError):
                self.get_logger().warn('parameter state_file: what was staged cannot be read')
        return stage

    def _seconds(self) -> float:
        """Return the time of the nodes' clock, seconds."""
        return seconds_of(self._stamp())

    def _stamp(self) -> Time:
        if self._drives_clock:
            return conversions.time_to_ros(self.robot.time)
        return self.get_clock().now().to_msg()

    def _tick(self) -> None:
        with self._changing:
            measure = self._advance()
            if self._rate.waits(self.robot.time, time.monotonic()):
                # The answer wakes it: useless ticks would take the time that the answer needs.
                self._timer.cancel()
            elif self._rate.pause is not None:
                self._timer.timer_period_ns = round(1e9 * self._rate.pause)
                self._timer.reset()
        if measure:
            self._sensors.publish(self._stamp())
            self._camera.tick()

    def _advance(self) -> bool:
        """Move the robot on by the time that is due; return whether it is time to measure."""
        while passed := self._rate.due(
            self.robot.time, time.monotonic(), moving=self.robot.is_moving
        ):
            self.robot.advance(passed)
            if said := self.stage.advance(self._seconds()):
                for each in said:
                    self.get_logger().info(each)
                self._changed()
            if self.robot.time >= self._next_measurement - 1e-9:
                self._next_measurement = self.robot.time + self._measurement_period
                if self._drives_clock or self.robot.base.pose != self._kept_pose:
                    self._keep()
                return True
        return False

    def _keep(self) -> None:
        self._kept_pose = self.robot.base.pose
        self._kept.save({**self.robot.state(), 'stage': self.stage.state()})

    def _changed(self) -> None:
        self._keep()
        self._sensors.tell_doors()

    def _go_on(self) -> None:
        if self._rate.is_waiting and not self._rate.waits(self.robot.time, time.monotonic()):
            self._timer.reset()
            self._tick()

    def _look_again(self) -> None:
        if self._rate.is_waiting and self._rate.awaits_picture:
            self._camera.ask()  # the last one may have been taken before the rest was known
        self._go_on()

    def _look_for_another_clock(self) -> None:
        others = self.count_publishers('/clock') - 1
        if others > 0 and not self._told_of_clock:
            self.get_logger().error(
                f'{others} other publisher(s) of /clock in this ROS domain: time jumps for every '
                'node. Expected one; give the other robot its own --domain.'
            )
        self._told_of_clock = others > 0

    def _on_monitored(self, message: Twist | TwistStamped) -> None:
        """Obey the collision monitor; who commands past it is not heard from now on."""
        if self._unmonitored is not None:
            self.destroy_subscription(self._unmonitored)
            self._unmonitored = None
        self._obey(message.twist if isinstance(message, TwistStamped) else message)

    def _obey(self, message: Twist) -> None:
        speed, turn_speed = message.linear.x, message.angular.z
        with self._changing:
            self.robot.base.command(speed, turn_speed)
            self._rate.command(self.robot.base.is_moving, self.robot.time)
        self._go_on()

    def _on_estimate(self, serialized: bytes) -> None:
        if not self._drives_clock:
            return
        try:
            self._rate.estimate(stamp_of_serialized(serialized))
        except ValueError as error:
            self.get_logger().error(f'amcl_pose: {error}')
        else:
            self._go_on()

    def _on_mission_waits(self, message: Time) -> None:
        until = message.sec + 1e-9 * message.nanosec
        self._rate.mission_waits(until or math.inf)
        self._go_on()

    def _on_place(self, message: RobotPlace) -> None:
        if message.place:
            self._rate.place_told(seconds_of(message.header.stamp))

    def _on_place_written(self, stamp: Time) -> None:
        self._rate.place_written(seconds_of(stamp))
        self._go_on()

    def _on_arm_rest(self, message: Bool) -> None:
        if message.data:
            self._rate.arm_rests(self.robot.time)
            self._go_on()

    def _on_detections(self, message: MarkerDetectionArray) -> None:
        self._rate.picture_read(seconds_of(message.header.stamp))
        self._go_on()

    def _on_goals(self, action: str, message: GoalStatusArray) -> None:
        executed = any(goal.status in _UNDER_WAY for goal in message.status_list)
        self._rate.goals(action, self.robot.time, executed=executed)
        self._go_on()

    def _on_trajectory(self, message: JointTrajectory) -> None:
        names, points = trajectory_from(message)
        try:
            with self._changing:
                self.robot.arm.follow(names, points, self.robot.time)
                self._rate.arm_moves(self.robot.time + (points[-1].time if points else 0.0))
        except ValueError as error:
            self.get_logger().error(f'arm/joint_trajectory: {error}')


def _place_parameters(node: PatrolNode) -> dict[str, Any]:
    """Declare the description of the place and return it as its file holds it."""
    described: dict[str, Any] = {}
    for table in PLACE_TABLES:
        entries = node.parameters_under(table)
        if entries:
            described[table] = nested(entries) if table == 'stations' else entries
    described['robot_room'] = node.parameter('robot_room', '', 'Place where the robot starts.')
    described['recharge_rooms'] = node.parameter(
        'recharge_rooms', [], 'Places with a charging station.', of=str
    )
    described['station'] = node.parameter(
        'station', [], 'Pose of the only charging station: x, y in metres, yaw in rad.', of=float
    )
    described['map_file'] = node.parameter(
        'map_file', '', "Map of the place in map_server's format, or a picture; empty: none."
    )
    described['map_file_resolution'] = node.parameter(
        'map_file_resolution', 0.0, "Side of a pixel, metres, where the map's file is a picture."
    )
    described['map_file_origin'] = node.parameter(
        'map_file_origin',
        [],
        "Pose of a picture's lower left corner: x, y in metres, yaw in rad; empty: 0, 0, 0.",
        of=float,
    )
    described['marker_size'] = node.parameter(
        'marker_size', 0.2, "Side of a marker's black square, metres."
    )
    described['marker_dictionary'] = node.parameter(
        'marker_dictionary', 'DICT_5X5_100', "OpenCV's name of the markers' dictionary."
    )
    return described


def main(args: Sequence[str] | None = None) -> int:
    """Run the node."""
    return run_node(Simulator, args)
