"""The battery for `battery_controller` in SIMULATED mode: fed by what the robot reports, as topics.

Reads `amcl_pose` (how far the robot drove, and whether it stands at the station), `joint_states`
(whether its arm moves) and `battery_drain`; publishes `battery_state`.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from functools import partial

from geometry_msgs.msg import PoseWithCovarianceStamped
from sensor_msgs.msg import BatteryState, JointState
from std_msgs.msg import Float32

from surveillance_controllers import conversions
from surveillance_controllers.battery.model import Battery
from surveillance_controllers.battery.use import BatteryInUse
from surveillance_controllers.controller_parameters import BatterySettings
from surveillance_runtime.node import PatrolNode
from surveillance_runtime.qos import SENSOR_QOS, STATE_QOS
from surveillance_runtime.waiting import ClockWait


class RobotBattery:
    """Lets a battery drain and charge with the robot.

    Args:
        node: The battery controller's node.
        settings: The station, and how often the model is stepped.
        battery: The battery.
        change: Carries out a change of the battery and publishes what became different.
        since: When the battery had its level, seconds; None: it has it now.
    """

    def __init__(
        self,
        node: PatrolNode,
        settings: BatterySettings,
        battery: Battery,
        change: Callable[[Callable[[], None]], None],
        since: float | None = None,
    ) -> None:
        self._node = node
        self._battery = battery
        self._change = change
        self._wait = ClockWait(node)
        self._use = BatteryInUse(battery, settings.station, settings.dock_reach, since)
        self._states = node.create_publisher(BatteryState, 'battery_state', STATE_QOS)
        node.create_subscription(PoseWithCovarianceStamped, 'amcl_pose', self._on_pose, STATE_QOS)
        node.create_subscription(JointState, 'joint_states', self._on_joints, SENSOR_QOS)
        node.create_subscription(Float32, 'battery_drain', self._on_drain, 10)
        node.create_timer(settings.update_period, self._update)

    def why_not_charging(self) -> str | None:
        """Says why the battery cannot charge now; None when it can."""
        return self._use.why_not_charging()

    def _on_pose(self, message: PoseWithCovarianceStamped) -> None:
        try:
            self._use.see_pose(conversions.pose_from(message.pose.pose), self._wait.now())
        except ValueError as error:
            self._node.get_logger().error(f'amcl_pose: {error}')

    def _on_joints(self, message: JointState) -> None:
        self._use.see_joints(message.position)

    def _on_drain(self, message: Float32) -> None:
        # What is no number drains nothing.
        percent = max(0.0, float(message.data)) if math.isfinite(message.data) else 0.0
        self._change(lambda: self._battery.set_level(self._battery.level - percent))

    def _update(self) -> None:
        self._change(partial(self._use.advance, self._wait.now()))
        state = conversions.battery_state(self._battery, charging=self._use.docked)
        state.header.stamp = self._node.get_clock().now().to_msg()
        self._states.publish(state)
