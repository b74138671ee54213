"""A person's answers to events, as one line: `acknowledge 3`, `normal 3`, `false 3`, `events`."""

from __future__ import annotations

from collections.abc import Callable

from indoor_watch.events import Event, EventBook, EventState
from strict_files.suggestions import nearest

ANSWERS = {
    'acknowledge': EventState.ACKNOWLEDGED,
    'normal': EventState.NORMAL,
    'false': EventState.FALSE,
}
MOST_LISTED = 20


def answered(
    book: EventBook, line: str, answer: Callable[[int, EventState], Event] | None = None
) -> str:
    """Take an answer, and return what was done.

    Args:
        book: The events.
        line: The answer and the event's number; or `events`, which lists the open ones.
        answer: Takes the answer; None: the book itself.

    Raises:
        ValueError: What was wrong, and what was expected.
    """
    words = line.split()
    if words == ['events']:
        going_on = [
            each for each in book.events if each.state in (EventState.OPEN, EventState.ACKNOWLEDGED)
        ]
        lines = [f'{each.words()} ({each.state})' for each in going_on[:MOST_LISTED]]
        more = len(going_on) - len(lines)
        return '; '.join([*lines, *([f'and {more} more'] if more else [])]) or 'no event is open'
    if not words or words[0] not in ANSWERS:
        given = words[0] if words else ''
        raise ValueError(f'got {given!r}, expected {nearest(given, [*ANSWERS, "events"])}')
    if len(words) != 2 or not words[1].isascii() or not words[1].isdigit():
        raise ValueError(f"expected an event's number, such as '{words[0]} 3'")
    number = int(words[1])
    try:
        event = (answer or book.answer)(number, ANSWERS[words[0]])
    except KeyError:
        known = ', '.join(str(each.number) for each in book.events[:5]) or 'none'
        raise ValueError(f'there is no event {number}, the newest are: {known}') from None
    return f'event {event.words()} is {event.state}'
