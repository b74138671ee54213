"""What is pressed on the page is said to the node `alarm`, and to the observer."""

from __future__ import annotations

from typing import Any

import pytest

from state_machines.exceptions import CallError
from surveillance_operator.desk.alarm_actions import AlarmActions
from surveillance_operator.desk.event_index import DeskEvent
from surveillance_operator.desk.handling import parsed

pytestmark = pytest.mark.unit


class Listeners:
    """The two who are told."""

    def __init__(self, **event: Any) -> None:
        self.event = DeskEvent('run/bob/3', 'run', 'bob', 'door', 'D6', 1.0, **event)
        self.said: list[str] = []
        self.away = False
        self.actions = AlarmActions(lambda _key: self.event, self._alarm, self._observer)

    def _alarm(self, line: str) -> str:
        self.said.append(line)
        return 'done'

    def _observer(self, robot: str, line: str) -> str:
        if self.away:
            raise CallError('observer is not running')
        self.said.append(f'{robot}/{line}')
        return 'noted'


def test_acknowledged_is_told_to_both_and_holds_without_the_observer() -> None:
    told = Listeners(number=3, ids=('abc',))
    told.actions.say('acknowledge', 'k', 'I go', by='Anna')
    assert told.said == ['acknowledge abc by Anna: I go', 'bob/acknowledge 3']
    told.away = True
    assert told.actions.say('acknowledge', 'k') == 'done'
    with pytest.raises(CallError):
        told.actions.say('normal', 'k')


def test_no_word_can_be_taken_for_another_one() -> None:
    told = Listeners(ids=('abc',))
    told.actions.say('assign', 'k', 'a: by the way', 'Ben\nby: the boss', by='Eve: x')
    done = parsed(told.said[0], 0.0)
    assert (done.verb, done.id, done.note) == ('assign', 'abc', 'a: by the way')
    assert done.by == 'Eve x'


def test_what_nobody_was_called_for_is_not_acknowledged() -> None:
    with pytest.raises(ValueError, match='nobody was called'):
        Listeners(number=3).actions.say('acknowledge', 'k')
    told = Listeners(number=3)
    assert told.actions.say('normal', 'k') == 'noted'
    told.actions.mute('person', 'daily 08:00-18:00', by='Anna')
    told.actions.test('office')
    assert told.said[1:] == ['mute person daily 08:00-18:00 by Anna', 'test office']
