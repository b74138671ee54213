"""A simulated robot that speaks as a foreign one: what a driver publishes, and no word more.

Stamped commands, odometry with its frame on tf, a lidar with best effort, fixed frames on
tf_static. With `--map` it publishes the place's map, too, as a map server would. The topic `stage`
has things happen to it. It writes down where it is beside where it is believed to be.
"""

from __future__ import annotations

import argparse
import json
import math
import sys
import time
from pathlib import Path
from typing import Any

import numpy as np
import rclpy
from geometry_msgs.msg import Pose, TransformStamped, TwistStamped
from nav_msgs.msg import OccupancyGrid, Odometry
from rclpy.executors import ExternalShutdownException, SingleThreadedExecutor
from rclpy.node import Node
from rclpy.qos import DurabilityPolicy, QoSProfile
from rclpy.utilities import remove_ros_args
from sensor_msgs.msg import BatteryState, LaserScan
from std_msgs.msg import String
from tf2_msgs.msg import TFMessage

from floor_plans import PlaceError
from lidar_navigation.geometry import composed
from surveillance_runtime.conversions import map_message, pose_from, pose_message
from surveillance_runtime.qos import SENSOR_QOS, STATE_QOS
from surveillance_simulation.physics.model import PhysicsModel
from surveillance_simulation.robot.base import BaseModel
from surveillance_simulation.robot.lidar import LidarModel
from surveillance_simulation.robot.robot import Robot
from surveillance_simulation.world.simulated_place import read_simulated_place

STEP, SWEEP, TRACE = 0.05, 0.1, 0.2
"""Time between two steps, two scans and two lines of the trace, seconds."""
LONGEST_STEP = 0.5
"""A robot that got no processor time moves on by at most this, seconds."""
LASER_HEIGHT = 0.2
PERSON_AHEAD = 1.6
"""So far before the robot somebody crosses its way, metres."""
CONTACT = 0.12
"""So near to its dock's pose it is charged, metres."""
BOXED_IN = 0.7
"""So far from the robot's middle stand the things that box it in, metres."""
BASE, FOOT, LASER = 'base_link', 'base_footprint', 'base_scan'


