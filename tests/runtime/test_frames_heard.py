"""The frames of a robot from the topics."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from geometry_msgs.msg import TransformStamped
from tf2_msgs.msg import TFMessage

from surveillance_runtime.conversions import pose_message
from surveillance_runtime.sensing.frames_heard import STATIC_QOS, FramesHeard


def told(parent: str, child: str, x: float, y: float, yaw: float) -> TransformStamped:
    transform = TransformStamped(child_frame_id=child)
    transform.header.frame_id = parent
    transform.header.stamp.sec = 5
    transform.transform.translation.x, transform.transform.translation.y = x, y
    transform.transform.rotation = pose_message((x, y, yaw)).orientation
    return transform


def test_moving_and_fixed_frames_make_one_tree(graph: Any) -> None:
    heard = FramesHeard(graph.node)
    moving = graph.node.create_publisher(TFMessage, 'tf', 10)
    fixed = graph.node.create_publisher(TFMessage, 'tf_static', STATIC_QOS)
    fixed.publish(TFMessage(transforms=[told('base_footprint', 'base_link', 0.0, 0.0, 0.0)]))
    unsound = told('odom', 'gripper', float('nan'), 0.0, 0.0)
    message = TFMessage(
        transforms=[
            unsound,
            told('map', 'odom', 10.0, 0.0, np.pi / 2),
            told('odom', 'base_footprint', 2.0, 1.0, 0.5),
        ]
    )

    def found() -> Any:
        moving.publish(message)
        return heard.pose('base_link', 'map', 5.0)

    pose, stamp = graph.until(found)
    assert pose == pytest.approx((9.0, 2.0, np.pi / 2 + 0.5))
    assert stamp == 5.0
    fixed.publish(TFMessage(transforms=[told('base_footprint', 'base_link', 0.4, 0.0, 0.0)]))
    graph.until(lambda: any('at two places' in e.text for e in graph.node.incidents.updates()))
