"""What keeps a file from being written is told once, and when it is over."""

from __future__ import annotations

import pytest

from armor_service.store import write_failure
from armor_service.store.write_failure import WriteFailure


def test_a_failure_is_told_once_and_its_end(monkeypatch: pytest.MonkeyPatch) -> None:
    told: list[str] = []
    failure = WriteFailure(told.append)
    monkeypatch.setattr(write_failure, 'TRIED_AFTER', 1000.0)
    failure.met(OSError('full'))
    failure.tell('is full')
    failure.tell('is full, still')
    assert failure.text == 'full'
    assert not failure.may_be_tried
    failure.over()
    assert failure.text == ''
    assert told == ['is full', 'can be written again, every change is kept']


def test_a_failure_that_is_over_before_anybody_was_told_says_nothing(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    told: list[str] = []
    failure = WriteFailure(told.append)
    failure.met(OSError('locked'))
    assert not failure.is_to_be_told
    monkeypatch.setattr(write_failure, 'TOLD_AFTER', 0.0)
    assert failure.is_to_be_told
    failure.over()
    assert told == []
