"""The simulator node among real subscribers, publishers and clients."""

from __future__ import annotations

import itertools
import json
import math
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

import numpy as np
import pytest
from builtin_interfaces.msg import Duration, Time
from geometry_msgs.msg import PoseStamped, PoseWithCovarianceStamped, Twist
from nav_msgs.msg import OccupancyGrid, Odometry
from rosgraph_msgs.msg import Clock
from sensor_msgs.msg import CameraInfo, Image, JointState, LaserScan
from std_msgs.msg import Float32, String, UInt32
from trajectory_msgs.msg import JointTrajectory, JointTrajectoryPoint

from lidar_navigation.geometry import Mount
from surveillance_controllers import conversions as received
from surveillance_interfaces.msg import DoorStates
from surveillance_interfaces.srv import (
    DrainBattery,
    PlaceObstacle,
    PushRobot,
    RemoveObstacle,
    SetDoor,
    SetMarker,
    SlipOdometry,
)
from surveillance_runtime.conversions import pose_from, seconds_of
from surveillance_runtime.parameters import ParameterError
from surveillance_runtime.qos import SENSOR_QOS, STATE_QOS
from surveillance_runtime.sensing.conversions import scan_from
from surveillance_simulation.simulator_node import Simulator

from .places import TWO_ROOMS, changed


def flat(parameters: dict[str, Any]) -> dict[str, Any]:
    """Return nested parameters with dotted names and with numbers as ROS lists hold them."""
    values: dict[str, Any] = {}
    for name, value in parameters.items():
        if isinstance(value, dict):
            values |= {f'{name}.{entry}': each for entry, each in value.items()}
        else:
            values[name] = value
    return values


def simulator(graph: Any, **parameters: Any) -> Simulator:
    described = flat(TWO_ROOMS) | {'speed': 20.0, 'base.distance_error': 0.0} | parameters
    return graph.add(Simulator, parameters=described | {'base.turn_error': 0.0})


def ask(graph: Any, kind: Any, service: str, **request: Any) -> Any:
    client = graph.node.create_client(kind, f'simulation/{service}')
    assert client.wait_for_service(60.0)
    future = client.call_async(kind.Request(**request))
    return graph.until(lambda: future.done() and future.result())


def test_a_killed_process_loses_neither_pose_nor_time_nor_doors(graph: Any, tmp_path: Path) -> None:
    path = tmp_path / 'simulator.json'
    first = simulator(graph, state_file=str(path))
    ask(graph, SetDoor, 'set_door', door='D', open=False)
    ask(graph, PushRobot, 'push_robot', dx=-0.5, dy=0.25, dyaw=1.0)
    pose = first.robot.base.pose
    graph.until(lambda: path.exists() and json.loads(path.read_text())['x'] == pose[0])
    graph.until(lambda: json.loads(path.read_text())['time'] > 5.0)
    graph.drop(first)
    kept = json.loads(path.read_text())
    second = simulator(graph, state_file=str(path))
    assert second.robot.base.pose == pose
    assert second.robot.base.odometry == first.robot.base.odometry
    assert second.robot.time >= kept['time']
    assert second.robot.world.closed_doors == {'D'}


@pytest.mark.parametrize(
    'state', ['[]', '{"x": 1.0}', '{"x": "far"}', '{"x": 1e308, "y": 0.0}', '{"x": NaN}']
)
def test_a_state_of_no_robot_in_this_place_begins_anew(
    graph: Any, tmp_path: Path, state: str
) -> None:
    path = tmp_path / 'simulator.json'
    whole = {
        **dict.fromkeys(('y', 'yaw', 'odometry_x', 'odometry_y', 'odometry_yaw', 'time'), 0.0),
        **{'closed': '', 'collisions': 0},
    }
    given = json.loads(state)
    path.write_text(json.dumps({**whole, **given} if given and len(given) == 1 else given))
    robot = simulator(graph, state_file=str(path)).robot
    assert robot.base.pose == robot.world.plan.start


