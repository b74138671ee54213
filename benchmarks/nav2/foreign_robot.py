"""A simulated robot that speaks as a foreign one: what a driver publishes, and no word more.

Stamped commands, odometry with its frame on tf, a lidar with best effort, fixed frames on
tf_static. With `--map` it publishes the place's map, too, as a map server would.
"""

from __future__ import annotations

import argparse
import json
import math
import time
from pathlib import Path
from typing import Any

import numpy as np
import rclpy
from geometry_msgs.msg import PoseWithCovarianceStamped, TransformStamped, TwistStamped
from nav_msgs.msg import OccupancyGrid, Odometry
from rclpy.executors import ExternalShutdownException, SingleThreadedExecutor
from rclpy.node import Node
from rclpy.qos import DurabilityPolicy, QoSProfile
from sensor_msgs.msg import LaserScan
from std_msgs.msg import String
from tf2_msgs.msg import TFMessage

from surveillance_runtime.conversions import map_message, pose_message
from surveillance_runtime.qos import SENSOR_QOS, STATE_QOS
from surveillance_simulation.robot.base import BaseModel
from surveillance_simulation.robot.lidar import LidarModel
from surveillance_simulation.robot.robot import Robot
from surveillance_simulation.world.simulated_place import read_simulated_place

STEP, SWEEP = 0.05, 0.1
"""Time between two steps and two scans, seconds."""
BASE, FOOT, LASER = 'base_link', 'base_footprint', 'base_scan'


class ForeignRobot(Node):
    """The robot as a node.

    Args:
        place: The place's file.
        report: Where its state is written each second, as JSON.
        slip: Part of each way that its wheels slip, 0 to 1.
        serves_map: Whether it publishes the map.
    """

    def __init__(self, place: Path, report: Path, slip: float, *, serves_map: bool) -> None:
        super().__init__('foreign_robot')
        world = read_simulated_place(place)
        model = BaseModel(radius=0.22, speed=0.5, turn_speed=1.5)
        self.robot = Robot(world, model, LidarModel(rays=360), rng=np.random.default_rng(1))
        self._report, self._slip = report, slip
        self._way = 0.0
        self._tf = self.create_publisher(TFMessage, 'tf', 100)
        latched = QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL)
        self._fixed = self.create_publisher(TFMessage, 'tf_static', latched)
        self._odometry = self.create_publisher(Odometry, 'odom', 10)
        self._scans = self.create_publisher(LaserScan, 'scan', SENSOR_QOS)
        self._truth = self.create_publisher(PoseWithCovarianceStamped, 'true_pose', 10)
        self.create_subscription(TwistStamped, 'cmd_vel', self._on_command, 10)
        self.create_subscription(String, 'stage', self._on_stage, 10)
        frames = [self._frame(FOOT, BASE, (0.0, 0.0, 0.0)), self._frame(BASE, LASER, (0.0,) * 3)]
        self._fixed.publish(TFMessage(transforms=frames))
        if serves_map:
            maps = self.create_publisher(OccupancyGrid, 'map', STATE_QOS)
            stamp = self.get_clock().now().to_msg()
            maps.publish(map_message(world.plan.grid(), 'map', stamp))
        self.create_timer(STEP, self._step)
        self.create_timer(SWEEP, self._sweep)
        self.create_timer(1.0, self._write)

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

    def _on_stage(self, message: String) -> None:
        """Take what is staged: a door, a thing in the way, another place for the robot."""
        staged = json.loads(message.data)
        if 'door' in staged:
            self.robot.world.set_door(staged['door'], staged['open'])
        if 'pose' in staged:
            self.robot.base.pose = tuple(staged['pose'])

    def _step(self) -> None:
        base = self.robot.base
        before = base.pose
        self.robot.advance(STEP)
        self._way += math.dist(before[:2], base.pose[:2])
        if self._slip:
            x, y, yaw = base.pose
            back = self._slip * math.dist(before[:2], (x, y))
            base.pose = (x - back * math.cos(yaw), y - back * math.sin(yaw), yaw)
        pose = base.odometry
        self._tf.publish(TFMessage(transforms=[self._frame('odom', FOOT, pose)]))
        message = Odometry(child_frame_id=FOOT)
        message.header.frame_id = 'odom'
        message.header.stamp = self.get_clock().now().to_msg()
        message.pose.pose = pose_message(pose)
        message.twist.twist.linear.x = float(base.speed)
        message.twist.twist.angular.z = float(base.turn_speed)
        self._odometry.publish(message)

    def _sweep(self) -> None:
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

    def _write(self) -> None:
        base = self.robot.base
        state = {'pose': base.pose, 'way': self._way, 'contacts': base.collisions}
        draft = self._report.with_suffix('.new')
        draft.write_text(json.dumps({**state, 'at': time.time()}))
        draft.replace(self._report)


def main() -> None:
    """Run until it is stopped."""
    parser = argparse.ArgumentParser()
    parser.add_argument('place', type=Path)
    parser.add_argument('report', type=Path)
    parser.add_argument('--map', action='store_true')
    parser.add_argument('--slip', type=float, default=0.0)
    options = parser.parse_args()
    rclpy.init()
    node = ForeignRobot(options.place, options.report, options.slip, serves_map=options.map)
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
