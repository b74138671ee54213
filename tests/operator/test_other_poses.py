"""Where the robots of other namespaces are."""

from __future__ import annotations

from typing import Any

import pytest
from geometry_msgs.msg import PoseWithCovarianceStamped

from surveillance_runtime.qos import STATE_QOS
from tests.operator.peers import Watcher, pose


def test_robots_of_other_namespaces_appear_and_go(
    graph: Any, monkeypatch: pytest.MonkeyPatch
) -> None:
    watcher = graph.add(Watcher)
    publishers = {
        name: graph.node.create_publisher(PoseWithCovarianceStamped, topic, STATE_QOS)
        for name, topic in (('', 'amcl_pose'), ('two', '/two/amcl_pose'), ('a/b', '/a/b/amcl_pose'))
    }
    for number, publisher in enumerate(publishers.values()):
        publisher.publish(pose(float(number), 0.0))
    graph.until(lambda: watcher.subscriber.state.place.others.keys() == {'two', 'a/b'})
    assert watcher.subscriber.state.place.others['two'] == (1.0, 0.0, 0.0)
    graph.until(lambda: watcher.subscriber.state.sensors.pose == (0.0, 0.0, 0.0))
    graph.node.destroy_publisher(publishers['two'])
    graph.until(lambda: watcher.subscriber.state.place.others.keys() == {'a/b'})
