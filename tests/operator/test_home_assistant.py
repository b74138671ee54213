"""Home Assistant finds the robot, its alarms and the doors by itself."""

from __future__ import annotations

import json
from dataclasses import replace

import pytest

from surveillance_operator.notify.home_assistant import Discovery
from surveillance_operator.notify.notification import Notification

pytestmark = pytest.mark.unit
DOOR = Notification(
    'k', '3: door D1/a is open', 'event', '3', 'observer', 'Bob', False, 1.0,
    {'kind': 'door', 'subject': 'D1/a', 'seen': 'open'},
)  # fmt: skip


def states(discovery: Discovery, told: Notification) -> dict[str, str]:
    return {
        each.topic: each.payload
        for each in discovery.messages(told)
        if not each.topic.endswith('/config')
    }


def test_a_door_an_alarm_and_the_news_are_entities_of_one_device() -> None:
    configs = {
        each.topic: json.loads(each.payload)
        for each in Discovery('patrol').messages(DOOR)
        if each.topic.endswith('/config')
    }
    assert set(configs) == {
        'homeassistant/binary_sensor/patrol_Bob/alarm/config',
        'homeassistant/sensor/patrol_Bob/news/config',
        'homeassistant/binary_sensor/patrol_Bob/door_D1_a/config',
    }
    assert len({each['unique_id'] for each in configs.values()}) == 3
    assert {each['device']['identifiers'][0] for each in configs.values()} == {'patrol_Bob'}
    shown = states(Discovery('patrol'), DOOR)
    assert {each['state_topic'] for each in configs.values()} == set(shown)


def test_the_alarm_is_off_when_the_last_one_is_over() -> None:
    discovery = Discovery('patrol')
    assert states(discovery, DOOR)['patrol/Bob/alarm'] == 'ON'
    other = replace(DOOR, name='4', event={}, text='x' * 400)
    assert len(states(discovery, other)['patrol/Bob/news']) == 255
    first = states(discovery, replace(DOOR, over=True))
    assert (first['patrol/Bob/alarm'], first['patrol/Bob/door_D1_a']) == ('ON', 'OFF')
    assert states(discovery, replace(other, over=True))['patrol/Bob/alarm'] == 'OFF'
    assert states(discovery, replace(DOOR, kind='test', event={}))['patrol/Bob/alarm'] == 'OFF'
