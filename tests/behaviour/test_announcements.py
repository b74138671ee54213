"""What cannot be kept is told at the start, and again only when that changes."""

from __future__ import annotations

import math
from pathlib import Path

import pytest
from builtin_interfaces.msg import Time

from patrol_policy.idleness_bounds import (
    LATER,
    NEVER,
    UNKNOWN,
    WITHIN,
    IdlenessBound,
    lines,
    summary,
    verdicts,
)
from surveillance_behaviour.conversions import idleness_bounds_from, idleness_bounds_message
from surveillance_behaviour.mission.mission_log import last_idleness_bounds
from surveillance_operator.report import write_report
from surveillance_runtime.event_log import read

from .machine_runs import Killed
from .scripted_world import World


def bound(place: str, verdict: str, wait: float) -> IdlenessBound:
    return IdlenessBound(place, verdict, 240.0, wait, f'{place}: {verdict}')


def test_a_little_late_is_one_short_line_and_no_news():
    early = [bound('R1', WITHIN, 239.0), bound('R2', LATER, 252.0)]
    later = [bound('R1', LATER, 250.0), bound('R2', WITHIN, 240.0)]
    assert summary(early) == (
        'all 2 places can be visited within their thresholds or little later (R2 up to 5 %)'
    )
    assert verdicts(early) == verdicts(later) == {'R1': WITHIN, 'R2': WITHIN}


def test_much_later_and_never_are_news_and_what_is_not_known_is_none():
    found = [bound('R1', LATER, 600.0), bound('R2', NEVER, 1e9), bound('R3', UNKNOWN, 1e9)]
    assert verdicts(found) == {'R1': LATER, 'R2': NEVER}
    assert summary(found).endswith('R1: later; R2: never; R3: unknown')


def test_places_of_which_the_same_is_said_share_a_line():
    found = [bound(f'R{n}', LATER, 600.0) for n in range(11)] + [bound('E', NEVER, math.inf)]
    assert lines(found)[1:] == ['R0, R1, R2, R3, R4, R5, R6, R7 and 3 more: later', 'E: never']


def test_idleness_bounds_pass_through_their_message_with_the_hours():
    found = tuple(bound(v, v, math.inf) for v in (WITHIN, LATER, NEVER, UNKNOWN))
    message = idleness_bounds_message(found, {LATER: 'daily 08:00-18:00'}, Time())
    assert idleness_bounds_from(message) == (found, {LATER: 'daily 08:00-18:00'})
    message.status[1].values[0].value = 'soon'
    with pytest.raises(ValueError, match="idleness bound of 'later': expected a level and numbers"):
        idleness_bounds_from(message)


def test_the_record_and_the_report_tell_what_cannot_be_kept(tmp_path: Path):
    world, path = World(), tmp_path / 'events.jsonl'
    Killed('surveillance', world, path, urgency_threshold=20.0, policy='tour').run(120.0)
    found = last_idleness_bounds(read(path))
    told = {each.place: each for each in found}
    assert (told['R1'].verdict, told['R1'].threshold) == (LATER, 20.0)
    report = write_report(tmp_path).read_text()
    assert told['R1'].words in report
    assert f'What could be kept: {lines(found)[0]}' in report, 'as in the log and on the page'
