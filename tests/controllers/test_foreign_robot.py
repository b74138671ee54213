"""A robot that this project did not build: other names, types, frames, qualities and shapes.

A small simulator of its own stands for its drivers. It drives, lies on its battery, and publishes
as drivers do; the controllers know it by its profile alone."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

import pytest
from geometry_msgs.msg import Twist, TwistStamped
from nav_msgs.msg import OccupancyGrid
from rclpy.qos import DurabilityPolicy, QoSProfile, ReliabilityPolicy
from sensor_msgs.msg import BatteryState, LaserScan

from surveillance_controllers.battery_controller_node import BatteryController
from surveillance_controllers.battery_driver import DriverSettings, doubt, level_from
from surveillance_controllers.collision_monitor_node import CollisionMonitor
from surveillance_controllers.motion_controller_node import MotionController
from surveillance_runtime.configuration import Configuration
from surveillance_runtime.profile import ProfileFile, profile_layer, read_profile

LOSSY = QoSProfile(
    depth=5,
    reliability=ReliabilityPolicy.BEST_EFFORT,
    durability=DurabilityPolicy.VOLATILE,
)
PROFILE = """
topics: {command: base/cmd, wanted: wanted, odom: base/odom, scans: [front, rear], battery: power}
types: {command: TwistStamped}
frames: {odom: odom_combined, base: chassis, scans: [front_laser, rear_laser]}
body: {footprint: [[0.3, 0.2], [-0.3, 0.2], [-0.3, -0.2], [0.3, -0.2]]}
lidars: {mounts: [[0.25, 0, 0], [-0.25, 0, 3.1416]]}
battery: {source: topic}
"""


@pytest.fixture
def profile(tmp_path: Path) -> ProfileFile:
    path = tmp_path / 'robot.yaml'
    path.write_text(PROFILE)
    return read_profile(path)


def parameters(file: ProfileFile, node: str, **more: Any) -> dict[str, Any]:
    """Return what a run gives to a node of a robot with this profile."""
    settings = Configuration((profile_layer(file),)).resolve(node)
    given = {name: each.value for name, each in settings.items() if each.value != []}
    return {**given, 'execution_mode': 'ROBOT', **more}


def battery(percentage: float, status: int = BatteryState.POWER_SUPPLY_STATUS_DISCHARGING) -> Any:
    return BatteryState(percentage=percentage, power_supply_status=status, voltage=11.0)


def test_the_charge_comes_from_a_driver_that_offers_no_more_than_drivers_do(
    graph: Any, profile: ProfileFile
) -> None:
    said = graph.said()
    controller = graph.add(BatteryController, parameters(profile, 'battery_controller'))
    driver = graph.node.create_publisher(BatteryState, 'battery_state', LOSSY)
    assert controller.count_publishers('battery_state') == 1  # the driver alone

    def low(percentage: float) -> bool:
        driver.publish(battery(percentage))
        return any(f'battery low: {100 * percentage:.0f} %' in line for line in said)

    graph.until(lambda: low(0.06))
    assert any('the charge comes from /battery_state' in line for line in said)


@pytest.mark.parametrize(
    ('settings', 'percentage', 'voltage', 'level'),
    [
        (DriverSettings(), 0.5, math.nan, 50.0),
        (DriverSettings(full=100.0), 50.0, math.nan, 50.0),
        (DriverSettings(voltages=(10.0, 0.0, 12.0, 100.0)), math.nan, 11.0, 50.0),
        (DriverSettings(), 1.02, math.nan, 100.0),
        (DriverSettings(), 87.0, math.nan, r'expected 0 to 1; battery.full: 100'),
        (DriverSettings(), math.nan, 11.0, 'battery.voltages in the profile'),
        (DriverSettings(voltages=(10.0, 0.0, 12.0, 100.0)), math.nan, math.nan, 'expected V'),
        (DriverSettings(), -1.0, 11.0, 'expected 0 to 1$'),
        # What a driver leaves out begins at 0.
        (DriverSettings(voltages=(10.0, 0.0, 12.0, 100.0)), 0.0, 11.0, 50.0),
        (DriverSettings(voltages=(10.0, 0.0, 12.0, 100.0)), 0.0, 0.0, 'expected V'),
        (DriverSettings(), 0.0, 0.0, 'as in a message that nobody filled'),
        (DriverSettings(), 0.0, 10.0, 0.0),
    ],
)
def test_drivers_of_several_habits_tell_a_charge_or_why_not(
    settings: DriverSettings, percentage: float, voltage: float, level: Any
) -> None:
    if isinstance(level, str):
        with pytest.raises(ValueError, match=level):
            level_from(percentage, voltage, settings)
    else:
        assert level_from(percentage, voltage, settings) == pytest.approx(level)


def test_a_share_that_is_taken_for_percent_is_doubted() -> None:
    percent = DriverSettings(full=100.0)
    assert 'battery.full is 100 in the profile: expected 1 there' in doubt(0.8, percent)
    assert not any(doubt(each, percent) for each in (0.0, 1.5, 80.0, math.nan))
    assert doubt(0.8, DriverSettings()) == ''


def scan(frame: str, ranges: float, stamp: Any) -> LaserScan:
    message = LaserScan(
        angle_min=-math.pi / 2,
        angle_max=math.pi / 2,
        angle_increment=math.pi / 60,
        range_min=0.05,
        range_max=8.0,
        ranges=[ranges] * 61,
    )
    message.header.frame_id, message.header.stamp = frame, stamp
    return message


def test_its_base_drives_by_stamped_commands_that_both_its_lidars_allow(
    graph: Any, profile: ProfileFile
) -> None:
    monitor = graph.add(CollisionMonitor, parameters(profile, 'collision_monitor'))
    assert isinstance(monitor, CollisionMonitor)
    told = graph.listen(TwistStamped, 'cmd_vel_monitored', 1)
    commands = graph.node.create_publisher(Twist, 'cmd_vel', 1)
    lidars = {
        name: graph.node.create_publisher(LaserScan, name, LOSSY) for name in ('front', 'rear')
    }

    def drives(speed: float, front: float, rear: float) -> bool:
        stamp = graph.node.get_clock().now().to_msg()
        for name, ranges in (('front', front), ('rear', rear)):
            lidars[name].publish(scan(f'{name}_laser', ranges, stamp))
        command = Twist()
        command.linear.x = speed
        commands.publish(command)
        return bool(told) and told[-1].twist.linear.x == pytest.approx(speed, abs=0.01)

    graph.until(lambda: drives(0.2, 5.0, 5.0))
    assert told[-1].header.frame_id == 'chassis'
    assert told[-1].header.stamp.sec > 0
    # What only the rear one sees stops it on its way back.
    graph.until(lambda: drives(-0.2, 0.4, 5.0))
    graph.until(lambda: drives(-0.2, 5.0, 0.1) or abs(told[-1].twist.linear.x) < 0.02)
    graph.until(lambda: abs(told[-1].twist.linear.x) < 0.02 or drives(-0.2, 5.0, 0.1) is None)


def test_what_a_mission_waits_for_is_named(
    graph: Any, profile: ProfileFile, seven_rooms: dict[str, Any]
) -> None:
    said = graph.said()
    graph.node.create_publisher(OccupancyGrid, 'office/map', 1)
    graph.add(MotionController, parameters(profile, 'motion_controller', **seven_rooms))

    def told(text: str) -> bool:
        return any(text in line for line in said)

    graph.until(lambda: told('/map: nobody publishes it'))
    assert told('the nearest that is there is /office/map')
    graph.until(lambda: told('/front: nobody publishes it (sensor_msgs/LaserScan'))
