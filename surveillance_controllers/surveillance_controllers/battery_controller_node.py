"""The node `battery_controller`: says how full the battery is, and charges it.

Publishes `battery_level` (percent), `battery_low`, and its changes alone as `state/battery_low`,
and serves `recharge`. Where the level comes from is the execution mode's matter: the operator
(MANUAL), chance (RANDOM), a model of the battery that watches the robot move and charges at the
station only (SIMULATED), or the driver of a real battery (ROBOT), in whose place the model stands
while it is silent.
"""

from __future__ import annotations

import math
import threading
from collections.abc import Callable, Mapping, Sequence
from functools import partial
from typing import Any, TextIO

from geometry_msgs.msg import PoseWithCovarianceStamped
from rclpy.callback_groups import ReentrantCallbackGroup
from rclpy.qos import QoSProfile
from sensor_msgs.msg import BatteryState
from std_msgs.msg import Bool, Float32, UInt8
from std_srvs.srv import Empty
from trajectory_msgs.msg import JointTrajectory

from floor_plans.parameters import stations_in
from state_machines.ros import ClockWait
from surveillance_controllers import conversions, stimuli
from surveillance_controllers.battery import BatteryInUse, BatteryModel
from surveillance_controllers.battery_driver import DrivenBattery, doubt
from surveillance_controllers.controller_parameters import (
    STATION_NOT_GIVEN,
    BatterySettings,
    battery_settings,
)
from surveillance_controllers.manual.commands import BATTERY, BATTERY_SET, ParsedCommand
from surveillance_controllers.manual.requests import CommandConsole
from surveillance_runtime.conversions import (
    charging_from,
    pose_of_serialized,
    stamp_of_serialized,
    trajectory_from,
)
from surveillance_runtime.incidents import Severity
from surveillance_runtime.node import PatrolNode
from surveillance_runtime.place_changes import follow_place
from surveillance_runtime.process import run_node
from surveillance_runtime.qos import SENSOR_QOS
from surveillance_runtime.sensing.conversions import refusing
from surveillance_runtime.state_file import StateFile
from surveillance_runtime.state_topics import OwnedTopic, StateSubscription
from surveillance_runtime.waiting import AwaitedEvent

STATION = ('station', 'station')
RECHARGE_STEPS = 50
"""Steps in which `recharge` fills an empty battery in MANUAL and RANDOM."""


