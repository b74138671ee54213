"""The node `simulator`: the robots' hardware and the place around them, on ROS topics.

One robot has its topics beside the place's; several (the table `robots` of the place) have theirs
below their names.
"""

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

from floor_plans import PlaceError
from floor_plans.parameters import PLACE_TABLES, members_of, nested
from floor_plans.shapes import Pose
from strict_files.files import FileError, LineFile
from surveillance_interfaces.msg import MarkerDetectionArray, RobotPlace
from surveillance_runtime.conversions import (
    seconds_of,
    stamp_of_serialized,
    trajectory_from,
)
from surveillance_runtime.node import PatrolNode
from surveillance_runtime.parameters import ParameterError
from surveillance_runtime.process import run_node
from surveillance_runtime.profile.parameters import CommandSettings
from surveillance_runtime.qos import STATE_QOS
from surveillance_runtime.state_file import StateFile
from surveillance_runtime.state_topics import StateSubscription
from surveillance_simulation import conversions
from surveillance_simulation.clock_rate import (
    DRIVING,
    LOOKED_OVER,
    OBEYS_WITHIN,
    PLANNING,
    ClockRate,
    ClockRateModel,
    Lockstep,
)
from surveillance_simulation.feeds.camera_feed import CameraFeed, CameraSetup
from surveillance_simulation.feeds.fault_services import FaultServices
from surveillance_simulation.feeds.sensor_feed import (
    PlaceFeed,
    SensorFeed,
    SensorSetup,
    topic_of,
)
from surveillance_simulation.physics.model import PhysicsModel
from surveillance_simulation.robot.base import BaseModel
from surveillance_simulation.robot.lidar import LidarModel
from surveillance_simulation.robot.robot import Robot
from surveillance_simulation.robot.robots import Robots
from surveillance_simulation.staging import Happening, Stage, check_script, read_script
from surveillance_simulation.world.people import People, PeopleModel
from surveillance_simulation.world.simulated_place import SimulatedPlace

_UNDER_WAY = (
    GoalStatus.STATUS_ACCEPTED,
    GoalStatus.STATUS_EXECUTING,
    GoalStatus.STATUS_CANCELING,
)


LOOK_PERIOD = 0.5
"""Real seconds between two looks whether a program that time waits for is to be given up."""