class ForeignRobot(Node):
    """The robot as a node.

    Args:
        options: Of the command line: the place's file, the trace, a line of JSON each 0.2 s, and
            what differs from robot to robot.
    """

    def __init__(self, options: argparse.Namespace) -> None:
        super().__init__('foreign_robot')
        world = read_simulated_place(options.place)
        model = BaseModel(radius=0.22, speed=0.5, turn_speed=1.5)
        physics = PhysicsModel() if options.physics else None
        rng = np.random.default_rng(1)
        self.robot = Robot(world, model, LidarModel(rays=360), rng=rng, physics=physics)
        self._trace = options.trace.open('a', buffering=1)
        self._slip = 0.0
        self._silent_until = -math.inf
        self._stepped_at = time.monotonic()
        self._way = 0.0
        self._map_to_odom: tuple[float, float, float] | None = None
        self._tf = self.create_publisher(TFMessage, 'tf', 100)
        latched = QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL)
        self._fixed = self.create_publisher(TFMessage, 'tf_static', latched)
        self._odometry = None
        if not options.tf_only:
            self._odometry = self.create_publisher(Odometry, 'odom', 10)
        self._scans = self.create_publisher(LaserScan, 'scan', SENSOR_QOS)
        if options.dock:
            self._battery = self.create_publisher(BatteryState, 'battery_state', 10)
            self.create_timer(1.0, self._tell_battery)
        self.create_subscription(TwistStamped, 'cmd_vel', self._on_command, 10)
        # Latched: who stages something ends as soon as this is told, known to it or not.
        self.create_subscription(String, 'stage', self._on_stage, STATE_QOS)
        self.create_subscription(TFMessage, 'tf', self._on_transforms, 100)
        at_middle = (0.0, 0.0, 0.0)
        frames = [self._frame(FOOT, BASE, at_middle), self._frame(BASE, LASER, at_middle)]
        frames[1].transform.translation.z = LASER_HEIGHT
        self._fixed.publish(TFMessage(transforms=frames))
        if options.map:
            maps = self.create_publisher(OccupancyGrid, 'map', STATE_QOS)
            stamp = self.get_clock().now().to_msg()
            maps.publish(map_message(world.plan.grid(), 'map', stamp))
        self.create_timer(STEP, self._step)
        self.create_timer(SWEEP, self._sweep)
        self.create_timer(TRACE, self._write)

    def _frame(self, parent: str, child: str, pose: Any) -> TransformStamped:
        frame = TransformStamped(child_frame_id=child)
        frame.header.frame_id = parent
        frame.header.stamp = self.get_clock().now().to_msg()
        told = pose_message(pose)
        frame.transform.translation.x = told.position.x
        frame.transform.translation.y = told.position.y
        frame.transform.rotation = told.orientation
        return frame

    def _on_command(self, message: TwistStamped) -> None:
        self.robot.base.command(message.twist.linear.x, message.twist.angular.z)

    def _on_transforms(self, message: TFMessage) -> None:
        for each in message.transforms:
            if each.child_frame_id == 'odom':
                shift = each.transform.translation
                at = Pose(orientation=each.transform.rotation)
                at.position.x, at.position.y = shift.x, shift.y
                self._map_to_odom = pose_from(at)

    def _on_stage(self, message: String) -> None:
        """Take what is staged: a name and what it is about."""
        ((name, value),) = json.loads(message.data).items()
        try:
            getattr(self, f'_stage_{name}')(value)
        except PlaceError as error:
            self.get_logger().error(f'{name}: {error}')

    def _stage_close(self, door: str) -> None:
        self.robot.world.set_door(door, False)

    def _stage_open(self, door: str) -> None:
        self.robot.world.set_door(door, True)

    def _stage_pose(self, pose: Any) -> None:
        """Carry it elsewhere; its wheels do not know it."""
        self.robot.base.pose = tuple(pose)

    def _stage_slip(self, part: float) -> None:
        self._slip = part

    def _stage_silence(self, seconds: float) -> None:
        """Let the lidar tell nothing."""
        self._silent_until = time.monotonic() + seconds

    def _stage_person(self, comes: bool) -> None:
        """Let a person walk there and back across the robot's way; it has as much room as there
        is.
        """
        if not comes:
            self.robot.walks.end('person')
            self.robot.world.remove_obstacle('person')
            return
        x, y, yaw = self.robot.base.pose
        ahead = x + PERSON_AHEAD * math.cos(yaw), y + PERSON_AHEAD * math.sin(yaw)
        for half in (1.5, 1.2, 0.9, 0.6, 0.4):
            dx, dy = -half * math.sin(yaw), half * math.cos(yaw)
            way = ((ahead[0] - dx, ahead[1] - dy), (ahead[0] + dx, ahead[1] + dy))
            try:
                self.robot.walks.begin('person', way)
            except PlaceError:
                continue
            return
        self.get_logger().error('person: no room ahead')

    def _stage_box(self, is_in: bool) -> None:
        """Put barrels all around the robot, or take them away."""
        x, y, _ = self.robot.base.pose
        for number in range(8):
            if is_in:
                angle = number * math.tau / 8
                at = x + BOXED_IN * math.cos(angle), y + BOXED_IN * math.sin(angle)
                self.robot.world.place_obstacle(f'box{number}', *at, 0.2)
            else:
                self.robot.world.remove_obstacle(f'box{number}')

    def _step(self) -> None:
        base = self.robot.base
        before, now = base.pose, time.monotonic()
        passed, self._stepped_at = min(now - self._stepped_at, LONGEST_STEP), now
        self.robot.advance(passed)
        self._way += math.dist(before[:2], base.pose[:2])
        if self._slip:
            x, y, yaw = base.pose
            back = self._slip * math.dist(before[:2], (x, y))
            base.pose = (x - back * math.cos(yaw), y - back * math.sin(yaw), yaw)
        pose = base.odometry
        self._tf.publish(TFMessage(transforms=[self._frame('odom', FOOT, pose)]))
        if self._odometry is None:
            return
        message = Odometry(child_frame_id=FOOT)
        message.header.frame_id = 'odom'
        message.header.stamp = self.get_clock().now().to_msg()
        message.pose.pose = pose_message(pose)
        message.twist.twist.linear.x = float(base.speed)
        message.twist.twist.angular.z = float(base.turn_speed)
        self._odometry.publish(message)

    def _sweep(self) -> None:
        if time.monotonic() < self._silent_until:
            return
        model = self.robot.lidar
        message = LaserScan(
            angle_min=-math.pi,
            angle_max=math.pi - math.tau / model.rays,
            angle_increment=math.tau / model.rays,
            range_min=model.range_min,
            range_max=model.range_max,
            ranges=self.robot.scan().tolist(),
        )
        message.header.frame_id = LASER
        message.header.stamp = self.get_clock().now().to_msg()
        self._scans.publish(message)

    def _tell_battery(self) -> None:
        status = BatteryState.POWER_SUPPLY_STATUS_DISCHARGING
        x, y, _ = self.robot.base.pose
        charges = math.dist((x, y), self.robot.world.plan.start[:2]) < CONTACT
        if charges:
            status = BatteryState.POWER_SUPPLY_STATUS_CHARGING
        message = BatteryState(percentage=0.8, voltage=12.3, power_supply_status=status)
        message.current = 1.0 if charges else -1.0
        message.header.stamp = self.get_clock().now().to_msg()
        self._battery.publish(message)

    def _write(self) -> None:
        base, believed = self.robot.base, None
        if self._map_to_odom is not None:
            believed = composed(self._map_to_odom, base.odometry)
        state = {'at': time.time(), 'pose': base.pose, 'believed': believed}
        state |= {'way': self._way, 'contacts': base.collisions, 'speed': float(base.speed)}
        self._trace.write(json.dumps(state) + '\n')


def main() -> None:
    """Run until it is stopped."""
    parser = argparse.ArgumentParser()
    parser.add_argument('place', type=Path)
    parser.add_argument('trace', type=Path)
    parser.add_argument('--map', action='store_true', help='publish the map')
    parser.add_argument('--tf-only', action='store_true', help='no odom topic')
    parser.add_argument('--dock', action='store_true', help='a dock charges it where it begins')
    parser.add_argument('--physics', action='store_true', help='MuJoCo moves it')
    options = parser.parse_args(remove_ros_args(sys.argv)[1:])
    rclpy.init()
    node = ForeignRobot(options)
    executor = SingleThreadedExecutor()
    executor.add_node(node)
    try:
        executor.spin()
    except (KeyboardInterrupt, ExternalShutdownException):
        pass
    finally:
        executor.shutdown()
        node.destroy_node()
        rclpy.try_shutdown()


if __name__ == '__main__':
    main()