class BatteryController(PatrolNode):
    """The robot's battery, as its execution mode has it.

    Args:
        console_source: Where the operator's lines come from; standard input unless given.
    """

    def __init__(self, console_source: TextIO | None = None, **node_options: Any) -> None:
        super().__init__('battery_controller', **node_options)
        self._settings = battery_settings(self, self._set_low_below)
        self._mode = self._settings.execution_mode
        self._low_below = self._settings.require_recharge
        self._kept = StateFile(self, self._settings.state_file)
        kept = self._kept.number('level')
        level = self._settings.initial_value if kept is None else min(100.0, max(0.0, kept))
        self._battery = BatteryModel(self._settings.model, level)
        self._wait = ClockWait(self)
        self._lock = threading.RLock()
        self._said: tuple[int, bool] | None = None
        self._level_topic = OwnedTopic(self, UInt8, 'battery_level')
        self._low_topic = OwnedTopic(self, Bool, 'battery_low')
        # The seeds' machine takes each message for a change: a repeated True would trap it on its
        # way to the station.
        self._change_topic = OwnedTopic(self, Bool, 'state/battery_low', repeat=None)
        self._recharging = False
        self._recharged = AwaitedEvent(self)
        group = ReentrantCallbackGroup()
        self.create_service(Empty, 'recharge', self._on_recharge, callback_group=group)
        self._console: CommandConsole[None] = CommandConsole(
            self, BATTERY, self._carry_out, self._status
        )
        self._change(lambda: None)
        self.get_logger().info(f'{self._mode} mode, battery at {self._battery.percent} %')
        if self._mode == 'MANUAL' and self._settings.console:
            self._console.open(console_source)
        elif self._mode == 'RANDOM':
            self.spawn(self._switch_at_random)
        elif self._settings.drives:
            since = self._kept.number('time')
            self._robot = RobotBattery(self, self._settings, self._battery, self._change, since)

    def _change(self, change: Callable[[], None]) -> None:
        """Change the charge and publish what became different."""
        with self._lock:
            change()
            said = self._battery.percent, self._battery.level < self._low_below
            before, self._said = self._said, said
            self._kept.save({'level': self._battery.level, 'time': self._wait.now()})
            if before is None or said[0] != before[0]:
                self._level_topic.publish(UInt8(data=said[0]))
            if before is None or said[1] != before[1]:
                self._low_topic.publish(Bool(data=said[1]))
                self._change_topic.publish(Bool(data=said[1]))
                word = 'low' if said[1] else 'not low'
                self.get_logger().info(
                    f'battery {word}: {said[0]} % (low below {self._low_below} %)'
                )

    def _set_low_below(self, percent: int) -> None:
        self._low_below = percent
        self._change(lambda: None)

    def _set_level(self, level: float) -> None:
        self._change(partial(self._battery.set_level, level))

    def _carry_out(self, command: ParsedCommand) -> str:
        (value,) = command.values
        assert isinstance(value, int)
        with self._lock:
            base = 0.0 if command.name == BATTERY_SET.name else self._battery.level
            self._set_level(base + value)
        return self._status()

    def _status(self) -> str:
        return f'The battery is at {self._battery.percent} %.'

    def _switch_at_random(self) -> None:
        draw = stimuli.generator(self._settings.random_seed)
        while self._wait.sleep(draw.uniform(*self._settings.random_battery_time), self.stopping):
            self._set_level(100.0 if self._battery.percent == 0 else 0.0)

    async def _on_recharge(self, _request: Any, response: Any) -> Any:
        with self._lock:
            recharged = self._recharged.next_time()
            first, self._recharging = not self._recharging, True
        if first:
            self.spawn(self._recharge)
        await recharged
        return response

    def _recharge(self) -> None:
        # Only here: a node that is never asked to recharge starts without the import.
        from surveillance_controllers.manual.terminal import charge_display

        charge = self._await_full if self._settings.drives else self._fill
        try:
            say, bar = self.get_logger().info, not self._console.has_terminal
            with charge_display(self._battery.level, say, bar=bar) as show:
                charge(show)
        finally:
            with self._lock:
                self._recharging = False
                self._recharged.happen()

    def _fill(self, show: Callable[[float], None]) -> None:
        pause = self._settings.recharge_seconds / RECHARGE_STEPS
        while self._battery.level < 100.0 and self._wait.sleep(pause, self.stopping):
            with self._lock:
                self._set_level(self._battery.level + 100.0 / RECHARGE_STEPS)
            show(self._battery.level)

    def _await_full(self, show: Callable[[float], None]) -> None:
        asked_at = self._wait.elapsed()
        while self._battery.level < 100.0:
            problem = self._robot.why_not_charging(asked_at)
            if problem is not None:
                self.get_logger().warn(f'recharge: {problem}; it is at {self._battery.percent} %')
                return
            if not self._wait.sleep(self._settings.update_period, self.stopping):
                return
            show(self._battery.level)


