"""The node `mission_markers`: a mission as RViz, Foxglove and rqt show it.

Topics: `place_markers` (MarkerArray: places coloured by how long they wait, doors), `driven_path`
(Path), `robot_description` (URDF, latched) and, on `/diagnostics`, the nodes that no longer report
there themselves. The planned path is on `plan`, by planner_controller.
"""

from __future__ import annotations

import math
import time
from collections.abc import Sequence
from typing import Any

from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus
from geometry_msgs.msg import Point, PoseStamped
from nav_msgs.msg import Path
from std_msgs.msg import ColorRGBA, String
from visualization_msgs.msg import Marker, MarkerArray

from surveillance_operator.mission_state import STALE, MissionState
from surveillance_operator.mission_subscriber import MissionSubscriber
from surveillance_operator.topics import URGENT_MARK
from surveillance_runtime.diagnostics import TOPIC
from surveillance_runtime.node import PatrolNode
from surveillance_runtime.process import run_node
from surveillance_runtime.qos import STATE_QOS
from surveillance_runtime.robot_arm import ARM, Arm

PERIOD = 1.0
"""Seconds between two messages."""
PATH_PERIOD = 5.0
"""Seconds between two of the way driven, which is long."""
FRESH, LATE = (0.81, 0.89, 0.97), (0.88, 0.48, 0.12)
"""Colours of a place that was just visited, and of one over its threshold."""
RADIUS, HEIGHT = 0.2, 0.25
"""Of the base, metres."""

try:
    from tf2_msgs.msg import TFMessage
except ImportError:
    TFMessage = None


class MissionMarkers(PatrolNode):
    """Publishes what standard tools show."""

    def __init__(self, **node_options: Any) -> None:
        super().__init__('mission_markers', **node_options)
        self._markers = self.create_publisher(MarkerArray, 'place_markers', STATE_QOS)
        self._driven = self.create_publisher(Path, 'driven_path', STATE_QOS)
        self._diagnostics = self.create_publisher(DiagnosticArray, TOPIC, 10)
        description = self.create_publisher(String, 'robot_description', STATE_QOS)
        description.publish(String(data=urdf()))
        if TFMessage is None:
            self.get_logger().info('tf2_msgs is not installed: nothing is published on tf')
        self._subscriber = MissionSubscriber.of_process(self)
        self.spawn(self._work, 'markers')

    def _work(self) -> None:
        drawn, due = None, 0.0
        made: dict[tuple[str, int], Marker] = {}
        while not self.stopping.wait(PERIOD):
            state = self._subscriber.see()
            self._markers.publish(markers_of(state, self.get_clock().now().to_msg(), made))
            if state.sensors.trail is not drawn and time.monotonic() >= due:
                drawn, due = state.sensors.trail, time.monotonic() + PATH_PERIOD
                self._driven.publish(path_of(state, self.get_clock().now().to_msg()))
            if silent := silent_of(state):
                message = DiagnosticArray(status=silent)
                message.header.stamp = self.get_clock().now().to_msg()
                self._diagnostics.publish(message)


def silent_of(state: MissionState) -> list[DiagnosticStatus]:
    """Return a status for each node that reported and does not any more."""
    return [
        DiagnosticStatus(
            level=DiagnosticStatus.STALE,
            name=name,
            message='has ended' if name in state.health.ended else 'does not report',
            hardware_id=health.hardware,
        )
        for name, health in sorted(state.health.reports.items())
        if health.level == STALE
    ]


def markers_of(
    state: MissionState, stamp: Any, made: dict[tuple[str, int], Marker] | None = None
) -> MarkerArray:
    """Return places and doors as markers in the map frame.

    A place's colour goes from `FRESH` to `LATE` as its wait comes near the threshold. A robot that
    has a namespace has its name above it.

    Args:
        state: What is known.
        stamp: Of the markers.
        made: Markers of an earlier message, to be used again: making them costs most of it.
    """
    made = {} if made is None else made
    found = [Marker(action=Marker.DELETEALL)]
    threshold = state.task.threshold or 120.0
    for number, (name, (x, y)) in enumerate(sorted(state.place.positions.items())):
        visited = state.place.visited_at.get(name) or None
        share = 1.0 if visited is None else min(1.0, max(0.0, (state.now - visited) / threshold))
        mixed = [a + share * (b - a) for a, b in zip(FRESH, LATE, strict=True)]
        disc = _marker(
            made, 'places', number, Marker.CYLINDER, (x, y, 0.02), (0.8, 0.8, 0.04), mixed
        )
        urgent = URGENT_MARK if name in state.place.urgent else ''
        label = _marker(
            made, 'names', number, Marker.TEXT_VIEW_FACING, (x, y, 0.4), (0, 0, 0.5), (1, 1, 1)
        )
        label.text = name + urgent
        found += [disc, label]
    for number, (name, line) in enumerate(sorted(state.place.door_lines.items())):
        is_open = (state.place.doors or {}).get(name, True)
        colour = (0.04, 0.5, 0.35) if is_open else (0.7, 0.07, 0.17)
        door = _marker(made, 'doors', number, Marker.LINE_LIST, (0, 0, 0.1), (0.12, 0, 0), colour)
        door.text = name
        door.points = [Point(x=line[0], y=line[1]), Point(x=line[2], y=line[3])]
        found.append(door)
    if state.namespace and state.sensors.pose is not None:
        x, y, _ = state.sensors.pose
        own = _marker(
            made, 'robots', 0, Marker.TEXT_VIEW_FACING, (x, y, 0.8), (0, 0, 0.5), (1, 0.9, 0.4)
        )
        own.text = state.namespace.rpartition('/')[2]
        found.append(own)
    for each in found:
        each.header.frame_id, each.header.stamp = 'map', stamp
    return MarkerArray(markers=found)


