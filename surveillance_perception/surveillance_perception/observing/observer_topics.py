"""What the observer tells: observations as they come, and latched states, each when it changes."""

from __future__ import annotations

from collections import deque
from collections.abc import Iterable, Mapping, Sequence
from typing import Any

from rclpy.qos import QoSProfile
from std_msgs.msg import Bool

from indoor_watch import Coverage, Event, Observation
from indoor_watch.marker_checks import MarkerCheck
from surveillance_interfaces import msg
from surveillance_perception.observing.conversions import (
    Spot,
    checks_to_ros,
    coverage_to_ros,
    doubts_to_ros,
    event_to_ros,
    observation_to_ros,
    pictures_to_ros,
    viewpoints_to_ros,
)
from surveillance_runtime.node import PatrolNode
from surveillance_runtime.state_topics import OwnedTopic

MOST_SIDES = 20
"""Of so many pictures it is told that they were looked at."""
MOST_TOLD = 200
"""So many events are published, the newest."""


class ObserverTopics:
    """Publishes; the worker tells all but the camera's angle, which the executor's thread tells.

    Args:
        node: The observer.
        camera: Whether pictures are looked at.
    """

    def __init__(self, node: PatrolNode, *, camera: bool) -> None:
        self._observations = node.create_publisher(
            msg.Observation, 'observations', QoSProfile(depth=100)
        )
        self._events = OwnedTopic(node, msg.ObservedEvents, 'events')
        self._viewpoints = OwnedTopic(node, msg.Viewpoints, 'viewpoints')
        self._coverage = OwnedTopic(node, msg.PlaceCoverages, 'looks')
        self._doubts = OwnedTopic(node, msg.Doubts, 'doubts')
        self._checks = OwnedTopic(node, msg.PlaceChecks, 'checks')
        self._pictures = OwnedTopic(node, msg.ViewedPictures, 'pictures')
        self._sees_around = OwnedTopic(node, Bool, 'sees_around')
        self._camera = camera
        self._said: dict[str, object] = {}
        self._covered: dict[str, msg.PlaceCoverage] = {}
        # Of the last pictures that were looked at: when, seconds, and to which bearings, rad.
        self._looked: deque[tuple[float, float | None]] = deque(maxlen=MOST_SIDES)
        self._angle: float | None = None
        self._say_pictures()

    def observation(self, seen: Observation) -> None:
        """Tell of an observation."""
        self._observations.publish(observation_to_ros(seen))

    def events(self, events: Sequence[Event]) -> bool:
        """Tell the newest events, if one is otherwise than it was told; tell whether one is."""
        told = msg.ObservedEvents(events=[event_to_ros(each) for each in events[:MOST_TOLD]])
        return self._say('events', self._events, told)

    def viewpoints(self, viewpoints: Mapping[str, Sequence[Spot]]) -> None:
        """Tell from where each place is to be looked at."""
        self._viewpoints.publish(viewpoints_to_ros(viewpoints))

    def coverage(self, coverage: Coverage) -> None:
        """Tell what was covered of each place in the last visit there."""
        self._covered[coverage.place] = coverage_to_ros(coverage)
        covered = [each for _, each in sorted(self._covered.items())]
        self._coverage.publish(msg.PlaceCoverages(places=covered))

    def doubts(self, doubts: Iterable[tuple[Event, Spot | None]]) -> None:
        """Tell which alerts wait for a second look, and from where."""
        self._say('doubts', self._doubts, doubts_to_ros(doubts))

    def checks(self, checks: Iterable[MarkerCheck]) -> None:
        """Tell from where the spots of markers are to be seen that a rule is about."""
        self._say('checks', self._checks, checks_to_ros(checks))

    def sees_around(self, around: bool) -> None:
        """Tell whether a turn of the base or the arm would show nothing more."""
        self._say('sees_around', self._sees_around, Bool(data=around))

    def camera_angle(self, angle: float | None) -> None:
        """Tell how much of the horizon a picture shows, rad."""
        self._angle = angle
        self._say_pictures()

    def looked_at(self, taken: float, bearing: float | None) -> None:
        """Tell that a picture was looked at: a side counts as seen by that alone."""
        self._looked.append((taken, bearing))
        self._say_pictures()

    def _say_pictures(self) -> None:
        self._pictures.publish(pictures_to_ros(self._looked, self._angle, camera=self._camera))

    def _say(self, name: str, topic: OwnedTopic[Any], told: object) -> bool:
        if self._said.get(name) == told:
            return False
        self._said[name] = told
        topic.publish(told)
        return True
