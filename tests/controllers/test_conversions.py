"""Messages and core types: what goes out comes back the same, and unsound messages are refused."""

from __future__ import annotations

import math

import numpy as np
import pytest
from builtin_interfaces.msg import Time
from geometry_msgs.msg import Quaternion, Transform, Vector3
from hypothesis import given, settings
from hypothesis import strategies as st
from nav_msgs.msg import OccupancyGrid
from sensor_msgs.msg import BatteryState, LaserScan, PointCloud2, PointField
from std_msgs.msg import Header

from lidar_navigation import Velocity
from lidar_navigation.geometry import Mount
from surveillance_controllers import conversions
from surveillance_controllers.battery import BatteryModel, BatteryParameters
from surveillance_runtime.conversions import (
    cloud_from_points,
    point_message,
    point_messages,
    points_from_cloud,
    pose_estimate,
    pose_from,
    pose_message,
    values_from_cloud,
)
from surveillance_runtime.sensing.conversions import LONGEST_RANGE, matrix_from, scan_from

NUMBER = st.floats(-1e4, 1e4)
YAW = st.floats(-3.1, 3.1)


@given(st.lists(st.tuples(NUMBER, NUMBER, NUMBER), max_size=6))
@settings(max_examples=40)
def test_points_come_back(points: list[tuple[float, float, float]]) -> None:
    messages = point_messages(np.array(points).reshape(-1, 3))
    assert conversions.array_from_points(messages).tolist() == [list(p) for p in points]


def test_a_point_in_the_plane_has_no_height() -> None:
    point = point_message((1, 2))
    assert (point.x, point.y, point.z) == (1.0, 2.0, 0.0)


@given(NUMBER, NUMBER, YAW)
@settings(max_examples=40)
def test_poses_come_back(x: float, y: float, yaw: float) -> None:
    pose = pose_from(pose_message((x, y, yaw)))
    assert pose == pytest.approx((x, y, yaw))
    estimate = pose_estimate((x, y, yaw), 0.5, 0.1)
    assert pose_from(estimate.pose) == pytest.approx((x, y, yaw))
    assert estimate.covariance[0] == 0.25
    assert estimate.covariance[35] == pytest.approx(0.01)


@given(st.lists(st.tuples(st.floats(-99, 99), st.floats(-99, 99)), max_size=6))
@settings(max_examples=40)
def test_clouds_come_back(points: list[tuple[float, float]]) -> None:
    array = np.array(points).reshape(-1, 2)
    stays = array[:, 0] > 0
    cloud = cloud_from_points(array, 'office', stays=stays)
    assert cloud.header.frame_id == 'office'
    assert cloud.width == len(points)
    assert points_from_cloud(cloud) == pytest.approx(array, abs=1e-4)
    assert np.array_equal(values_from_cloud(cloud, 'stays'), stays)  # type: ignore[arg-type]
    assert values_from_cloud(cloud, 'intensity') is None


def test_a_cloud_is_exact_in_coordinates_of_utm() -> None:
    points = np.array([[499_999.137, 9_999_999.061], [-3.2, 1e7 + 0.07]])
    assert np.abs(points_from_cloud(cloud_from_points(points)) - points).max() < 1e-6


def test_a_cloud_of_doubles_is_read() -> None:
    cloud = PointCloud2(width=1, height=1, point_step=16)
    cloud.fields = [
        PointField(name=name, offset=8 * index, datatype=PointField.FLOAT64, count=1)
        for index, name in enumerate('xy')
    ]
    cloud.data.frombytes(np.array([9_999_999.061, 0.1]).tobytes())
    assert points_from_cloud(cloud).tolist() == [[9_999_999.061, 0.1]]


def test_a_cloud_without_coordinates_is_refused() -> None:
    with pytest.raises(ValueError, match='a cloud without x and y'):
        points_from_cloud(PointCloud2(width=1, height=1, point_step=4))


