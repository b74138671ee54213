"""The services through which a test or a demonstration makes things go wrong."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from typing import Any

import rclpy.node
from rclpy.publisher import Publisher
from rclpy.qos import QoSProfile
from std_msgs.msg import Float32

from floor_plans import PlaceError
from surveillance_interfaces.srv import (
    ConsoleCommand,
    DrainBattery,
    PlaceObstacle,
    PushRobot,
    RemoveObstacle,
    SetDoor,
    SetMarker,
    SlipOdometry,
)
from surveillance_simulation import conversions
from surveillance_simulation.feeds.sensor_feed import topic_of
from surveillance_simulation.robot.robot import Robot
from surveillance_simulation.robot.robots import Robots
from surveillance_simulation.staging import Stage
from surveillance_simulation.world.textures import marker_panel

LONGEST_SHIFT = 1000.0
"""The longest push or slip, metres or rad; longer than any place."""


class FaultServices:
    """Offers the services below `simulation/` on a node.

    What happens to the place is asked for there, what happens to one robot of several below its
    name.
    """

    def __init__(
        self,
        node: rclpy.node.Node,
        robots: Robots,
        stage: Stage,
        changing: Any,
        on_change: Callable[[], None],
        now: Callable[[], float],
    ) -> None:
        """Create the services.

        Args:
            node: The node that offers them.
            robots: The robots in their world, which they change.
            stage: Carries out lines on them, and keeps the truth.
            changing: Lock to hold during a change.
            on_change: Called after each change.
            now: Returns the time of the nodes' clock, seconds.
        """
        self._node = node
        self._world = robots.world
        self._stage = stage
        self._now = now
        self._changing = changing
        self._on_change = on_change
        for name, kind, change in (
            ('set_door', SetDoor, self._set_door),
            ('place_obstacle', PlaceObstacle, self._place_obstacle),
            ('remove_obstacle', RemoveObstacle, self._remove_obstacle),
            ('set_marker', SetMarker, self._set_marker),
        ):
            node.create_service(kind, f'simulation/{name}', self._answered(change))
        node.create_service(ConsoleCommand, 'simulation/stage', self._on_stage)
        for robot in robots.robots:
            drained = node.create_publisher(
                Float32, topic_of(robot, 'battery_drain'), QoSProfile(depth=10)
            )
            for name, kind, change in (
                ('push_robot', PushRobot, partial(_push_robot, robot)),
                ('slip_odometry', SlipOdometry, partial(_slip_odometry, robot)),
                ('drain_battery', DrainBattery, partial(_drain_battery, drained)),
            ):
                service = topic_of(robot, f'simulation/{name}')
                node.create_service(kind, service, self._answered(change))

    def _answered(self, change: Callable[[Any], str]) -> Callable[[Any, Any], Any]:
        def answer(request: Any, response: Any) -> Any:
            try:
                with self._changing:
                    response.message = change(request)
                response.success = True
            except PlaceError as error:
                response.success, response.message = False, str(error)
            self._node.get_logger().info(response.message)
            if response.success:
                self._stage.note('', {'text': response.message}, self._now())
                self._on_change()
            return response

        return answer

    def _on_stage(self, request: Any, response: Any) -> Any:
        try:
            with self._changing:
                response.answer = self._stage.do(request.line[:1000], self._now())
            response.accepted = True
        except PlaceError as error:
            response.answer = str(error)
        self._node.get_logger().info(response.answer)
        if response.accepted:
            self._on_change()
        return response

    def _set_door(self, request: SetDoor.Request) -> str:
        return self._stage.do(
            f'door {request.door} {"open" if request.open else "closed"}', self._now()
        )

    def _place_obstacle(self, request: PlaceObstacle.Request) -> str:
        self._world.place_obstacle(request.name, request.x, request.y, request.radius)
        return f'obstacle {request.name} stands at ({request.x:.2f}, {request.y:.2f})'

    def _remove_obstacle(self, request: RemoveObstacle.Request) -> str:
        self._world.remove_obstacle(request.name)
        self._stage.forget('thing', request.name)
        return f'obstacle {request.name} is gone'

    def _set_marker(self, request: SetMarker.Request) -> str:
        world = self._world
        self._stage.forget('marker', request.name)
        if request.state != SetMarker.Request.MOVED:
            world.set_marker(request.name, request.state)
            return f'marker {request.name} is {request.state}'
        marker = conversions.marker_from_ros(request, world.plan.marker_size)
        # Whether the dictionary holds the id shows when it is drawn: better now than in a picture.
        marker_panel(world.plan.marker_dictionary, marker.id, 'whole')
        world.hang_marker(marker)
        return (
            f'marker {request.name} with id {request.id} hangs at ({marker.x:.2f}, {marker.y:.2f})'
        )


def _push_robot(robot: Robot, request: PushRobot.Request) -> str:
    _check_shift(request.dx, request.dy, request.dyaw)
    way = robot.base.push(request.dx, request.dy, request.dyaw)
    return f'pushed by {way:.2f} m and {request.dyaw:.2f} rad'


def _slip_odometry(robot: Robot, request: SlipOdometry.Request) -> str:
    _check_shift(request.dx, request.dy, request.dyaw)
    robot.base.slip(request.dx, request.dy, request.dyaw)
    return f'odometry slipped by ({request.dx:.2f}, {request.dy:.2f}) m, {request.dyaw:.2f} rad'


def _drain_battery(drained: Publisher, request: DrainBattery.Request) -> str:
    if not 0.0 <= request.percent <= 100.0:
        raise PlaceError((), f'percent {request.percent:g}: expected 0 to 100')
    drained.publish(Float32(data=float(request.percent)))
    return f'battery drained by {request.percent:g} percent'


def _check_shift(*numbers: float) -> None:
    """Refuse what is no shift of a robot in a place: metres and rad up to `LONGEST_SHIFT`."""
    for number in numbers:
        if not abs(number) <= LONGEST_SHIFT:  # also false for NaN
            raise PlaceError((), f'expected -{LONGEST_SHIFT:g} to {LONGEST_SHIFT:g}, got {number}')
