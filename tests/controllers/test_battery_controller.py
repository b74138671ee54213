"""The node `battery_controller` in its three modes, with real messages and a scripted operator."""

from __future__ import annotations

import itertools
from typing import Any

import pytest
from geometry_msgs.msg import PoseWithCovarianceStamped
from sensor_msgs.msg import BatteryState
from std_msgs.msg import Bool, UInt8
from std_srvs.srv import Empty

from state_machines.ros import ServiceCaller
from surveillance_controllers.battery_controller_node import BatteryController
from surveillance_interfaces.srv import ConsoleCommand
from surveillance_runtime.qos import STATE_QOS


def values(messages: list[Any]) -> list[Any]:
    return [message.data for message in messages]


def test_manual_commands_set_the_level_and_the_low_state(
    graph: Any, operator: Any, capfd: Any
) -> None:
    node = graph.add(
        BatteryController,
        {'execution_mode': 'MANUAL', 'battery_initial_value': 50},
        console_source=operator.source,
    )
    levels = graph.listen(UInt8, 'battery_level', STATE_QOS)
    lows = graph.listen(Bool, 'state/battery_low', STATE_QOS)
    graph.until(lambda: values(levels)[-1:] == [50] and values(lows) == [False])
    operator.type('battery set 15')
    graph.until(lambda: values(levels)[-1:] == [15] and values(lows) == [False, True])
    operator.type('battery set hundred')
    operator.type('battery offset -5')
    graph.until(lambda: values(levels)[-1:] == [10])
    operator.type('battery offset 95')
    graph.until(lambda: values(levels)[-1:] == [100] and values(lows) == [False, True, False])
    node.stop()  # what is still printed while capfd reads would be written over what it reads
    shown = capfd.readouterr().out
    assert "battery set: VALUE is 'hundred': expected a whole number from 0 to 100" in shown
    assert node.failure is None


def test_a_repeated_low_level_is_not_published_again(graph: Any, operator: Any) -> None:
    graph.add(BatteryController, {'execution_mode': 'MANUAL'}, console_source=operator.source)
    levels = graph.listen(UInt8, 'battery_level', STATE_QOS)
    lows = graph.listen(Bool, 'state/battery_low', STATE_QOS)
    graph.until(lambda: lows and levels)
    for level in (9, 8, 8, 7):
        operator.type(f'battery set {level}')
    graph.until(lambda: values(levels)[-1:] == [7] and len(lows) > 1)
    assert values(lows) == [False, True]


def test_end_of_input_leaves_the_node_at_work(graph: Any, operator: Any) -> None:
    graph.add(BatteryController, {'execution_mode': 'MANUAL'}, console_source=operator.source)
    operator.hang_up()
    levels = graph.listen(UInt8, 'battery_level', STATE_QOS)
    caller = ServiceCaller(graph.node, ConsoleCommand, 'battery_controller/command')
    answer = caller.call(ConsoleCommand.Request(line='battery set 33'), 60.0)
    assert answer.accepted
    assert answer.answer == 'The battery is at 33 %.'
    graph.until(lambda: values(levels)[-1:] == [33])
    answer = caller.call(ConsoleCommand.Request(line='move 1 2'), 60.0)
    assert not answer.accepted
    assert answer.answer.startswith("'move' is no command: expected one of battery, ")


def test_exit_ends_the_node_without_a_failure(graph: Any, operator: Any) -> None:
    node = graph.add(
        BatteryController, {'execution_mode': 'MANUAL'}, console_source=operator.source
    )
    operator.type('exit')
    assert node.ended.wait(60.0)
    assert node.failure is None


def test_random_levels_switch_between_empty_and_full(graph: Any) -> None:
    graph.add(
        BatteryController,
        {'execution_mode': 'RANDOM', 'random_seed': 1, 'random_battery_time': [0.02, 0.03]},
    )
    levels = graph.listen(UInt8, 'battery_level', STATE_QOS)
    graph.until(lambda: len(levels) >= 4)
    seen = values(levels)
    assert set(seen) == {0, 100}
    assert all(a != b for a, b in itertools.pairwise(seen))


def test_recharge_answers_when_full_and_logs_lines_without_a_terminal(graph: Any) -> None:
    said = graph.said()
    graph.add(
        BatteryController,
        {
            'execution_mode': 'MANUAL',
            'console': False,
            'battery_initial_value': 35,
            'recharge_seconds': 0.05,
        },
    )
    levels = graph.listen(UInt8, 'battery_level', STATE_QOS)
    ServiceCaller(graph.node, Empty, 'recharge').call(Empty.Request(), 60.0)
    graph.until(lambda: values(levels)[-1:] == [100])
    # By the node's logger, which has a rate: who asks again and again does not fill the disk.
    graph.until(lambda: any(line == 'Charging: 100 %' for line in said))
    shown = [line for line in said if line.startswith('Charging')]
    assert shown == [f'Charging: {percent} %' for percent in range(30, 101, 10)]