def test_it_publishes_map_doors_clock_and_odometry(graph: Any) -> None:
    maps = graph.listen(OccupancyGrid, 'map', STATE_QOS)
    doors = graph.listen(DoorStates, 'door_states', STATE_QOS)
    clocks = graph.listen(Clock, '/clock')
    odometry = graph.listen(Odometry, 'odom', SENSOR_QOS)
    simulator(graph)
    graph.until(lambda: maps and doors and len(clocks) > 3 and odometry)
    grid = received.grid_from(maps[0])
    assert grid.cells[tuple(grid.cells_of(np.array((1.0, 1.0)))[0])] == 0
    assert list(doors[0].open) == ['D']
    times = [clock.clock.sec + clock.clock.nanosec / 1e9 for clock in clocks]
    assert np.diff(times) == pytest.approx(0.1)
    assert pose_from(odometry[0].pose.pose) == (1.0, 1.0, 0.0)


def test_it_drives_on_command_and_stops_at_the_wall(graph: Any) -> None:
    truth = graph.listen(PoseStamped, 'ground_truth', SENSOR_QOS)
    collisions = graph.listen(UInt32, 'collisions', STATE_QOS)
    simulator(graph, **{'speed': 0.0, 'station': [1.0, 1.0, math.pi]})
    commands = graph.node.create_publisher(Twist, 'cmd_vel', 1)
    forward = Twist()
    forward.linear.x = 0.6
    graph.node.create_subscription(
        Odometry, 'odom', lambda _: commands.publish(forward), SENSOR_QOS
    )
    graph.until(lambda: collisions and collisions[-1].data == 1)
    graph.until(lambda: truth and truth[-1].pose.position.x < 0.28)
    assert truth[-1].pose.position.x > 0.27


def test_a_base_behind_the_collision_monitor_obeys_nobody_else(graph: Any) -> None:
    base = simulator(graph, **{'speed': 0.0}).robot.base
    foreign = graph.node.create_publisher(Twist, 'cmd_vel', 1)
    monitor = graph.node.create_publisher(Twist, 'cmd_vel_monitored', 1)
    turn = Twist()
    turn.angular.z = 1.0

    def turned(commands: Any) -> bool:
        commands.publish(turn)
        return base.turn_speed != 0.0

    graph.until(lambda: turned(foreign))
    turn.angular.z = -1.0
    graph.until(lambda: turned(monitor) and base.turn_speed < 0.0)
    turn.angular.z = 1.0
    odometry = graph.listen(Odometry, 'odom', SENSOR_QOS)
    graph.until(lambda: (foreign.publish(turn), len(odometry) > 20)[1])
    assert base.turn_speed <= 0.0


def test_a_scan_is_measured_while_somebody_listens(graph: Any) -> None:
    simulator(graph)
    scans = graph.listen(LaserScan, 'scan', SENSOR_QOS)
    graph.until(lambda: scans)
    assert scan_from(scans[0]).ranges[0] == pytest.approx(0.95, abs=0.06)


def test_a_lidar_that_hangs_upside_down_tells_the_same_as_one_that_stands(graph: Any) -> None:
    mount = (0.1, -0.05, 0.5)
    node = simulator(graph, **{'lidar.noise': 0.0, 'lidar_mounts': [*mount, math.pi]})
    scans = graph.listen(LaserScan, 'scan', SENSOR_QOS)
    tf2 = pytest.importorskip('tf2_msgs.msg')
    frames = graph.listen(tf2.TFMessage, 'tf_static', STATE_QOS)
    graph.until(lambda: scans and frames)
    told = scan_from(scans[-1], Mount(mount, upside_down=True))
    assert told.points[:, 0].max() == pytest.approx(4.95, abs=0.03), 'through the door ahead'
    stands = node.robot.scan(mount)
    angles = node.robot.lidar.angles + mount[2]
    expected = np.stack([stands * np.cos(angles), stands * np.sin(angles)], 1) + mount[:2]
    away = np.linalg.norm(expected[:, None] - told.points, axis=2).min(axis=0)
    assert away.max() < 1e-3
    (lidar,) = (each for each in frames[-1].transforms if each.child_frame_id == 'base_scan')
    turned = lidar.transform.rotation
    assert abs(1.0 - 2.0 * (turned.x**2 + turned.y**2) + 1.0) < 1e-6, 'its z axis looks down'