def path_of(state: MissionState, stamp: Any) -> Path:
    """Return the way driven as a path in the map frame."""
    path = Path()
    path.header.frame_id, path.header.stamp = 'map', stamp
    for x, y in state.sensors.trail.tolist():
        pose = PoseStamped(header=path.header)
        pose.pose.position.x, pose.pose.position.y = x, y
        path.poses.append(pose)
    return path


def _marker(
    made: dict[tuple[str, int], Marker],
    namespace: str,
    number: int,
    kind: int,
    at: Sequence[float],
    size: Sequence[float],
    colour: Sequence[float],
) -> Marker:
    marker = made.get((namespace, number))
    if marker is None:
        marker = made[namespace, number] = Marker(ns=namespace, id=number, action=Marker.ADD)
    marker.type = kind
    position, scale = marker.pose.position, marker.scale
    position.x, position.y, position.z = map(float, at)
    scale.x, scale.y, scale.z = map(float, size)
    marker.pose.orientation.w = 1.0
    red, green, blue = map(float, colour)
    marker.color = ColorRGBA(r=red, g=green, b=blue, a=0.9)
    return marker


def urdf(arm: Arm = ARM) -> str:
    """Return the robot's description; the arm's joints are those of joint_states."""
    parts = [
        _link('base_link', f'<cylinder radius="{RADIUS}" length="{HEIGHT}"/>', HEIGHT / 2),
        _link('base_scan', '<cylinder radius="0.05" length="0.05"/>', 0.0),
        _fixed('lidar', 'base_link', 'base_scan', (0.0, 0.0, HEIGHT)),
    ]
    parent = 'base_link'
    offsets = [*(joint.offset for joint in arm.joints[1:]), arm.camera_offset]
    for joint, after in zip(arm.joints, offsets, strict=True):
        link = f'{joint.name}_link'
        length = max(0.02, math.hypot(*after))
        parts.append(_link(link, f'<cylinder radius="0.025" length="{length:.3f}"/>', length / 2))
        parts.append(
            f'<joint name="{joint.name}" type="revolute"><parent link="{parent}"/>'
            f'<child link="{link}"/><origin xyz="{_xyz(joint.offset)}"/>'
            f'<axis xyz="{_xyz(joint.axis)}"/><limit lower="{joint.lower:.4f}" '
            f'upper="{joint.upper:.4f}" velocity="{joint.speed:.3f}" effort="10"/></joint>'
        )
        parent = link
    parts.append(_link('camera_link', '<box size="0.03 0.06 0.04"/>', 0.0))
    parts.append(_fixed('camera', parent, 'camera_link', arm.camera_offset))
    return f'<?xml version="1.0"?><robot name="surveillance">{"".join(parts)}</robot>'


def _link(name: str, shape: str, z: float) -> str:
    return (
        f'<link name="{name}"><visual><origin xyz="0 0 {z:.3f}"/>'
        f'<geometry>{shape}</geometry></visual></link>'
    )


def _fixed(name: str, parent: str, child: str, offset: tuple[float, float, float]) -> str:
    return (
        f'<joint name="{name}" type="fixed"><parent link="{parent}"/><child link="{child}"/>'
        f'<origin xyz="{_xyz(offset)}"/></joint>'
    )


def _xyz(values: tuple[float, float, float]) -> str:
    return ' '.join(f'{value:g}' for value in values)


def main(args: Sequence[str] | None = None) -> int:
    """Run the node until it is stopped."""
    return run_node(MissionMarkers, args)