class Simulator(PatrolNode):
    """Steps the robots in time, carries out their commands, publishes what their sensors measure.

    Attributes:
        robots: The robots in their world, for whoever runs the node in their own process.
    """

    def __init__(self, **node_options: Any) -> None:
        super().__init__('simulator', **node_options)
        seed = self.parameter('random_seed', 0, 'Seed of all noise: the same seed, the same run.')
        rate = self.declare_fields(ClockRateModel())
        described = _place_parameters(self)
        try:
            world = SimulatedPlace.from_parameters(described)
            fleet = members_of(described, world.plan)
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
        base = self.declare_fields(BaseModel(), prefix='base.')
        lidar = self.declare_fields(LidarModel(), prefix='lidar.')
        starts = {each.name: each.start for each in fleet} or {'': world.plan.start}
        if engine == 'mujoco' and len(starts) > 1:
            raise ParameterError(
                f'simulator: engine mujoco moves one robot, and there are {len(starts)}: expected '
                'kinematic'
            )
        people = People(world.plan, model, np.random.default_rng(seed)) if model.count else None
        try:
            self.robots = Robots(
                [
                    Robot(
                        world,
                        base,
                        lidar,
                        rng=np.random.default_rng(seed + i),
                        people=None if i else people,
                        physics=physics if engine == 'mujoco' else None,
                        name=name,
                        start=start,
                    )
                    for i, (name, start) in enumerate(starts.items())
                ]
            )
        except ImportError as error:
            raise ParameterError(f'simulator: engine {error}') from None
        kept = self.parameter(
            'state_file',
            '',
            "File that keeps the robots' poses, the time and the doors over a restart of the "
            'process; empty: nothing is kept.',
            read_only=True,
        )
        self._kept = StateFile(self, kept)
        if self._kept.found and not self.robots.restore(self._kept.found):
            self.get_logger().warn('parameter state_file: the saved state belongs to another place')
        self._kept_poses = self._poses()
        self._changing = threading.RLock()
        self._drives_clock = rate.speed != 1.0 or bool(self.get_parameter('use_sim_time').value)
        self.stage = self._staged()
        # As fast as possible, there is a measurement after each step of time.
        self._measurement_period = rate.step if rate.speed else 0.0
        self._next_measurement = self.robots.time + self._measurement_period
        if rate.speed:
            # A command is late when it has not come some time after the next measurement.
            window = rate.step + rate.window
            rate = replace(rate, step=min(rate.step, OBEYS_WITHIN * rate.speed), window=window)
        sensors = SensorSetup.declared(self, physics)
        cameras = CameraSetup(self, sensors.frames.camera)
        self._place = PlaceFeed(self, world, sensors, drives_clock=self._drives_clock)
        rate = replace(rate, look_window=cameras.period + rate.step)
        self._rate = ClockRate(rate, time.monotonic(), len(starts))
        FaultServices(self, self.robots, self.stage, self._changing, self._changed, self._seconds)
        stamped = self.declare_fields(CommandSettings()).command_type == 'TwistStamped'
        try:
            self._bodies = [
                _RobotTopics(
                    self,
                    robot,
                    lockstep,
                    SensorFeed(self, robot, sensors),
                    CameraFeed(self, robot, cameras, seed, self._changing, self._stamp),
                    stamped=stamped,
                )
                for robot, lockstep in zip(self.robots.robots, self._rate.robots, strict=True)
            ]
        except (PlaceError, ImportError) as error:
            raise ParameterError(f'simulator: {error}') from None
        steady = RclpyClock(clock_type=ClockType.STEADY_TIME)
        self._measure()
        self._timer = self.create_timer(rate.period, self._tick, clock=steady)
        self.create_timer(LOOK_PERIOD, self._look_again, clock=steady)
        self._speed, self._is_too_slow = rate.speed, False
        self.create_timer(LOOKED_OVER / 2, self._look_at_speed, clock=steady)
        if self._drives_clock:
            self._told_of_clock = False
            self.create_timer(1.0, self._look_for_another_clock, clock=steady)

    @property
    def robot(self) -> Robot:
        """The first robot."""
        return self.robots.first

    @property
    def drives_clock(self) -> bool:
        """Whether the simulated time is that of this node."""
        return self._drives_clock

    @property
    def changing(self) -> threading.RLock:
        """The lock that is held while robots or world change."""
        return self._changing

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
            if problem := check_script(Robot(SimulatedPlace(self.robot.world.plan)), script):
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
            return conversions.time_to_ros(self.robots.time)
        return self.get_clock().now().to_msg()

    def _tick(self) -> None:
        with self._changing:
            measure = self._advance()
            if self._rate.waits(self.robots.time, time.monotonic()):
                # The answer wakes it: useless ticks would take the time that the answer needs.
                self._timer.cancel()
            elif self._rate.pause is not None:
                self._timer.timer_period_ns = round(1e9 * self._rate.pause)
                self._timer.reset()
        if measure:
            self._measure()
            for body in self._bodies:
                body.camera.tick()

    def _measure(self) -> None:
        stamp = self._stamp()
        self._place.tell_time(stamp)
        for body in self._bodies:
            body.sensors.publish(stamp)

    def _advance(self) -> bool:
        """Move the robots on by the time that is due; return whether it is time to measure."""
        while passed := self._rate.due(
            self.robots.time, time.monotonic(), moving=self.robots.is_moving
        ):
            self.robots.advance(passed)
            if said := self.stage.advance(self._seconds()):
                for each in said:
                    self.get_logger().info(each)
                self._changed()
            if self.robots.time >= self._next_measurement - 1e-9:
                self._next_measurement = self.robots.time + self._measurement_period
                if self._drives_clock or self._poses() != self._kept_poses:
                    self._keep()
                return True
        return False

    def _poses(self) -> list[Pose]:
        return [robot.base.pose for robot in self.robots.robots]

    def _keep(self) -> None:
        self._kept_poses = self._poses()
        self._kept.save({**self.robots.state(), 'stage': self.stage.state()})

    def _changed(self) -> None:
        self._keep()
        self._place.tell_doors()

    def go_on(self) -> None:
        """Let time pass if nothing is waited for any more."""
        if self._rate.is_waiting and not self._rate.waits(self.robots.time, time.monotonic()):
            self._timer.reset()
            self._tick()

    def _look_again(self) -> None:
        if self._rate.is_waiting:
            for body, lockstep in zip(self._bodies, self._rate.robots, strict=True):
                if lockstep.awaits_picture:
                    # The last one may have been taken before the rest was known.
                    body.camera.ask()
        self.go_on()

    def _look_at_speed(self) -> None:
        """Say once that the machine does not keep up; time is slower then, and nothing is lost."""
        with self._changing:
            reached = self._rate.too_slow(time.monotonic())
        if reached is not None and not self._is_too_slow and self._drives_clock:
            self._is_too_slow = True
            self.get_logger().warn(
                f'the machine is too slow for speed {self._speed:g}: time goes {reached:.1f} times '
                'as fast as in reality, and waits for the robot'
            )

    def _look_for_another_clock(self) -> None:
        others = self.count_publishers('/clock') - 1
        if others > 0 and not self._told_of_clock:
            self.get_logger().error(
                f'{others} other publisher(s) of /clock in this ROS domain: time jumps for every '
                'node. Expected one; give the other robot its own --domain.'
            )
        self._told_of_clock = others > 0


