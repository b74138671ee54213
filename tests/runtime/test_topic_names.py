"""A run renames topics for all its nodes: who asks for what the base hears is told of that."""

from __future__ import annotations

from typing import Any

from geometry_msgs.msg import Twist, TwistStamped

from surveillance_controllers.motion.holding import Hold
from surveillance_interfaces.msg import StopRequest
from surveillance_runtime.graph_check import endpoints_of
from surveillance_runtime.node import PatrolNode
from surveillance_runtime.state_topics import publishers_of

RENAMED = ['-r', 'cmd_vel:=cmd_vel_wanted', '-r', 'cmd_vel_monitored:=cmd_vel']


def renamed(graph: Any) -> Any:
    return graph.add(PatrolNode, name='renamed', cli_args=['--ros-args', *RENAMED])


def test_who_asks_for_what_the_base_hears_is_not_told_of_what_is_wanted(graph: Any) -> None:
    graph.node.create_subscription(TwistStamped, 'cmd_vel', lambda _: None, 1)
    graph.node.create_subscription(Twist, 'cmd_vel_wanted', lambda _: None, 1)
    graph.node.create_publisher(TwistStamped, 'cmd_vel', 1)
    node = renamed(graph)
    wanted = {
        '/cmd_vel': {'geometry_msgs/TwistStamped'},
        '/cmd_vel_wanted': {'geometry_msgs/Twist'},
    }

    def types() -> dict[str, set[str]]:
        found = endpoints_of(node, wanted).subscribers
        return {topic: {end.type for end in ends} for topic, ends in found.items()}

    graph.until(lambda: types() == wanted)
    graph.until(lambda: list(publishers_of(node, '/cmd_vel').values()) == ['/test'])
    assert not publishers_of(node, '/cmd_vel_wanted')


def test_a_base_with_stamped_commands_is_told_to_stand_where_no_monitor_is(graph: Any) -> None:
    heard = graph.listen(TwistStamped, 'cmd_vel')
    graph.node.create_subscription(Twist, 'cmd_vel_wanted', lambda _: None, 1)
    hold = Hold(renamed(graph))
    hold._on_request(StopRequest(owner='test'))
    graph.until(lambda: (hold._halt(), heard)[1])
