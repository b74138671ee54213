"""A person's answers to events, as one line.

`acknowledge 3`, `normal 3`, `false 3`, `events`; `baseline` lists what the map does not show and
nobody has accepted, `normal baseline` accepts all of it; `movable` lists what moves often, `movable
undo 2` has it told again. What of the baseline a person acknowledges is refused: neither time nor
`normal baseline` accepts it.
"""

from __future__ import annotations

from collections.abc import Callable

from indoor_watch.events import Event, EventBook, EventState
from indoor_watch.movables import Movables
from strict_files.suggestions import nearest

ANSWERS = {
    'acknowledge': EventState.ACKNOWLEDGED,
    'normal': EventState.NORMAL,
    'false': EventState.FALSE,
}
COMMANDS = (*ANSWERS, 'events', 'baseline', 'movable')
MOST_LISTED = 20


def answered(
    book: EventBook,
    line: str,
    answer: Callable[[int, EventState], Event] | None = None,
    movables: Movables | None = None,
) -> str:
    """Take an answer, and return what was done.

    Args:
        book: The events.
        line: The answer and the event's number; or `events`, which lists the open ones.
        answer: Takes the answer; None: the book itself.
        movables: What moves often; None: nothing is known of that.

    Raises:
        ValueError: What was wrong, and what was expected.
    """
    words = line.split()
    if words == ['baseline']:
        found = _baseline(book)
        lines = [each.words() for each in found[:MOST_LISTED]]
        more = len(found) - len(lines)
        listed = '; '.join([*lines, *([f'and {more} more'] if more else [])])
        return listed or 'all that stands there is on the map, or accepted'
    if words == ['normal', 'baseline']:
        found = [each for each in _baseline(book) if each.state == EventState.OPEN]
        for each in found:
            (answer or book.answer)(each.number, EventState.NORMAL)
        return f'{len(found)} things are normal from now on'
    if words[:1] == ['movable']:
        return _movable(movables or Movables(), words[1:])
    if words == ['events']:
        going_on = [
            each for each in book.events if each.state in (EventState.OPEN, EventState.ACKNOWLEDGED)
        ]
        lines = [f'{each.words()} ({each.state})' for each in going_on[:MOST_LISTED]]
        more = len(going_on) - len(lines)
        return '; '.join([*lines, *([f'and {more} more'] if more else [])]) or 'no event is open'
    if not words or words[0] not in ANSWERS:
        given = words[0] if words else ''
        raise ValueError(f'got {given!r}, expected {nearest(given, COMMANDS)}')
    if len(words) != 2 or not words[1].isascii() or not words[1].isdigit():
        raise ValueError(f"expected an event's number, such as '{words[0]} 3'")
    number = int(words[1])
    try:
        event = (answer or book.answer)(number, ANSWERS[words[0]])
    except KeyError:
        known = ', '.join(str(each.number) for each in book.events[:5]) or 'none'
        raise ValueError(f'there is no event {number}, the newest are: {known}') from None
    return f'event {event.words()} is {event.state}'


def _baseline(book: EventBook) -> list[Event]:
    """Return what was on no map at the first look, and waits for a person's word."""
    return [
        each
        for each in book.events
        if each.seen == 'unmapped' and each.state in (EventState.OPEN, EventState.ACKNOWLEDGED)
    ]


def _movable(movables: Movables, words: list[str]) -> str:
    """Return what moves often, or undo that it is told no more.

    Raises:
        ValueError: What was wrong, and what was expected.
    """
    if not words:
        return '; '.join(each.words() for each in movables.listed()) or 'nothing moves often'
    if len(words) != 2 or words[0] != 'undo' or not (words[1].isascii() and words[1].isdigit()):
        raise ValueError("expected 'movable' or 'movable undo 2'")
    try:
        return f'told again when it moves: {movables.undo(int(words[1])).words()}'
    except KeyError:
        raise ValueError(f'there is no movable thing {words[1]}') from None