class RobotBattery:
    """Lets a battery drain and charge with the robot, in the modes SIMULATED and ROBOT.

    Reads `amcl_pose` (how far the robot drove, and whether it stands at the station),
    `arm/joint_trajectory` (how long its arm moves) and `battery_drain`; publishes `battery_state`,
    unless that is a driver's: then it reads it, and the model counts while the driver is silent.

    Args:
        node: The battery controller's node.
        settings: The stations, and how often the model is stepped.
        battery: The battery.
        change: Carries out a change of the battery and publishes what became different.
        since: When the battery had its level, seconds; None: it has it now.
    """

    def __init__(
        self,
        node: PatrolNode,
        settings: BatterySettings,
        battery: BatteryModel,
        change: Callable[[Callable[[], None]], None],
        since: float | None = None,
    ) -> None:
        self._node = node
        self._battery = battery
        self._change = change
        self._wait = ClockWait(node)
        if since is not None:
            # From then on no setting of the clock counts.
            since += self._wait.elapsed() - self._wait.now()
        self._low_below = settings.require_recharge
        self._stations = settings.stations
        self._use = BatteryInUse(battery, settings.stations, settings.dock_reach, since)
        follow_place(node, self._take_place)
        self._driver: DrivenBattery | None = None
        self._states: OwnedTopic[BatteryState] | None = None
        self._begun = self._wait.elapsed()
        self._speaks: bool | None = None
        if settings.execution_mode != 'ROBOT':
            self._states = OwnedTopic(node, BatteryState, 'battery_state', repeat=None)
        elif settings.driver.source == 'topic':
            self._driver, self._settings = DrivenBattery(settings.driver), settings.driver
            self._timeout = settings.driver.timeout
            self._topic = str(node.resolve_topic_name('battery_state'))
            # As a driver publishes: its messages are not kept, and may get lost.
            StateSubscription(
                node, BatteryState, 'battery_state', self._on_driver, each=True, qos=SENSOR_QOS
            )
        else:
            # On a real robot the topic is a driver's, even where nobody reads it.
            node.get_logger().warn(
                'the charge is computed from the way driven: the profile says battery.source: model'
            )
        StateSubscription(
            node,
            PoseWithCovarianceStamped,
            'amcl_pose',
            self._on_pose,
            raw=True,
            stamp=stamp_of_serialized,
            owner='motion_controller',
        )
        node.create_subscription(JointTrajectory, 'arm/joint_trajectory', self._on_trajectory, 1)
        StateSubscription(
            node,
            Float32,
            'battery_drain',
            self._on_drain,
            each=True,
            qos=QoSProfile(depth=10),
            owner='simulator',
        )
        node.create_timer(settings.update_period, self._update)

    def _take_place(self, described: Mapping[str, Any]) -> None:
        """Take the stations of a place that was changed."""
        self._stations = stations_in(described)
        self._use.take_stations(self._stations)

    def why_not_charging(self, asked_at: float) -> str | None:
        """Say why the battery cannot charge now, as was asked at a time, s; None when it can."""
        now = self._wait.elapsed()
        if self._driver is not None and self._driver.speaks(now):
            return self._driver.why_not_charging(asked_at, now)
        return self._use.why_not_charging()

    def _on_driver(self, message: BatteryState) -> None:
        driver, now = self._driver, self._wait.elapsed()
        assert driver is not None
        with refusing(self._node, self._topic):
            charging = charging_from(message)
            driver.hear(message.percentage, message.voltage, charging, now, present=message.present)
            if hint := doubt(message.percentage, self._settings):
                self._node.get_logger().warn(f'{self._topic}: {hint}', once=True)
            self._take_driver(driver, now)

    def _take_driver(self, driver: DrivenBattery, now: float) -> bool:
        """Take the charge from the driver, unless it is silent; say so when that changes."""
        speaks = driver.speaks(now)
        if not speaks and now - self._begun < self._timeout and self._speaks is None:
            return False  # It may still start.
        if speaks != self._speaks:
            self._speaks = speaks
            if speaks:
                self._node.get_logger().info(f'the charge comes from {self._topic}')
            else:
                self._node.get_logger().warn(
                    f'nothing of use on {self._topic} for {self._timeout:g} s: the charge is '
                    'computed from the way driven'
                )
        if speaks and driver.level is not None:
            self._change(partial(self._battery.set_level, driver.level))
        return speaks

    def _on_pose(self, serialized: bytes) -> None:
        with refusing(self._node, 'amcl_pose'):
            self._use.see_pose(pose_of_serialized(serialized), self._wait.elapsed())

    def _on_trajectory(self, message: JointTrajectory) -> None:
        self._use.move_arm(*trajectory_from(message), self._wait.elapsed())

    def _on_drain(self, message: Float32) -> None:
        # What is no number drains nothing.
        percent = max(0.0, float(message.data)) if math.isfinite(message.data) else 0.0
        self._change(lambda: self._battery.set_level(self._battery.level - percent))

    def _look_for_station(self) -> None:
        """Tell of a low battery that no station can charge, because none was given."""
        if self._use.docked or self._stations is not STATION_NOT_GIVEN:
            self._node.incidents.end(STATION)
        elif self._battery.level < self._low_below:
            self._node.incidents.begin(
                STATION,
                'no `station` in the place file: it is taken for (0, 0), and the battery is low',
                Severity.ALARM,
            )

    def _update(self) -> None:
        now = self._wait.elapsed()
        if self._driver is not None and self._take_driver(self._driver, now):
            self._use.skip(now)
            return
        self._change(partial(self._use.advance, now))
        self._look_for_station()
        if self._states is None:
            return
        state = conversions.battery_state(self._battery, charging=self._use.docked)
        state.header.stamp = self._node.get_clock().now().to_msg()
        self._states.publish(state)


def main(args: Sequence[str] | None = None) -> int:
    """Run the node until it is stopped."""
    return run_node(BatteryController, args)
