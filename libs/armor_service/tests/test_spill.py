"""What was answered while a file could not be written: kept once, and found by who comes next."""

from __future__ import annotations

from pathlib import Path

import pytest

from armor_service.changes import AddAxiom
from armor_service.quarantine import Submission
from armor_service.store.records import submission_of
from armor_service.store.spill import Spill
from owl_reasoner.owl.axioms import ClassAssertion

FIRST, SECOND = (Submission('c', 1.0, (AddAxiom(ClassAssertion('#Room', name)),)) for name in '12')
STATE = {'mounted': 'c'}


def test_each_directive_is_kept_once_and_what_was_merged_is_not_read(tmp_path: Path) -> None:
    spill = Spill(tmp_path / 'o.spill', synced=True)
    spill.keep([FIRST], STATE, [])
    spill.keep([FIRST], STATE, [])
    spill.keep([FIRST, SECOND], STATE, [])
    spill.close()
    again, notes = Spill(spill.path), list[str]()
    found = [submission_of(*one) for told, _, _ in again.read(0, notes) for one in told]
    assert found == [FIRST, SECOND]
    assert again.number == spill.number == 2
    assert len(list(again.read(1, notes))) == 1
    assert notes == []


def test_what_could_not_be_kept_is_kept_with_the_next(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def full(*_: object) -> None:
        raise OSError(28, 'No space left on device')

    spill = Spill(tmp_path / 'o.spill')
    with monkeypatch.context() as patch:
        patch.setattr(Spill, 'append', full)
        spill.keep([FIRST], STATE, [])
    assert (spill.kept, spill.number) == (0, 0)
    spill.keep([FIRST, SECOND], STATE, [])
    spill.close()
    ((told, state, waiting),) = Spill(spill.path).read(0, [])
    assert [submission_of(*one) for one in told] == [FIRST, SECOND]
    assert (state, waiting) == (STATE, [])


def test_a_damaged_line_is_told_and_the_others_are_read(tmp_path: Path) -> None:
    spill = Spill(tmp_path / 'o.spill')
    spill.keep([FIRST], STATE, [])
    spill.close()
    spill.path.write_bytes(b'rubbish\n' + spill.path.read_bytes())
    notes: list[str] = []
    assert len(list(Spill(spill.path).read(0, notes))) == 1
    assert notes == [f'{spill.path}: 1 damaged lines are left out']
    spill.clear()
    assert not spill.path.exists()