def test_the_low_bound_can_be_changed_at_run_time(graph: Any) -> None:
    from rclpy.parameter import Parameter

    node = graph.add(
        BatteryController,
        {'execution_mode': 'MANUAL', 'console': False, 'battery_initial_value': 30},
    )
    lows = graph.listen(Bool, 'state/battery_low', STATE_QOS)
    graph.until(lambda: values(lows) == [False])
    assert node.set_parameters([Parameter('battery_require_recharge', value=40)])[0].successful
    graph.until(lambda: values(lows) == [False, True])


def pose_at(x: float, y: float) -> PoseWithCovarianceStamped:
    message = PoseWithCovarianceStamped()
    message.pose.pose.position.x = x
    message.pose.pose.position.y = y
    message.pose.pose.orientation.w = 1.0
    return message


def test_the_simulated_battery_drains_and_charges_only_at_the_station(graph: Any) -> None:
    graph.add(
        BatteryController,
        {
            'execution_mode': 'SIMULATED',
            'battery_initial_value': 90,
            'battery.capacity': 0.05,
            'battery.charging_power': 3000.0,
            'battery_update_period': 0.02,
            'station': [1.0, 2.0, 0.0],
        },
    )
    states = graph.listen(BatteryState, 'battery_state', STATE_QOS)
    poses = graph.node.create_publisher(PoseWithCovarianceStamped, 'amcl_pose', STATE_QOS)
    recharge = ServiceCaller(graph.node, Empty, 'recharge')

    poses.publish(pose_at(5.0, 2.0))
    graph.until(lambda: states and states[-1].percentage < 0.9)
    away = states[-1]
    assert away.power_supply_status == BatteryState.POWER_SUPPLY_STATUS_DISCHARGING
    recharge.call(Empty.Request(), 60.0)
    assert states[-1].percentage < 0.9

    poses.publish(pose_at(1.2, 2.1))
    recharge.call(Empty.Request(), 60.0)
    graph.until(lambda: states[-1].power_supply_status == BatteryState.POWER_SUPPLY_STATUS_FULL)
    assert states[-1].percentage == pytest.approx(1.0)


@pytest.mark.parametrize(
    ('parameters', 'text'),
    [
        ({'execution_mode': 'AUTO'}, "parameter execution_mode: got 'AUTO', expected one of"),
        ({'battery_initial_value': 101}, 'parameter battery_initial_value: got 101, expected'),
        ({'battery_initial_value': 'full'}, "got 'full', expected an integer from 0 to 100"),
        ({'random_battery_time': [5.0]}, 'got [5.0], expected two numbers above 0'),
        ({'battery.taper_from': 1.5}, 'parameter battery.taper_from is 1.5: expected between'),
        ({'station': [1.0]}, 'parameter station: got [1.0], expected three numbers'),
    ],
)
def test_bad_parameters_are_named(graph: Any, parameters: dict[str, Any], text: str) -> None:
    from surveillance_runtime.parameters import ParameterError

    with pytest.raises(ParameterError) as caught:
        graph.add(BatteryController, parameters)
    assert text in str(caught.value)


@pytest.mark.parametrize('mode', ['MANUAL', 'SIMULATED'])
def test_a_level_outlives_a_process_that_was_killed(graph: Any, tmp_path: Any, mode: str) -> None:
    path = tmp_path / 'battery.json'
    options = {'execution_mode': mode, 'console': False, 'state_file': str(path)}
    first = graph.add(BatteryController, {**options, 'battery_initial_value': 68})
    graph.until(lambda: path.exists() and '68' in path.read_text())
    graph.drop(first)
    levels = graph.listen(UInt8, 'battery_level', STATE_QOS)
    graph.add(BatteryController, {**options, 'battery_initial_value': 100})
    graph.until(lambda: values(levels)[-1:] == [68])


@pytest.mark.parametrize(
    'content', ['', '[]', '{"level": NaN}', '{"level": "full"}', 'x' * 20_000, '[' * 9_000]
)
def test_a_state_that_cannot_be_read_begins_anew(graph: Any, tmp_path: Any, content: str) -> None:
    path = tmp_path / 'battery.json'
    path.write_text(content)
    levels = graph.listen(UInt8, 'battery_level', STATE_QOS)
    graph.add(
        BatteryController,
        {
            'execution_mode': 'MANUAL',
            'console': False,
            'state_file': str(path),
            'battery_initial_value': 42,
        },
    )
    graph.until(lambda: values(levels)[-1:] == [42])
