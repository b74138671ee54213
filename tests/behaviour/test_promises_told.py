"""What cannot be kept is told at the start, and again only when that changes."""

from __future__ import annotations

from patrol_policy.promises import LATER, NEVER, UNKNOWN, WITHIN, Promise, summary, verdicts


def promise(place: str, verdict: str, wait: float) -> Promise:
    return Promise(place, verdict, 240.0, wait, f'{place}: {verdict}')


def test_a_little_late_is_one_short_line_and_no_news():
    early = [promise('R1', WITHIN, 239.0), promise('R2', LATER, 252.0)]
    later = [promise('R1', LATER, 250.0), promise('R2', WITHIN, 240.0)]
    assert summary(early) == (
        '1 of 2 places can be visited within their thresholds; R2 up to 5 % later than theirs'
    )
    assert verdicts(early) == verdicts(later) == {'R1': WITHIN, 'R2': WITHIN}


def test_much_later_and_never_are_news_and_what_is_not_known_is_none():
    found = [promise('R1', LATER, 600.0), promise('R2', NEVER, 1e9), promise('R3', UNKNOWN, 1e9)]
    assert verdicts(found) == {'R1': LATER, 'R2': NEVER}
    assert summary(found).endswith('R1: later; R2: never; R3: unknown')
