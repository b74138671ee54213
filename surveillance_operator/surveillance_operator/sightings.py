"""What the observer has noticed, for the page: its events, and the pictures of them."""

from __future__ import annotations

import threading
from functools import partial
from pathlib import Path
from typing import Any

from surveillance_interfaces.msg import ObservedEvents
from surveillance_operator.kept_pictures import kept_picture
from surveillance_perception.observing.conversions import event_from_ros
from surveillance_runtime.node import PatrolNode
from surveillance_runtime.node_table import name_for
from surveillance_runtime.state_topics import StateSubscription

MOST_EVENTS = 2000
"""A message with more is not read."""
_WAITING = ('open', 'acknowledged')
_ANSWERED = ('normal', 'acknowledged', 'false alarm')


class Sightings:
    """Follows the observer's events.

    Args:
        node: The node that listens.
        folder: The observer's pictures; empty: none are shown.
    """

    def __init__(self, node: PatrolNode, folder: str) -> None:
        self._node = node
        self._folder = Path(folder) if folder else None
        self._lock = threading.Lock()
        self._events: dict[str, list[dict[str, Any]]] = {}
        self.follow('')

    def follow(self, robot: str) -> None:
        """Hear a robot of a fleet, too; a robot that is alone has no name."""
        topic = name_for(robot, 'events')
        StateSubscription(self._node, ObservedEvents, topic, partial(self._on_events, robot))

    def listed(self, robot: str = '') -> dict[str, Any]:
        """Return all events of a robot, the newest first, and how many were false alarms."""
        with self._lock:
            events, heard = self._events.get(robot, []), robot in self._events
        told = [each for each in events if each.get('severity', 0) >= 3]
        false = sum(each.get('state') == 'false alarm' for each in told)
        answered = sum(each.get('state') in _ANSWERED for each in told)
        return {
            'ok': True,
            'watching': heard,
            'events': events,
            'alerts': len(told),
            'answered': answered,
            'false': false,
        }

    def baseline(self, robot: str = '') -> dict[str, Any]:
        """Return what the first look found and the map does not show, and nobody has accepted."""
        with self._lock:
            events = [each for each in self._events.get(robot, ()) if each['seen'] == 'unmapped']
        waiting = [each for each in events if each['state'] in _WAITING]
        return {'ok': True, 'events': sorted(waiting, key=lambda each: each['number'])}

    def picture(self, name: str, robot: str, run: str = '', *, blur: bool) -> bytes | None:
        """Return one of the observer's pictures as JPEG; None where there is none of that name.

        Args:
            name: As an event has it.
            robot: Whose event it is.
            run: Of which run beside this one; empty: of this one.
            blur: Whether it leaves this machine: then people in it are blurred.
        """
        if self._folder is None:
            return None
        own = self._folder.parent
        return kept_picture(own.parent, name, robot, run or own.name, blur)

    def _on_events(self, robot: str, message: ObservedEvents) -> None:
        try:
            if (count := len(message.events)) > MOST_EVENTS:
                raise ValueError(f'{count} events: expected at most {MOST_EVENTS}')
            events = [event_from_ros(each).to_json() for each in message.events]
        except ValueError as error:
            self._node.get_logger().warn(f'events: {error}', throttle_duration_sec=60.0)
            return
        with self._lock:
            self._events[robot] = events
