"""What Home Assistant finds by itself on an MQTT broker: the robot, its alarms, the doors.

Each robot is a device with a sensor of problems, one of the last news, and one for each door that
was told of (https://www.home-assistant.io/integrations/mqtt/#mqtt-discovery). What is published is
retained, so that Home Assistant knows it after its own restart.
"""

from __future__ import annotations

import json
import re
from collections.abc import Iterator
from typing import Any, NamedTuple

from surveillance_operator.notify.notification import Notification

PREFIX = 'homeassistant'
LONGEST_STATE = 255
"""Signs of a state: Home Assistant takes no more."""
_OPEN = {'open': 'ON', 'ajar': 'ON', 'closed': 'OFF'}


class Retained(NamedTuple):
    """A message that the broker keeps.

    Attributes:
        topic, payload: Of the message.
    """

    topic: str
    payload: str


class Discovery:
    """Tells Home Assistant of notifications.

    Args:
        topic: Of the sink, below which the states are.
    """

    def __init__(self, topic: str) -> None:
        self._topic = topic
        self._going_on: dict[str, set[tuple[str, str, str]]] = {}

    def messages(self, told: Notification) -> Iterator[Retained]:
        """Yield what is to be published for a notification."""
        robot = told.robot
        going_on = self._going_on.setdefault(robot, set())
        what = told.node, told.kind, told.name
        if told.over:
            going_on.discard(what)
        elif told.kind != 'test':
            going_on.add(what)
        state = 'ON' if going_on else 'OFF'
        yield from self._entity(
            'binary_sensor', robot, 'alarm', 'Alarm', state, device_class='problem'
        )
        yield from self._entity('sensor', robot, 'news', 'Last news', told.text[:LONGEST_STATE])
        event = told.event
        seen = _OPEN.get(str(event.get('seen', '')))
        if event.get('kind') == 'door' and event.get('subject') and seen is not None:
            door = str(event['subject'])
            if told.over:  # it is otherwise again
                seen = 'OFF' if seen == 'ON' else 'ON'
            name = f'Door {door}'
            yield from self._entity(
                'binary_sensor', robot, f'door_{door}', name, seen, device_class='door'
            )

    def _entity(
        self, kind: str, robot: str, key: str, name: str, state: str, **more: Any
    ) -> Iterator[Retained]:
        own, of = _plain(robot), _plain(key)
        topic = f'{self._topic}/{own}/{of}'
        config = {
            'name': name,
            'unique_id': f'patrol_{own}_{of}',
            'state_topic': topic,
            'device': {
                'identifiers': [f'patrol_{own}'],
                'name': robot,
                'manufacturer': 'surveillance',
            },
            **more,
        }
        yield Retained(f'{PREFIX}/{kind}/patrol_{own}/{of}/config', json.dumps(config))
        yield Retained(topic, state)


def _plain(name: str) -> str:
    return re.sub(r'[^A-Za-z0-9_-]', '_', name)
