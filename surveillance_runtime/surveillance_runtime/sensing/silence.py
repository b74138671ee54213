"""What a robot drives by and does not hear: incidents that name the topic, and say why."""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Iterable, Mapping
from dataclasses import replace

from surveillance_runtime.alarms import SILENT_AFTER
from surveillance_runtime.graph_check import InputWatch
from surveillance_runtime.incidents import Incidents, Severity
from surveillance_runtime.node import PatrolNode
from surveillance_runtime.periods import every
from surveillance_runtime.profile.check_up import GraphSample, TopicSample, awaited
from surveillance_runtime.profile.record import Frames, RobotProfile, Topics
from surveillance_runtime.profile.truth_check import doubts
from surveillance_runtime.sensing import conversions
from surveillance_runtime.sensing.sensors import SensorStream

LOOK_PERIOD = 1.0
"""Seconds of real time between two looks at what fell silent."""
DOUBT_PERIOD = 5.0
"""Seconds of real time between two looks whether what comes can be true."""


class SilenceWatch:
    """Begins an incident for a topic that tells nothing any more, and ends it when it does.

    What never came is not told here; nor is a silence in which nobody spun the node: what came
    meanwhile still waits to be taken.

    Args:
        incidents: Where it is told.
        streams: What comes on the topics.
    """

    def __init__(self, incidents: Incidents, streams: Iterable[SensorStream]) -> None:
        self._incidents = incidents
        self._streams = tuple(streams)
        self._looked_at = -math.inf

    def look(self, now: float) -> None:
        """Look which topics tell nothing, at a steady time, seconds; about each `LOOK_PERIOD`."""
        stood_still = now - self._looked_at >= SILENT_AFTER / 2
        self._looked_at = now
        if stood_still:
            return
        for stream in self._streams:
            cause = 'topic', stream.topic
            if stream.heard_at is None or stream.came_at is None:
                continue
            if now - stream.heard_at < SILENT_AFTER:
                self._incidents.end(cause, f'{stream.topic} is published again')
                continue
            what = f'nothing is published on {stream.topic}'
            if now - stream.came_at < SILENT_AFTER and stream.problem:
                what = f'nothing of use comes on {stream.topic} ({stream.problem})'
            self._incidents.begin(cause, f'{what}: the robot cannot drive', Severity.ALARM)


class SensorWatch:
    """Tells what a node that drives by its sensors does not hear: what never came, with what is
    there instead, and what fell silent.

    Args:
        node: The node.
        frames: Those of the robot.
        lidars: What comes of each lidar, by the topic's name.
        odometry: What comes on `odom`.
        awaits_map: Returns whether the map has not come yet; None: the node needs none.
        child: Returns the odometry's child frame; empty: not known.
    """

    def __init__(
        self,
        node: PatrolNode,
        frames: Frames,
        lidars: Mapping[str, SensorStream],
        odometry: SensorStream,
        awaits_map: Callable[[], bool] | None = None,
        child: Callable[[], str] = lambda: '',
    ) -> None:
        streams = {each.topic: each for each in (*lidars.values(), odometry)}
        map_topic = str(node.resolve_topic_name('map'))
        scans = tuple(lidar.topic for lidar in lidars.values())
        topics = replace(Topics(), map=map_topic, odom=odometry.topic, scans=scans)
        known = {*streams, *([] if awaits_map is None else [map_topic])}
        wanted = [
            each
            for each in awaited(replace(RobotProfile(), topics=topics, frames=frames))
            if each.topic in known
        ]

        def missing() -> list[str]:
            never = [topic for topic, each in streams.items() if each.heard_at is None]
            return never + ([map_topic] if awaits_map is not None and awaits_map() else [])

        def refused(topic: str) -> str:
            stream = streams.get(topic)
            return conversions.refusal(node, 'map') if stream is None else stream.problem

        self._inputs = InputWatch(node, wanted, missing, refused)
        self._silence = SilenceWatch(node.incidents, streams.values())
        self._node, self._profile = node, replace(RobotProfile(), topics=topics, frames=frames)
        self._streams, self._child = streams, child
        every(node, LOOK_PERIOD, lambda: self._silence.look(time.monotonic()))
        every(node, DOUBT_PERIOD, self._doubt)

    def _doubt(self) -> None:
        """Doubt what comes, as `doctor` does; `StateSubscription` tells of a second publisher."""
        heard = {}
        for topic, stream in self._streams.items():
            if stream.heard_at is None:
                continue
            values: dict[str, object] = {'unstamped': stream.stamp == 0.0}
            # A driver that names no child frame is let be while it drives.
            values['child'] = self._child() or self._profile.frames.base
            heard[topic] = TopicSample(1, values=values)
        found = {
            doubt.topic: doubt.text for doubt in doubts(self._profile, GraphSample(heard=heard))
        }
        for topic in self._streams:
            if topic in found:
                self._node.incidents.begin(('robot', f'{topic} is true'), found[topic])
            else:
                self._node.incidents.end(('robot', f'{topic} is true'))
