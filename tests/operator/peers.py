""""""

from __future__ import annotations

import math
from typing import Any

from builtin_interfaces.msg import Time
from geometry_msgs.msg import PoseWithCovarianceStamped
from rclpy.qos import QoSProfile
from std_msgs.msg import UInt8
from std_srvs.srv import SetBool, Trigger

from surveillance_interfaces.msg import (
    FleetRobot,
    MissionStatus,
)
from surveillance_operator.mission_subscriber import MissionSubscriber
from surveillance_runtime.node import PatrolNode
from surveillance_runtime.qos import STATE_QOS


def pose(x: float, y: float, yaw: float = 0.0, second: int = 5) -> PoseWithCovarianceStamped:
    message = PoseWithCovarianceStamped()
    message.header.stamp = Time(sec=second)
    at = message.pose.pose
    at.position.x, at.position.y = x, y
    at.orientation.z, at.orientation.w = math.sin(yaw / 2), math.cos(yaw / 2)
    return message


class Watcher(PatrolNode):
    """Watches as the page does."""

    def __init__(self, **options: Any) -> None:
        super().__init__('mission_watcher', **options)
        self.subscriber = MissionSubscriber(self, 0.05, streams=True)


PLACE = {
    'map.A': ['D'],
    'map.B': ['D'],
    'room_positions.A': [1.0, 1.0],
    'room_positions.B': [5.0, 1.0],
    'robot_room': 'A',
    'recharge_rooms': ['A'],
}


class Planner(PatrolNode):
    """The planner's parameters."""

    def __init__(self, **options: Any) -> None:
        super().__init__('planner_controller', **options)
        self.parameter('execution_mode', 'SIMULATED', 'Mode.')
        for table in ('doors', 'keep_out_zones', 'slow_zones'):
            self.parameters_under(table)


def say(graph: Any, topic: str, message: Any, qos: Any = STATE_QOS) -> Any:
    publisher = graph.node.create_publisher(type(message), topic, qos)
    publisher.publish(message)
    return publisher


class Robot:
    """What others see of one robot.

    Args:
        graph: Where it lives.
        name: Its namespace.
        answers: What it says when it is stopped; None: it does not answer.
    """

    def __init__(self, graph: Any, name: str, answers: bool = True) -> None:
        self.node = graph.add(PatrolNode, name='robot_behavior', namespace=name)
        self.told: list[Any] = []
        status = MissionStatus(machine='surveillance', state='MOVE', place=f'place_of_{name}')
        pose = PoseWithCovarianceStamped()
        pose.pose.pose.position.x, pose.pose.pose.orientation.w = float(len(name)), 1.0
        self._publishers = [
            self.say('mission_status', status),
            self.say('amcl_pose', pose),
            self.say('battery_level', UInt8(data=10 * len(name))),
        ]
        fleet = self.node.create_publisher(FleetRobot, '/fleet_robots', QoSProfile(depth=10))
        word = FleetRobot(robot=name, place='A', tour=['A', name], stop=name, runs_until=9.0)
        self.node.create_timer(0.05, lambda: fleet.publish(word))
        self.node.create_service(SetBool, 'stop', self._obey if answers else self._refuse)
        self.node.create_service(SetBool, 'take_out', self._obey)
        self.node.create_service(Trigger, 'robot_behavior/fsm/pause', self._obey)

    def say(self, topic: str, message: Any) -> Any:
        publisher = self.node.create_publisher(type(message), topic, STATE_QOS)
        publisher.publish(message)
        return publisher

    def _obey(self, request: Any, response: Any) -> Any:
        self.told.append(getattr(request, 'data', 'pause'))
        response.success, response.message = True, 'done'
        return response

    def _refuse(self, _request: Any, response: Any) -> Any:
        response.success, response.message = False, 'no'
        return response