def test_the_camera_sees_and_the_arm_turns_it(graph: Any) -> None:
    simulator(graph)
    pictures = graph.listen(Image, 'camera/rgb/image_raw', SENSOR_QOS)
    infos = graph.listen(CameraInfo, 'camera/rgb/camera_info', SENSOR_QOS)
    joints = graph.listen(JointState, 'joint_states', SENSOR_QOS)
    graph.until(lambda: pictures and infos and joints)
    assert (pictures[0].width, pictures[0].height, pictures[0].encoding) == (640, 480, 'rgb8')
    assert infos[0].k[0] == pytest.approx(320 / math.tan(math.radians(30)))
    arm = graph.node.create_publisher(JointTrajectory, 'arm/joint_trajectory', 1)
    point = JointTrajectoryPoint(positions=[1.0], time_from_start=Duration(sec=1))
    graph.until(lambda: arm.get_subscription_count())
    arm.publish(JointTrajectory(joint_names=['arm_pan'], points=[point]))
    graph.until(lambda: joints[-1].position[0] == pytest.approx(1.0))
    assert tuple(joints[-1].name)[:1] == ('arm_pan',)


def test_a_trajectory_it_cannot_follow_leaves_the_arm(graph: Any) -> None:
    node = simulator(graph)
    joints = graph.listen(JointState, 'joint_states', SENSOR_QOS)
    arm = graph.node.create_publisher(JointTrajectory, 'arm/joint_trajectory', 1)
    graph.until(lambda: arm.get_subscription_count() and joints)
    errors: list[str] = []
    node.get_logger().error = errors.append
    point = JointTrajectoryPoint(positions=[9.0], time_from_start=Duration(sec=1))
    arm.publish(JointTrajectory(joint_names=['arm_pan'], points=[point]))
    graph.until(lambda: errors)
    assert errors == ['arm/joint_trajectory: point 1: arm_pan at 9 rad: expected -3.2 to 3.2']
    count = len(joints)
    graph.until(lambda: len(joints) > count + 15)
    assert joints[-1].position[0] == 0.0
    times = [seconds_of(each.header.stamp) for each in joints[-5:]]
    assert min(b - a for a, b in itertools.pairwise(times)) == pytest.approx(0.1)


def test_a_damaged_estimate_costs_one_line_that_names_its_topic(graph: Any) -> None:
    node = simulator(graph)
    estimates = graph.node.create_publisher(PoseWithCovarianceStamped, 'amcl_pose', STATE_QOS)
    graph.until(lambda: estimates.get_subscription_count())
    errors: list[str] = []
    node.get_logger().error = errors.append
    estimates.publish(b'\x00\x01\x00\x00\x05')
    graph.until(lambda: errors)
    assert errors == ['amcl_pose: a message of 5 bytes: expected a longer one']


def test_doors_and_obstacles_are_seen_by_the_lidar(graph: Any) -> None:
    simulator(graph, **{'lidar.noise': 0.0})
    doors = graph.listen(DoorStates, 'door_states', STATE_QOS)
    scans = graph.listen(LaserScan, 'scan', SENSOR_QOS)

    def ahead(distance: float) -> bool:
        return bool(scans) and scans[-1].ranges[180] == pytest.approx(distance, abs=1e-3)

    graph.until(lambda: ahead(4.95))
    assert ask(graph, SetDoor, 'set_door', door='D', open=False).success
    graph.until(lambda: ahead(1.95) and list(doors[-1].closed) == ['D'])
    answer = ask(graph, PlaceObstacle, 'place_obstacle', name='box', x=2.0, y=1.0, radius=0.25)
    assert answer.success
    graph.until(lambda: ahead(0.75))
    assert ask(graph, RemoveObstacle, 'remove_obstacle', name='box').success
    assert ask(graph, SetDoor, 'set_door', door='D', open=True).success
    graph.until(lambda: ahead(4.95) and list(doors[-1].open) == ['D'])


