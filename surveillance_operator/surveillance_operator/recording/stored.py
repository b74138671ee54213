"""What recorded messages tell: the time line of a recording that has none, lidar and camera.

The messages of a recording, such as one by `ros2 bag record`, go through the same table of topics
as those of a running mission. What a running mission is asked for, a recording cannot answer:
places and doors come from `place_markers`, visits and URGENT from `fact_changes`, the nodes from
`/diagnostics`.
"""

from __future__ import annotations

import contextlib
import shutil
import sys
import threading
from collections import deque
from collections.abc import Container, Iterable
from dataclasses import replace
from pathlib import Path

import numpy as np
from rclpy.qos import QoSProfile
from rclpy.serialization import deserialize_message
from rosgraph_msgs.msg import Clock
from visualization_msgs.msg import MarkerArray

from strict_files.files import FileError, in_one_line
from surveillance_interfaces.msg import FactChanges
from surveillance_ontology.conversions import changes_from_ros
from surveillance_operator.images import ANNOTATED, KINDS, PLAIN, SUFFIX, jpeg_from
from surveillance_operator.mission_changes import follow
from surveillance_operator.mission_state import STALE, MissionState
from surveillance_operator.recording.reading import Messages
from surveillance_operator.recording.timeline import TimelineWriter
from surveillance_operator.topics import (
    BEHAVIOUR,
    MOST_NAMES,
    POSE_TOPIC,
    TOPICS,
    URGENT_MARK,
    Fields,
    Topic,
    point_from,
    read_message,
    with_fact,
)
from surveillance_runtime.node_table import name_for

CLOCK = '/clock'
WINDOW = 0.4
"""Seconds of the recording that make one state."""
RECENT = 2.5
"""What was seen longer ago is not shown, seconds."""
SCAN_TOPIC = 'scan'


def _on_fact_changes(message: FactChanges, old: MissionState) -> Fields:
    new = old
    for fact, came, _ in changes_from_ros(message):
        new = with_fact(new, fact, came)
    return {name: new.field(name) for name in ('urgent', 'links', 'visited_at')}


def _on_place_markers(message: MarkerArray, _old: MissionState) -> Fields:
    """Take in the places' points and the doors' lines, metres."""
    positions, lines = {}, {}
    for each in message.markers[:MOST_NAMES]:
        if each.ns == 'names':
            positions[each.text.removesuffix(URGENT_MARK)] = point_from(each.pose.position)
        elif each.ns == 'doors' and len(each.points) == 2 and each.text:
            lines[each.text] = (*point_from(each.points[0]), *point_from(each.points[1]))
    return {'positions': positions, 'door_lines': lines}


STORED_TOPICS = (
    *TOPICS,
    Topic('fact_changes', FactChanges, _on_fact_changes, QoSProfile(depth=100)),
    Topic('place_markers', MarkerArray, _on_place_markers),
)
"""All that a state takes from in a recording."""


def prefix_of(topics: Iterable[str]) -> str:
    """Return how the topics of the robot begin that a recording is of: a slash, its namespace."""
    known = {topic.name for topic in TOPICS if not topic.name.startswith('/')}
    found = sorted(
        topic.removesuffix(name) for topic in topics for name in known if topic.endswith(f'/{name}')
    )
    return max(found, key=found.count, default='/')


def _recorded_name(name: str, prefix: str, recorded: Container[str]) -> str:
    """Return a topic's full name; what robots of a fleet share is in the namespace above theirs."""
    own = name if name.startswith('/') else prefix + name
    above, _, robot = prefix.strip('/').rpartition('/')
    shared = f'/{above}/{name}' if above else f'/{name}'
    is_shared = robot and name_for(robot, name) == name and shared in recorded
    return shared if is_shared and own not in recorded else own