def grid_message(width: int, height: int, cells: int) -> OccupancyGrid:
    message = OccupancyGrid()
    message.info.width, message.info.height = width, height
    message.info.resolution = 0.5
    message.info.origin.position.x, message.info.origin.position.y = -1.0, 2.0
    message.info.origin.orientation.w = 1.0
    message.data = [100 if index == 1 else 0 for index in range(cells)]
    return message


def test_a_map_is_read_row_by_row_from_its_south_west_corner() -> None:
    grid = conversions.grid_from(grid_message(3, 2, 6))
    assert grid.cells.tolist() == [[0, 100, 0], [0, 0, 0]]
    assert grid.resolution == 0.5
    assert grid.cells_of((-0.3, 2.1)).tolist() == [[0, 1]]


def test_unsound_maps_are_refused() -> None:
    with pytest.raises(ValueError, match='a map of 5 cells: expected 3 x 2 of them'):
        conversions.grid_from(grid_message(3, 2, 5))
    with pytest.raises(ValueError, match='a map of 0 x 2 cells: expected at least one'):
        conversions.grid_from(grid_message(0, 2, 0))


def test_a_scan_tells_what_was_met_what_was_not_and_what_is_not_known() -> None:
    message = LaserScan(angle_min=-1.0, angle_increment=0.5, range_min=0.125, range_max=8.0)
    message.ranges = [0.5, math.inf, 8.5, math.nan, 0.0, -math.inf]
    scan = scan_from(message)
    assert scan.angles == pytest.approx([-1, -0.5, 0, 0.5, 1, 1.5])
    np.testing.assert_array_equal(scan.ranges, [0.5, math.inf, math.inf, math.nan, math.nan, 0.001])
    near, nearer = (0.5 * math.cos(-1), 0.5 * math.sin(-1)), (0.0, 0.001)
    assert scan.points == pytest.approx(np.array([near, nearer]), abs=1e-3)


@pytest.mark.parametrize('near', [-math.inf, 0.06])
def test_a_lidar_that_sees_its_own_robot_tells_nothing_of_it(near: float) -> None:
    message = LaserScan(angle_increment=math.pi / 2, range_min=0.125, range_max=8.0)
    message.ranges = [near] * 4
    scan = scan_from(message, Mount((0.15, 0.0, 0.0)), radius=0.2)
    assert scan.points == pytest.approx(np.array([[0.2 if near < 0 else 0.21, 0.0]]))
    assert np.isnan(scan.ranges[1:]).all(), 'beside and behind it there is the robot'