def test_a_push_moves_the_robot_and_a_slip_the_odometry(graph: Any) -> None:
    simulator(graph)
    truth = graph.listen(PoseStamped, 'ground_truth', SENSOR_QOS)
    odometry = graph.listen(Odometry, 'odom', SENSOR_QOS)
    assert 'pushed by 0.50 m' in ask(graph, PushRobot, 'push_robot', dx=0.5).message
    graph.until(lambda: truth and truth[-1].pose.position.x == pytest.approx(1.5))
    assert odometry[-1].pose.pose.position.x == 1.0
    assert ask(graph, SlipOdometry, 'slip_odometry', dx=0.2).success
    graph.until(lambda: odometry[-1].pose.pose.position.x == pytest.approx(1.2))
    assert truth[-1].pose.position.x == pytest.approx(1.5)


def test_the_battery_hears_of_a_drain(graph: Any) -> None:
    simulator(graph)
    drained = graph.listen(Float32, 'battery_drain')
    graph.until(lambda: graph.node.count_publishers('battery_drain'))
    assert ask(graph, DrainBattery, 'drain_battery', percent=30.0).success
    graph.until(lambda: drained)
    assert drained[0].data == 30.0


def test_markers_break_and_move(graph: Any) -> None:
    simulator(graph)
    assert ask(graph, SetMarker, 'set_marker', name='m1', state='broken').success
    moved = ask(graph, SetMarker, 'set_marker', name='m2', state='moved', id=4, x=1.0, z=1.0)
    assert moved.message == 'marker m2 with id 4 hangs at (1.00, 0.00)'


@pytest.mark.parametrize(
    ('kind', 'service', 'request_fields', 'message'),
    [
        (SetDoor, 'set_door', {'door': 'X'}, "there is no door 'X': expected 'D'"),
        (PlaceObstacle, 'place_obstacle', {'name': 'b'}, "obstacle 'b': radius 0 m"),
        (RemoveObstacle, 'remove_obstacle', {'name': 'b'}, "there is no obstacle 'b'"),
        (DrainBattery, 'drain_battery', {'percent': 101.0}, 'percent 101: expected 0 to 100'),
        (PushRobot, 'push_robot', {'dx': math.nan}, 'expected -1000 to 1000, got nan'),
        (PushRobot, 'push_robot', {'dx': 1.7e308}, 'expected -1000 to 1000, got 1.7e+308'),
        (SlipOdometry, 'slip_odometry', {'dyaw': math.inf}, 'expected -1000 to 1000, got '),
        (SetMarker, 'set_marker', {'name': 'm1', 'state': 'lost'}, "marker state 'lost'"),
        (
            SetMarker,
            'set_marker',
            {'name': 'm1', 'state': 'moved', 'id': 100},
            'marker id 100: DICT_5X5_100 holds ids 0 to 99',
        ),
    ],
)
def test_a_wrong_request_is_refused_in_one_line(
    graph: Any, kind: Any, service: str, request_fields: dict[str, Any], message: str
) -> None:
    simulator(graph)
    answer = ask(graph, kind, service, **request_fields)
    assert not answer.success
    assert answer.message.startswith(message)


def test_it_tells_a_localisation_where_it_starts(graph: Any) -> None:
    poses = graph.listen(PoseWithCovarianceStamped, 'initialpose', 10)
    simulator(graph, announce_pose=True)
    graph.until(lambda: poses)
    assert pose_from(poses[0].pose.pose) == (1.0, 1.0, 0.0)


def test_light_can_be_changed_while_it_runs(graph: Any) -> None:
    node = simulator(graph)
    pictures = graph.listen(Image, 'camera/rgb/image_raw', SENSOR_QOS)
    graph.until(lambda: pictures)
    bright = np.mean(pictures[-1].data)
    from rclpy.parameter import Parameter

    assert node.set_parameters([Parameter('camera.light', value=0.2)])[0].successful
    graph.until(lambda: np.mean(pictures[-1].data) < 0.3 * bright)
    refused = node.set_parameters([Parameter('camera.light', value=-1.0)])[0]
    assert 'camera.light' in refused.reason