class Conversion:
    """Writes the time line of a recording.

    Args:
        recording: Its folder, or its only file.
        path: The time line to write.
        keep: Where it is put when it is complete; nothing is kept where that cannot be written.

    Raises:
        FileError: A file cannot be read, or holds nothing of a mission.
    """

    def __init__(self, recording: Path, path: Path, keep: Path | None = None) -> None:
        self._messages = Messages(recording)
        self._path, self._keep = path, keep
        self._begun, self._stopped = threading.Event(), threading.Event()
        self._thread = threading.Thread(target=self._run, name='conversion', daemon=True)
        self._clock: float | None = None
        prefix = prefix_of(self._messages.types)
        self._state = MissionState(where='a recording', namespace=prefix.strip('/'))
        self._topics = {
            _recorded_name(each.name, prefix, self._messages.types): each for each in STORED_TOPICS
        }
        if not self._topics.keys() & self._messages.types.keys():
            raise FileError(f'{recording}: holds no topic of a mission, like mission_status')

    def progress(self) -> float:
        """Return how much of the recording is in the time line, 0 to 1."""
        return self._messages.progress if self._thread.is_alive() else 1.0

    def start(self) -> None:
        """Begin on a thread of its own; return when the time line has its first lines."""
        self._thread.start()
        self._begun.wait()

    def stop(self) -> None:
        """End it."""
        self._stopped.set()
        if self._thread.is_alive():
            self._thread.join()
        self._messages.close()

    def _run(self) -> None:
        try:
            self._convert()
        except OSError as error:
            print(f'replay: the time line cannot be written: {in_one_line(error)}', file=sys.stderr)
        finally:
            self._begun.set()

    def _convert(self) -> None:
        writer = TimelineWriter(self._path)
        window: dict[str, deque[bytes]] = {}
        closes = 0.0
        try:
            for name, nanoseconds, data in self._messages.in_order([*self._topics, CLOCK]):
                if self._stopped.is_set():
                    return
                at = nanoseconds / 1e9
                if at >= closes:
                    if window:
                        self._take(window, closes, writer)
                        self._begun.set()
                    window, closes = {}, at + WINDOW
                depth = 1 if name == CLOCK else self._topics[name].qos.depth
                window.setdefault(name, deque(maxlen=depth)).append(data)
            if window:
                self._take(window, closes, writer)
        finally:
            writer.close()
        if self._keep is not None:
            part = self._keep.with_suffix('.part')
            with contextlib.suppress(OSError):
                shutil.copyfile(self._path, part)
                part.replace(self._keep)

    def _take(self, window: dict[str, deque[bytes]], at: float, writer: TimelineWriter) -> None:
        """Take one window's messages into the state."""
        for data in window.pop(CLOCK, ()):
            stamp = deserialize_message(data, Clock).clock
            self._clock = stamp.sec + stamp.nanosec / 1e9
        new = self._state
        # What stands beside another topic is read before it.
        for name in sorted(window, key=lambda name: not self._topics[name].beside):
            topic = self._topics[name]
            for data in window[name]:
                new = read_stored(new, topic, data)
        health = new.health
        nodes = {
            name for name, each in health.reports.items() if ':' not in name and each.level != STALE
        }
        if not nodes and new.task.status is not None:
            nodes = {BEHAVIOUR}
        if nodes != health.nodes.keys():
            ended = health.ended.union(health.nodes).difference(nodes)
            new = new.having(nodes=dict.fromkeys(sorted(nodes), frozenset()), ended=ended)
        new = replace(new, now=at if self._clock is None else self._clock)
        self._state, _ = follow(self._state, new, at)
        writer.add(self._state, at)


def read_stored(state: MissionState, topic: Topic, data: bytes) -> MissionState:
    """Return the state with what a serialised message says, or why it cannot be used."""
    try:
        message = deserialize_message(data, topic.kind)
    except Exception as error:  # whatever rmw finds: the bytes may be anything
        return state.having(silent={**state.health.silent, topic.name: str(error)})
    return read_message(state, topic, message)


class RecordedSights:
    """Reads what was seen.

    Args:
        recording: Its folder, or its only file.

    Raises:
        FileError: It cannot be read.
    """

    def __init__(self, recording: Path) -> None:
        self._messages = Messages(recording)
        self._prefix = prefix_of(self._messages.types)
        self._images = [
            f'{self._prefix}{name}{end}' for name in (ANNOTATED, PLAIN) for end in ('', SUFFIX)
        ]
        by_name = {topic.name: topic for topic in TOPICS}
        self._pose, self._scan = by_name[POSE_TOPIC], by_name[SCAN_TOPIC]

    def scan(self, at: float) -> list[list[float]]:
        """Return the points that the lidar saw, metres, map frame; none where it was silent."""
        poses = [
            read_stored(MissionState(), self._pose, data)
            for _, _, data in self._messages.before([self._prefix + POSE_TOPIC], at, RECENT)
        ]
        for _, _, data in self._messages.before([self._prefix + SCAN_TOPIC], at, RECENT):
            # A scan is shown from the pose of its moment.
            for known in poses:
                seen = read_stored(known, self._scan, data).sensors.scan
                if len(seen):
                    points: list[list[float]] = np.round(seen, 2).tolist()
                    return points
        return []

    def jpeg(self, at: float) -> bytes | None:
        """Return the image of the camera as JPEG, None where there is none."""
        for topic, _, data in self._messages.before(self._images, at, RECENT, 1):
            kind = KINDS.get(self._messages.types.get(topic, ''))
            if kind is None:
                continue
            try:
                return jpeg_from(deserialize_message(data, kind))
            except Exception:  # whatever rmw finds: the bytes may be anything
                return None
        return None

    def close(self) -> None:
        """Close the files."""
        self._messages.close()
