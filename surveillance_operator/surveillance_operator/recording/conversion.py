"""Makes the time line of a recording that has none, such as one by `ros2 bag record`.

The recorded messages go through the same table of topics as those of a running mission. What a
running mission is asked for, a recording cannot answer: places and doors come from `place_markers`,
visits and URGENT from `fact_changes`, the nodes from `/diagnostics`.
"""

from __future__ import annotations

import threading
import time
from collections import deque
from collections.abc import Iterable
from dataclasses import replace
from pathlib import Path

from rclpy.qos import QoSProfile
from rclpy.serialization import deserialize_message
from rosgraph_msgs.msg import Clock
from visualization_msgs.msg import MarkerArray

from surveillance_interfaces.msg import FactChanges
from surveillance_ontology.conversions import changes_from_ros
from surveillance_operator import conversions
from surveillance_operator.recording.bag import RecordingError
from surveillance_operator.recording.reading import Contents, messages
from surveillance_operator.recording.timeline import TimelineWriter
from surveillance_operator.snapshot import Snapshot, follow
from surveillance_operator.topics import BEHAVIOUR, TOPICS, Fields, Topic, read_message, with_fact

CLOCK = '/clock'
WINDOW = 0.4
"""Seconds of the recording that make one snapshot."""


def _on_fact_changes(message: FactChanges, old: Snapshot) -> Fields:
    new = old
    for fact, came, _ in changes_from_ros(message):
        new = with_fact(new, fact, came)
    return {name: getattr(new, name) for name in ('urgent', 'links', 'visited_at')}


def _on_place_markers(message: MarkerArray, _old: Snapshot) -> Fields:
    positions, lines = conversions.places_from(message)
    return {'positions': positions, 'door_lines': lines}


STORED_TOPICS = (
    *TOPICS,
    Topic('fact_changes', FactChanges, QoSProfile(depth=100), _on_fact_changes),
    Topic('place_markers', MarkerArray, QoSProfile(depth=1), _on_place_markers),
)
"""All that a snapshot takes from in a recording."""


def namespace_of(topics: Iterable[str]) -> str:
    """Return the namespace of the robot that a recording is of, without slashes."""
    known = {topic.name for topic in TOPICS if not topic.name.startswith('/')}
    found = sorted(
        topic.removesuffix(name).strip('/')
        for topic in topics
        for name in known
        if topic.endswith(f'/{name}')
    )
    return max(found, key=found.count, default='')


class Conversion:
    """Writes the time line of a recording.

    Args:
        recording: Its folder, or its only file.
        path: The time line to write.

    Raises:
        RecordingError: A file cannot be read, or holds nothing of a mission.
    """

    def __init__(self, recording: Path, path: Path) -> None:
        self._done = 0.0
        self._begun, self._stopped = threading.Event(), threading.Event()
        self._error: RecordingError | None = None
        self._thread = threading.Thread(target=self._run, name='conversion', daemon=True)
        self._recording = recording
        self._path = path
        self._contents = Contents.of(recording)
        names = self._contents.topics
        namespace = namespace_of(names)
        prefix = f'/{namespace}/' if namespace else '/'
        every = {
            each.name if each.name.startswith('/') else prefix + each.name: each
            for each in STORED_TOPICS
        }
        self._topics = {name: topic for name, topic in every.items() if name in names}
        if not self._topics:
            raise RecordingError(f'{recording}: holds no topic of a mission, like mission_status')
        self._clock: float | None = None
        self._snapshot = Snapshot(where='a recording', namespace=namespace)

    def share(self) -> float:
        """Return which share of the recording is in the time line, 0 to 1."""
        return self._done

    def start(self) -> None:
        """Begin on a thread of its own; return when the time line has its first lines.

        Raises:
            RecordingError: The recording cannot be read.
        """
        self._thread.start()
        self._begun.wait()
        if self._error is not None:
            raise self._error

    def stop(self) -> None:
        """End it."""
        self._stopped.set()
        if self._thread.is_alive():
            self._thread.join()

    def _run(self) -> None:
        try:
            self._convert()
        except RecordingError as error:
            self._error = error
        finally:
            self._done = 1.0
            self._begun.set()

    def _convert(self) -> None:
        start, end = self._contents.start, self._contents.end
        writer = TimelineWriter(self._path)
        window: dict[str, deque[bytes]] = {}
        closes = 0.0
        try:
            for _, channel, message in messages(self._recording, [*self._topics, CLOCK]):
                if self._stopped.is_set():
                    return
                at = message.log_time / 1e9
                if at >= closes:
                    if window:
                        self._take(window, closes, writer)
                        self._begun.set()
                    window, closes = {}, at + WINDOW
                    self._done = min(0.999, (at - start) / max(1e-9, end - start))
                depth = 1 if channel.topic == CLOCK else self._topics[channel.topic].qos.depth
                window.setdefault(channel.topic, deque(maxlen=depth)).append(message.data)
            self._take(window, end, writer)
        finally:
            writer.close()

    def _take(self, window: dict[str, deque[bytes]], at: float, writer: TimelineWriter) -> None:
        """Take one window's messages into the snapshot."""
        for data in window.pop(CLOCK, ()):
            stamp = deserialize_message(data, Clock).clock
            self._clock = stamp.sec + stamp.nanosec / 1e9
        new = self._snapshot
        # What stands beside another topic is read before it.
        for name in sorted(window, key=lambda name: not self._topics[name].beside):
            topic = self._topics[name]
            for data in window[name]:
                new = read_stored(new, topic, data)
        nodes = {name for name in new.health if ':' not in name and new.health[name].level != 3}
        if not nodes and new.status is not None:
            nodes = {BEHAVIOUR}
        if nodes != new.nodes.keys():
            ended = new.ended.union(new.nodes).difference(nodes)
            new = replace(new, nodes=dict.fromkeys(sorted(nodes), frozenset()), ended=ended)
        new = replace(new, now=at if self._clock is None else self._clock)
        day = time.strftime('%H:%M:%S', time.localtime(at))
        self._snapshot, _ = follow(self._snapshot, new, day)
        writer.add(self._snapshot, at)


def read_stored(snapshot: Snapshot, topic: Topic, data: bytes) -> Snapshot:
    """Return the snapshot with what a serialised message says, or why it cannot be used."""
    try:
        message = deserialize_message(data, topic.kind)
    except Exception as error:  # whatever rmw finds: the bytes may be anything
        return replace(snapshot, silent={**snapshot.silent, topic.name: str(error)})
    return read_message(snapshot, topic, message)