@pytest.mark.parametrize(
    ('parameters', 'message'),
    [
        (changed(doors__D=[3.0, 1.0, 0.0, 1.0]), 'simulator: doors.D: (3, 1) with width 1 m'),
        (changed(marker_dictionary='DICT_X'), "simulator: marker dictionary 'DICT_X'"),
    ],
)
def test_it_does_not_start_in_a_wrong_place(
    graph: Any, parameters: dict[str, Any], message: str
) -> None:
    with pytest.raises(ParameterError) as caught:
        graph.add(Simulator, parameters=flat(parameters))
    assert str(caught.value).startswith(message)


def test_it_does_not_start_with_a_wrong_speed(graph: Any) -> None:
    with pytest.raises(ParameterError, match=r'speed: got -1\.0, expected'):
        simulator(graph, speed=-1.0)


def test_at_real_time_it_leaves_the_clock_alone(graph: Any) -> None:
    odometry = graph.listen(Odometry, 'odom', SENSOR_QOS)
    clocks = graph.listen(Clock, '/clock')
    simulator(graph, speed=1.0)
    graph.until(lambda: len(odometry) > 2)
    assert not clocks
    assert odometry[-1].header.stamp.sec > 1_000_000_000


def test_a_second_clock_in_the_domain_is_named_once(graph: Any) -> None:
    said = graph.said()
    graph.node.create_publisher(Clock, '/clock', 1)
    simulator(graph)
    graph.until(lambda: any('publisher(s) of /clock' in line for line in said))


def test_time_stands_while_the_mission_is_at_work(graph: Any) -> None:
    node = simulator(graph, speed=0.0)
    waits = graph.node.create_publisher(Time, 'mission_waits_until', STATE_QOS)
    clocks = graph.listen(Clock, '/clock')
    graph.until(lambda: clocks)
    until = int(node.robot.time) + 30
    waits.publish(Time(sec=until))
    graph.until(lambda: node.robot.time == pytest.approx(until))
    waits.publish(Time(sec=until + 2))
    graph.until(lambda: node.robot.time == pytest.approx(until + 2))


def test_its_frames_are_one_tree_as_tf_wants_it(graph: Any) -> None:
    tf2 = pytest.importorskip('tf2_msgs.msg')
    simulator(graph, **{'robot.frames.base': 'base_footprint'})
    moving = graph.listen(tf2.TFMessage, 'tf', SENSOR_QOS)
    fixed = graph.listen(tf2.TFMessage, 'tf_static', STATE_QOS)
    described = graph.listen(String, 'robot_description', STATE_QOS)
    seen: list[Any] = [
        graph.listen(kind, topic, SENSOR_QOS)
        for kind, topic in (
            (Odometry, 'odom'),
            (LaserScan, 'scan'),
            (Image, 'camera/rgb/image_raw'),
        )
    ]
    graph.until(lambda: fixed and described and len(moving) > 3 and all(seen))
    transforms = [*fixed[0].transforms, *moving[0].transforms]
    parents = {each.child_frame_id: each.header.frame_id for each in transforms}
    # Each frame has one parent, and all lead to the odometry's.
    assert len(parents) == len(transforms)
    for message in seen:
        frame, passed = message[0].header.frame_id, 0
        while frame in parents and passed < 9:
            frame, passed = parents[frame], passed + 1
        assert frame == 'odom'
    assert parents['base_link'] == 'base_footprint'
    for each in transforms:
        q = each.transform.rotation
        assert math.hypot(q.x, q.y, q.z, q.w) == pytest.approx(1.0)
        assert not each.child_frame_id.startswith('/')
    stamps = [seconds_of(message.transforms[0].header.stamp) for message in moving]
    assert stamps == sorted(stamps)
    # The camera looks forwards: its optical z axis is the robot's x axis.
    camera = next(each for each in transforms if 'camera' in each.child_frame_id)
    q = camera.transform.rotation
    assert 2 * (q.x * q.z + q.w * q.y) == pytest.approx(1.0, abs=0.2)
    urdf = ElementTree.fromstring(described[0].data)
    assert {link.attrib['name'] for link in urdf.iter('link')} >= set(parents) - {'base_footprint'}
