"""The explorer among publishers: it maps what the lidar sees, drives on, and ends with a map."""

from __future__ import annotations

import math
import threading
from pathlib import Path

import numpy as np
from builtin_interfaces.msg import Time
from geometry_msgs.msg import PoseWithCovarianceStamped, Twist
from nav_msgs.msg import OccupancyGrid, Odometry
from sensor_msgs.msg import LaserScan

from benchmarks import regular_places
from floor_plans import Grid
from floor_plans.occupancy_map import read_map
from lidar_navigation import Phase
from surveillance_controllers.explorer_node import DONE_FILE, MAP_FILE, Explorer
from surveillance_runtime.conversions import map_message, pose_estimate, pose_message
from surveillance_runtime.qos import SENSOR_QOS, STATE_QOS
from surveillance_simulation.conversions import scan_to_ros
from surveillance_simulation.robot.lidar import LidarModel, scan
from surveillance_simulation.world.simulated_place import SimulatedPlace


class Robot:
    """A robot that stands in a place of two rooms and tells what it measures."""

    def __init__(self, graph, door: float) -> None:
        parameters = regular_places.grid(2, 1)
        (name,) = parameters['doors']
        parameters['doors'][name][3] = door
        world, model = SimulatedPlace.from_parameters(parameters), LidarModel()
        self._ranges = scan(world, (2.0, 2.0, 0.0), model, np.random.default_rng(0))
        self._model = model
        self._scans = graph.node.create_publisher(LaserScan, 'scan', SENSOR_QOS)
        self._odometry = graph.node.create_publisher(Odometry, 'odom', SENSOR_QOS)
        self._clock = graph.node.get_clock()

    def tell(self) -> None:
        """Publish odometry and a scan."""
        stamp: Time = self._clock.now().to_msg()
        odometry = Odometry()
        odometry.header.stamp = stamp
        odometry.pose.pose = pose_message((7.0, -3.0, 0.0))
        self._odometry.publish(odometry)
        self._scans.publish(scan_to_ros(self._ranges, self._model, 'base_link', stamp, 0.0))


def test_a_room_without_a_way_out_is_mapped_and_the_node_ends(graph, tmp_path: Path) -> None:
    maps = graph.listen(OccupancyGrid, 'map', STATE_QOS)
    # One look leaves the corners; they are no frontier here.
    node = graph.add(Explorer, {'folder': str(tmp_path), 'frontiers.least': 0.9})
    robot = Robot(graph, door=0.5)

    def ended() -> bool:
        robot.tell()
        return bool(node.finished)

    graph.until(ended)
    graph.until(lambda: maps)
    found = read_map(tmp_path / MAP_FILE)
    # The map begins where the robot stood, whatever its odometry said.
    assert found.grid.at(found.grid.free, 0.0, 0.0)
    assert found.grid.at(found.grid.occupied, -1.97, 0.0)
    assert 'does not fit' in (tmp_path / DONE_FILE).read_text()


def test_what_cannot_be_written_at_the_end_is_one_line(graph, tmp_path: Path) -> None:
    (tmp_path / DONE_FILE).mkdir()  # as of a full disk: the map is written, what follows is not
    said = graph.said()
    node = graph.add(Explorer, {'folder': str(tmp_path), 'frontiers.least': 0.9})
    robot = Robot(graph, door=0.5)

    def sees() -> bool:
        robot.tell()
        return node.exploration.grid is not None

    graph.until(sees)
    node.exploration.stop()  # as if all was seen
    graph.until(lambda: node.finished)
    graph.until(lambda: any(line.startswith('what is left is not kept: ') for line in said))
    assert read_map(tmp_path / MAP_FILE)


def test_the_map_of_another_program_is_followed(graph, tmp_path: Path) -> None:
    node = graph.add(Explorer, {'folder': str(tmp_path), 'mapping': 'topic'})
    commands = graph.listen(Twist, 'cmd_vel', 1)
    robot = Robot(graph, door=1.2)
    make = graph.node.create_publisher
    maps = make(OccupancyGrid, 'map', STATE_QOS)
    poses = make(PoseWithCovarianceStamped, 'pose', 5)
    cells = np.full((80, 160), -1, np.int8)
    cells[2:-2, 2:100] = 0
    cells[[0, 1, -1, -2]] = 100
    cells[:, :2] = 100
    maps.publish(map_message(Grid(cells, 0.05), 'map', Time()))

    def drives() -> bool:
        robot.tell()
        estimate = PoseWithCovarianceStamped(pose=pose_estimate((2.0, 2.0, 0.0), 0.1, 0.1))
        estimate.header.stamp = graph.node.get_clock().now().to_msg()
        poses.publish(estimate)
        return any(command.linear.x > 0.05 for command in commands)

    graph.until(drives)
    assert math.dist(node.exploration.goal.middle, (5.0, 2.0)) < 0.3
    assert not node.finished


def test_who_is_told_to_end_does_not_say_that_all_was_seen(graph, tmp_path: Path) -> None:
    node = graph.add(Explorer, {'folder': str(tmp_path)})
    robot = Robot(graph, door=1.2)

    def sees() -> bool:
        robot.tell()
        return node.exploration.grid is not None

    graph.until(sees)
    think, began = node.exploration.think, threading.Event()

    def think_long() -> bool:
        began.set()
        node.stopping.wait(10.0)
        while node.exploration.phase is not Phase.DONE:
            pass
        return bool(think())

    node.exploration.think = think_long
    graph.until(began.is_set)
    node.stop()
    assert not node.finished
    assert (tmp_path / MAP_FILE).exists()
    assert not (tmp_path / DONE_FILE).exists()