@pytest.mark.parametrize('told', [0, 17, 18])
def test_a_lidar_that_is_covered_or_broken_is_refused(told: int) -> None:
    message = LaserScan(angle_increment=0.01, range_max=8.0)
    message.ranges = [math.inf] * told + [0.0, math.nan] * ((360 - told) // 2) + [0.0] * (told % 2)
    if told >= 18:
        assert np.isinf(scan_from(message).ranges).sum() == told
    else:
        with pytest.raises(ValueError, match='may be covered or broken'):
            scan_from(message)


def test_a_lidar_that_turns_clockwise_is_read_the_other_way_round() -> None:
    message = LaserScan(angle_min=1.0, angle_increment=-0.5, range_max=8.0, ranges=[1.0, 2.0, 3.0])
    scan = scan_from(message)
    assert scan.angles == pytest.approx([0.0, 0.5, 1.0])
    assert scan.ranges.tolist() == [3.0, 2.0, 1.0]


def test_a_lidar_that_hangs_upside_down_is_read_the_other_way_round() -> None:
    message = LaserScan(angle_min=0.0, angle_increment=0.5, range_max=8.0, ranges=[1.0, 2.0, 3.0])
    scan = scan_from(message, Mount((0.2, 0.0, 0.5), upside_down=True))
    assert scan.angles == pytest.approx([-1.0, -0.5, 0.0])
    assert scan.ranges.tolist() == [3.0, 2.0, 1.0]
    assert scan.points[1] == pytest.approx((2.2, 0.0))


def test_a_velocity_is_a_twist() -> None:
    twist = conversions.twist_from(Velocity(0.5, -1.0))
    assert (twist.linear.x, twist.angular.z, twist.linear.y) == (0.5, -1.0, 0.0)


@pytest.mark.parametrize(
    ('level', 'charging', 'status'),
    [
        (50, False, BatteryState.POWER_SUPPLY_STATUS_DISCHARGING),
        (50, True, BatteryState.POWER_SUPPLY_STATUS_CHARGING),
        (100, True, BatteryState.POWER_SUPPLY_STATUS_FULL),
    ],
)
def test_a_battery_s_state_is_told(level: float, charging: bool, status: int) -> None:
    battery = BatteryModel(BatteryParameters(), level)
    state = conversions.battery_state(battery, charging=charging)
    assert state.percentage == pytest.approx(level / 100)
    assert state.power_supply_status == status
    assert state.charge == pytest.approx(state.capacity * level / 100)
    assert math.isnan(state.current) == (status != BatteryState.POWER_SUPPLY_STATUS_CHARGING)


def scan_message(**fields: object) -> LaserScan:
    sound: dict[str, object] = {
        'angle_min': -1.0,
        'angle_increment': 0.1,
        'range_max': 8.0,
        'ranges': [1.0] * 20,
    }
    return LaserScan(**{**sound, **fields})


@pytest.mark.parametrize(
    ('fields', 'text'),
    [
        ({'ranges': []}, 'a scan of 0 rays: expected 1'),
        ({'angle_min': math.nan}, 'expected one turn'),
        ({'angle_increment': math.inf}, 'expected one turn'),
        ({'angle_increment': 5.0}, 'expected one turn'),
        ({'angle_increment': 0.0}, 'expected one turn'),
        ({'range_max': math.nan}, 'reaches farther than 0 m'),
        ({'range_max': -1.0}, 'reaches farther than 0 m'),
        ({'header': Header(stamp=Time(sec=-1))}, 'made at -1 s'),
    ],
)
def test_a_scan_that_is_no_lidar_s_is_refused(fields: dict[str, object], text: str) -> None:
    with pytest.raises(ValueError, match=text):
        scan_from(scan_message(**fields))


def test_a_reach_without_end_is_cut() -> None:
    scan = scan_from(scan_message(range_max=math.inf))
    assert scan.range_max == LONGEST_RANGE
    assert len(scan.points) == 20


@pytest.mark.parametrize('x', [math.nan, math.inf, -1e308])
def test_a_pose_that_is_none_is_refused(x: float) -> None:
    message = pose_message((0.0, 0.0, 0.0))
    message.position.x = x
    with pytest.raises(ValueError, match='a pose'):
        pose_from(message)


def test_a_map_too_large_or_without_size_is_refused() -> None:
    message = grid_message(2, 2, 4)
    message.info.width = message.info.height = 2**31
    with pytest.raises(ValueError, match='expected at most'):
        conversions.grid_from(message)
    message = grid_message(2, 2, 4)
    message.info.resolution = math.nan
    with pytest.raises(ValueError, match='a map of nan m a cell'):
        conversions.grid_from(message)


def test_a_transform_is_a_matrix_and_an_unsound_one_is_refused() -> None:
    turned = Transform(translation=Vector3(x=0.2, y=-0.1), rotation=Quaternion(z=2.0, w=2.0))
    matrix = matrix_from(turned)
    assert matrix @ (1.0, 0.0, 0.0, 1.0) == pytest.approx((0.2, 0.9, 0.0, 1.0))
    for unsound in (Quaternion(w=0.0), Quaternion(w=math.inf)):
        with pytest.raises(ValueError, match='a transform that is none'):
            matrix_from(Transform(rotation=unsound))


@pytest.mark.parametrize('size', [0.0, 0.5, 3.0, 1e200])
def test_a_turn_of_another_length_is_the_same_turn(size: float) -> None:
    message = pose_message((1.0, 2.0, 0.7))
    turn = message.orientation
    turn.z, turn.w = turn.z * size, turn.w * size
    assert pose_from(message) == pytest.approx((1.0, 2.0, 0.7 if size else 0.0))
