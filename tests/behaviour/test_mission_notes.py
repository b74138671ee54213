"""What a mission writes down of itself."""

from __future__ import annotations

from pathlib import Path

import pytest

from patrol_policy.idleness_bounds import IdlenessBound
from strict_files.files import FileError
from surveillance_behaviour.mission.mission_log import MissionRecord
from surveillance_behaviour.mission.mission_notes import MissionNotes
from surveillance_runtime.event_log import read

pytestmark = pytest.mark.unit

PLACES = frozenset({'E', 'C1'})


def test_only_what_has_changed_is_written_again(tmp_path: Path) -> None:
    with MissionRecord(tmp_path / 'record') as record:
        notes = MissionNotes(record, lambda: 1.0, lambda _: None)
        notes.write('end')  # before the start
        assert notes.start('patrol', 'E', PLACES, 90.0) is None
        bound = IdlenessBound('C1', 'kept', 90.0, float('inf'), 'below 90 s')
        for places, threshold in ((PLACES, 90.0), (PLACES | {'R1'}, 60.0)):
            notes.decided('C1', 'URGENT', 'it waits', places, threshold)
            notes.idleness_bounds((bound,))
    names = [each.name for each in read(tmp_path / 'record')]
    assert names == ['start', 'decision', 'idleness_bounds', 'map', 'decision']
    *_, last = read(tmp_path / 'record')
    assert last.fields['urgency_threshold'] == 60.0


def test_a_record_that_takes_nothing_is_complained_of_once(tmp_path: Path) -> None:
    record, said = MissionRecord(tmp_path / 'record'), []

    def full(*_: object, **__: object) -> None:
        raise FileError('cannot write: No space left on device')

    notes = MissionNotes(record, lambda: 1.0, said.append)
    notes.start('patrol', 'E', PLACES, 90.0)
    record.write = full  # type: ignore[method-assign]
    for _ in range(3):
        notes.visited('C1', 1.0, [], [])
    assert said == ['cannot write: No space left on device']
