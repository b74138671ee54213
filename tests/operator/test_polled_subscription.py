"""Messages that wait until somebody asks."""

from __future__ import annotations

import time
from typing import Any

from rclpy.qos import QoSProfile
from std_msgs.msg import String

from surveillance_operator.polled_subscription import PolledSubscription, await_message


def test_a_message_ends_the_wait_and_is_taken_by_whoever_asks(graph: Any) -> None:
    words = PolledSubscription(graph.node, String, 'words', QoSProfile(depth=10))
    others = PolledSubscription(graph.node, String, 'others', QoSProfile(depth=10))
    publisher = graph.node.create_publisher(String, 'words', 10)
    began = time.monotonic()
    await_message(graph.context, [words, others], 0.05)
    assert time.monotonic() - began >= 0.04
    assert words.take() is None
    graph.until(lambda: publisher.get_subscription_count() == 1)
    publisher.publish(String(data='come'))
    await_message(graph.context, [words, others], 60.0)
    taken = words.take()
    assert taken is not None
    assert taken[0].data == 'come'
    assert others.take() is None