class _RobotTopics:
    """What the programs of one robot tell the simulator: commands, and where they are with them.

    Args:
        node: The simulator.
        robot: The robot.
        lockstep: What time waits for.
        sensors: Its sensors.
        camera: Its camera.
        stamped: Whether commands have stamps.
    """

    def __init__(
        self,
        node: Simulator,
        robot: Robot,
        lockstep: Lockstep,
        sensors: SensorFeed,
        camera: CameraFeed,
        *,
        stamped: bool,
    ) -> None:
        self.sensors, self.camera = sensors, camera
        self._node, self._robot, self._lockstep = node, robot, lockstep
        topic = partial(topic_of, robot)
        # Past a collision monitor nobody stamps a command.
        self._unmonitored = (
            None if stamped else node.create_subscription(Twist, topic('cmd_vel'), self._obey, 1)
        )
        node.create_subscription(
            TwistStamped if stamped else Twist, topic('cmd_vel_monitored'), self._on_monitored, 1
        )
        motion = topic('motion_controller')
        StateSubscription(
            node,
            PoseWithCovarianceStamped,
            topic('amcl_pose'),
            self._on_estimate,
            raw=True,
            owner=motion,
        )
        # The same word twice is two waits.
        StateSubscription(
            node,
            Time,
            topic('mission_waits_until'),
            self._on_mission_waits,
            each=True,
            owner=topic('robot_behavior'),
        )
        StateSubscription(node, RobotPlace, topic('robot_place'), self._on_place, owner=motion)
        StateSubscription(
            node, Time, topic('robot_place_written'), self._on_place_written, owner=motion
        )
        for action in (*PLANNING, *DRIVING):
            node.create_subscription(
                GoalStatusArray,
                topic(f'{action}/_action/status'),
                partial(self._on_goals, action),
                STATE_QOS,
            )
        node.create_subscription(
            JointTrajectory, topic('arm/joint_trajectory'), self._on_trajectory, 1
        )
        StateSubscription(
            node,
            Bool,
            topic('arm/at_rest'),
            self._on_arm_rest,
            owner=topic('arm_controller'),
            only=True,
        )
        node.create_subscription(
            MarkerDetectionArray, topic('aruco_detector/detections'), self._on_detections, 10
        )

    def _on_monitored(self, message: Twist | TwistStamped) -> None:
        """Obey the collision monitor; who commands past it is not heard from now on."""
        if self._unmonitored is not None:
            self._node.destroy_subscription(self._unmonitored)
            self._unmonitored = None
        self._obey(message.twist if isinstance(message, TwistStamped) else message)

    def _obey(self, message: Twist) -> None:
        speed, turn_speed = message.linear.x, message.angular.z
        robot = self._robot
        with self._node.changing:
            robot.base.command(speed, turn_speed)
            self._lockstep.command(robot.base.is_moving, robot.time)
        self._node.go_on()

    def _on_estimate(self, serialized: bytes) -> None:
        if not self._node.drives_clock:
            return
        try:
            self._lockstep.estimate(stamp_of_serialized(serialized))
        except ValueError as error:
            self._node.get_logger().error(f'amcl_pose: {error}')
        else:
            self._node.go_on()

    def _on_mission_waits(self, message: Time) -> None:
        until = message.sec + 1e-9 * message.nanosec
        self._lockstep.mission_waits(until or math.inf)
        self._node.go_on()

    def _on_place(self, message: RobotPlace) -> None:
        if message.place:
            self._lockstep.place_told(seconds_of(message.header.stamp))

    def _on_place_written(self, stamp: Time) -> None:
        self._lockstep.place_written(seconds_of(stamp))
        self._node.go_on()

    def _on_arm_rest(self, message: Bool) -> None:
        if message.data:
            self._lockstep.arm_rests(self._robot.time)
            self._node.go_on()

    def _on_detections(self, message: MarkerDetectionArray) -> None:
        self._lockstep.picture_read(seconds_of(message.header.stamp))
        self._node.go_on()

    def _on_goals(self, action: str, message: GoalStatusArray) -> None:
        executed = any(goal.status in _UNDER_WAY for goal in message.status_list)
        self._lockstep.goals(action, self._robot.time, executed=executed)
        self._node.go_on()

    def _on_trajectory(self, message: JointTrajectory) -> None:
        names, points = trajectory_from(message)
        robot = self._robot
        try:
            with self._node.changing:
                robot.arm.follow(names, points, robot.time)
                self._lockstep.arm_moves(robot.time + (points[-1].time if points else 0.0))
        except ValueError as error:
            self._node.get_logger().error(f'arm/joint_trajectory: {error}')


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
