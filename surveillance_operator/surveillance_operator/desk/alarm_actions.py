"""What a person at the page does about alarms: said to the node `alarm`, and to the observer."""

from __future__ import annotations

from collections.abc import Callable
from contextlib import suppress

from state_machines.exceptions import CallError
from surveillance_operator.desk.event_index import DeskEvent

OF_OBSERVER = ('acknowledge', 'normal', 'false')
"""What the observer is told as well, in its own words: it keeps what is normal."""


class AlarmActions:
    """Answers alarms.

    Args:
        find: Returns the event of a key; raises `ValueError`.
        tell_alarm: Says a line to the node `alarm`; returns what came of it.
        tell_observer: Says a line to the observer of a robot.
    """

    def __init__(
        self,
        find: Callable[[str], DeskEvent],
        tell_alarm: Callable[[str], str],
        tell_observer: Callable[[str, str], str],
    ) -> None:
        self._find = find
        self._tell_alarm, self._tell_observer = tell_alarm, tell_observer

    def say(self, verb: str, key: str, note: str = '', more: str = '', by: str = '') -> str:
        """Answer an alarm: acknowledge, note, assign, shelve, unshelve, normal or false.

        `key` is the event's, `more` is whom it is assigned to or for how long it is shelved.
        """
        event = self._find(key)
        said = ''
        if event.number and verb in ('normal', 'false'):
            # What the observer does not take is not answered.
            said = self._tell_observer(event.robot, f'{verb} {event.number}')
        if event.ids:
            said = self._tell_alarm(_line(verb, event.ids[-1], more, by, note))
        elif not said:
            raise ValueError(f'nobody was called for {event.text}: there is nothing to {verb}')
        if event.number and verb == 'acknowledge':
            with suppress(ValueError, CallError):  # the calls have ended all the same
                self._tell_observer(event.robot, f'{verb} {event.number}')
        return said

    def mute(self, kind: str, hours: str = '', note: str = '', by: str = '') -> str:
        """Have nobody called for a kind of alarm in some hours, such as daily 08:00-18:00."""
        return self._tell_alarm(_line('mute', kind, hours, by, note))

    def unmute(self, kind: str, by: str = '') -> str:
        """Have people called for a kind again."""
        return self._tell_alarm(_line('unmute', kind, '', by, ''))

    def test(self, sink: str) -> str:
        """Send a test message to one who is told of alarms."""
        return self._tell_alarm(f'test {sink}')


def _line(verb: str, about: str, more: str, by: str, note: str) -> str:
    """Return a line for the node `alarm`, in which no word can be taken for another one's."""
    words = [' '.join(str(each).split()).replace(': ', ' ') for each in (verb, about, more)]
    name = ' '.join(str(by).split()).replace(': ', ' ')
    line = ' '.join(each for each in words if each)
    line += f' by {name}' if name else ''
    return line + (f': {" ".join(str(note).split())}' if note.strip() else '')
