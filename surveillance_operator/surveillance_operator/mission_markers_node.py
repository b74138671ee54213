"""The node `mission_markers`: a mission as RViz, Foxglove and rqt show it.

Topics: `place_markers` (MarkerArray: places coloured by how long they wait, doors), `driven_path`
(Path), `robot_description` (URDF, latched) and `/diagnostics` (each node: up, started again, how
long it takes to answer). The planned path is on `plan`, by planner_controller.
"""

from __future__ import annotations

import time
from collections.abc import Sequence
from typing import Any

from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus, KeyValue
from geometry_msgs.msg import Point, PoseStamped
from nav_msgs.msg import Path
from rcl_interfaces.srv import GetParameterTypes
from std_msgs.msg import ColorRGBA, String
from visualization_msgs.msg import Marker, MarkerArray

from surveillance_operator.mission_feed import MissionFeed
from surveillance_operator.robot_description import urdf
from surveillance_operator.snapshot import Snapshot
from surveillance_runtime.calls import CallError, ServiceCaller
from surveillance_runtime.node import PatrolNode
from surveillance_runtime.process import run_node
from surveillance_runtime.qos import STATE_QOS

PERIOD = 1.0
"""Seconds between two messages."""
SLOW_MS = 500.0
"""From this on an answer is a warning, milliseconds."""
HARDWARE = 'surveillance_robot'
FRESH, LATE = (0.81, 0.89, 0.97), (0.88, 0.48, 0.12)
"""Colours of a place that was just visited, and of one over its threshold."""

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
        self._diagnostics = self.create_publisher(DiagnosticArray, '/diagnostics', 10)
        description = self.create_publisher(String, 'robot_description', STATE_QOS)
        description.publish(String(data=urdf()))
        if TFMessage is None:
            self.get_logger().info('tf2_msgs is not installed: nothing is published on tf')
        self._callers: dict[str, ServiceCaller] = {}
        self._latencies: dict[str, float | None] = {}
        self._feed = MissionFeed(self, PERIOD)
        self.spawn(self._work, 'markers')

    def _work(self) -> None:
        number = 0
        while not self.stopping.wait(PERIOD):
            snapshot = self._feed.see()
            self._markers.publish(markers_of(snapshot, self.get_clock().now().to_msg()))
            self._driven.publish(path_of(snapshot, self.get_clock().now().to_msg()))
            names = sorted(snapshot.nodes)
            if names:
                self._probe(names[number % len(names)])
                number += 1
            self._diagnostics.publish(self._health(snapshot))

    def _probe(self, name: str) -> None:
        """Measure how long a node takes to answer; one node a second."""
        caller = self._callers.get(name)
        if caller is None:
            service = f'{name}/get_parameter_types'
            caller = self._callers[name] = ServiceCaller(self, GetParameterTypes, service)
        began = time.monotonic()
        try:
            request = GetParameterTypes.Request(names=['use_sim_time'])
            caller.call(request, 2.0, self.stopping)
            self._latencies[name] = 1000.0 * (time.monotonic() - began)
        except CallError:
            self._latencies[name] = None

    def _health(self, snapshot: Snapshot) -> DiagnosticArray:
        message = DiagnosticArray()
        message.header.stamp = self.get_clock().now().to_msg()
        for name in sorted({*snapshot.nodes, *snapshot.ended}):
            message.status.append(self._status(name, snapshot))
        return message

    def _status(self, name: str, snapshot: Snapshot) -> DiagnosticStatus:
        status = DiagnosticStatus(name=name, hardware_id=HARDWARE)
        restarts = snapshot.restarts.get(name, 0)
        latency = self._latencies.get(name)
        status.level, status.message = DiagnosticStatus.OK, 'up'
        if name not in snapshot.nodes:
            status.level, status.message = DiagnosticStatus.ERROR, 'ended'
        elif name in self._latencies and latency is None:
            status.level, status.message = DiagnosticStatus.STALE, 'does not answer'
        elif latency is not None and latency > SLOW_MS:
            status.level, status.message = DiagnosticStatus.WARN, f'answers in {latency:.0f} ms'
        status.values.append(KeyValue(key='restarts', value=str(restarts)))
        if latency is not None:
            status.values.append(KeyValue(key='answers_in_ms', value=f'{latency:.1f}'))
        return status


def markers_of(snapshot: Snapshot, stamp: Any) -> MarkerArray:
    """Return places and doors as markers in the map frame.

    A place's colour goes from `FRESH` to `LATE` as its wait comes near the threshold.
    """
    found = [Marker(action=Marker.DELETEALL)]
    threshold = snapshot.threshold or 120.0
    for number, (name, (x, y)) in enumerate(sorted(snapshot.positions.items())):
        visited = snapshot.visited_at.get(name) or None
        share = 1.0 if visited is None else min(1.0, max(0.0, (snapshot.now - visited) / threshold))
        mixed = [a + share * (b - a) for a, b in zip(FRESH, LATE, strict=True)]
        disc = _marker('places', number, Marker.CYLINDER, (x, y, 0.02), (0.8, 0.8, 0.04), mixed)
        urgent = ' URGENT' if name in snapshot.urgent else ''
        label = _marker(
            'names', number, Marker.TEXT_VIEW_FACING, (x, y, 0.4), (0, 0, 0.5), (1, 1, 1)
        )
        label.text = name + urgent
        found += [disc, label]
    for number, (name, line) in enumerate(sorted(snapshot.door_lines.items())):
        is_open = (snapshot.doors or {}).get(name, True)
        colour = (0.04, 0.5, 0.35) if is_open else (0.7, 0.07, 0.17)
        door = _marker('doors', number, Marker.LINE_LIST, (0, 0, 0.1), (0.12, 0, 0), colour)
        door.points = [Point(x=line[0], y=line[1]), Point(x=line[2], y=line[3])]
        found.append(door)
    for each in found:
        each.header.frame_id, each.header.stamp = 'map', stamp
    return MarkerArray(markers=found)


def path_of(snapshot: Snapshot, stamp: Any) -> Path:
    """Return the way driven as a path in the map frame."""
    path = Path()
    path.header.frame_id, path.header.stamp = 'map', stamp
    for x, y in snapshot.trail.tolist():
        pose = PoseStamped(header=path.header)
        pose.pose.position.x, pose.pose.position.y = x, y
        path.poses.append(pose)
    return path


def _marker(
    namespace: str,
    number: int,
    kind: int,
    at: Sequence[float],
    size: Sequence[float],
    colour: Sequence[float],
) -> Marker:
    marker = Marker(ns=namespace, id=number, type=kind, action=Marker.ADD)
    position, scale = marker.pose.position, marker.scale
    position.x, position.y, position.z = map(float, at)
    scale.x, scale.y, scale.z = map(float, size)
    marker.pose.orientation.w = 1.0
    red, green, blue = map(float, colour)
    marker.color = ColorRGBA(r=red, g=green, b=blue, a=0.9)
    return marker


def main(args: Sequence[str] | None = None) -> int:
    """Run the node until it is stopped."""
    return run_node(MissionMarkers, args)
