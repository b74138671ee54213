"""The desk of a run that goes on."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest

from surveillance_operator.desk.live_desk import LiveDesk
from tests.operator.test_event_index import NIGHT, Run

pytestmark = pytest.mark.unit


def test_the_desk_tells_what_is_open_when_it_changes_and_finds_older_runs(tmp_path: Path) -> None:
    old, new = tmp_path / '20260101-000000', tmp_path / '20260102-000000'
    Run(old).incident('old', 'begin')
    run, told = Run(new), list[Any]()
    desk = LiveDesk(new, told.append, lambda: run.now)
    desk.look()
    run.incident('abc', 'begin')
    desk.look()
    desk.look()
    assert [[each['id'] for each in part['open']] for part in told] == [[], ['abc']]
    desk.read_older(lambda: False)
    assert desk.questions()['search']()['count'] == 2
    assert desk.part()['count'] == 1
    with pytest.raises(ValueError, match='no event'):
        desk.find('nothing')


def test_a_shelf_that_ends_is_told(tmp_path: Path) -> None:
    run, told = Run(tmp_path / 'run'), list[Any]()
    desk = LiveDesk(tmp_path / 'run', told.append, lambda: run.now)
    run.incident('abc', 'begin')
    run.say('shelve', 'abc', until=NIGHT + 100)
    desk.look()
    run.now += 101
    desk.look()
    assert [part['open'][0]['state'] for part in told] == ['shelved', 'unacknowledged']
