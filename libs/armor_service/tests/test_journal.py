"""The journal: what was appended is there again, whatever happened to the process."""

from __future__ import annotations

import os
import resource
from functools import partial
from pathlib import Path

import pytest

from armor_service.protocol import StoreError
from armor_service.store import Journal


def reopened(directory: Path) -> list[object]:
    journal = Journal(directory)
    try:
        return list(journal.records())
    finally:
        journal.close()


def test_records_come_back_in_order(tmp_path: Path) -> None:
    journal = Journal(tmp_path / 'store')
    journal.append([['a', 1], ['b', 'ü\n']])
    journal.append([['c', None]])
    journal.close()
    assert reopened(tmp_path / 'store') == [['a', 1], ['b', 'ü\n'], ['c', None]]


def test_a_record_cut_off_at_any_byte_is_dropped_and_the_journal_goes_on(tmp_path: Path) -> None:
    journal = Journal(tmp_path)
    journal.append([1])
    journal.append([2, 3])
    journal.close()
    path = tmp_path / 'journal-0.log'
    whole = path.read_bytes()
    first = whole.index(b'\n') + 1
    for length in range(first, len(whole)):
        path.write_bytes(whole[:length])
        journal = Journal(tmp_path)
        # Only the line's end was not written: the batch is there.
        kept = [1, 2, 3] if length == len(whole) - 1 else [1]
        assert list(journal.records()) == kept, length
        assert journal.notes == []
        journal.append([4])
        journal.close()
        assert reopened(tmp_path) == [*kept, 4]


def test_one_flipped_bit_costs_one_record_and_is_put_aside_with_one_line(tmp_path: Path) -> None:
    journal = Journal(tmp_path)
    journal.append(['first'])
    journal.append(['second', 'third'])
    journal.append(['last'])
    journal.close()
    path = tmp_path / 'journal-0.log'
    whole = path.read_bytes()
    for bit in range(len(whole) * 8):
        data = bytearray(whole)
        data[bit // 8] ^= 1 << bit % 8
        path.write_bytes(data)
        journal = Journal(tmp_path)
        records = list(journal.records())
        assert len(records) >= 3, bit
        assert [r for r in ('first', 'second', 'third', 'last') if r in records] == records, bit
        if len(records) < 4:
            (note,) = journal.notes
            assert note.startswith(f'{path}: 1 damaged entry, from byte ')
            assert note.endswith('; 3 whole ones are kept')
            (aside,) = tmp_path.glob('damaged-*')
            assert aside.read_bytes() == data
            aside.unlink()
        journal.append(['new'])
        journal.close()
        again = Journal(tmp_path)
        assert list(again.records()) == [*records, 'new'], bit
        assert again.notes == [], 'what was mended is not reported again'
        again.close()


@pytest.mark.parametrize('size', [1, 100, 5000])
def test_a_file_of_zeros_is_not_taken_for_an_empty_one(tmp_path: Path, size: int) -> None:
    journal = Journal(tmp_path)
    journal.append([1])
    journal.close()
    (tmp_path / 'journal-0.log').write_bytes(bytes(size))
    journal = Journal(tmp_path)
    assert list(journal.records()) == []
    assert len(journal.notes) == 1
    assert 'put aside in damaged-' in journal.notes[0]
    journal.append([2])
    journal.close()
    assert reopened(tmp_path) == [2]


def test_zeros_behind_the_records_are_put_aside(tmp_path: Path) -> None:
    """As some file systems leave a file after the power failed."""
    journal = Journal(tmp_path)
    journal.append([1])
    journal.close()
    with (tmp_path / 'journal-0.log').open('ab') as file:
        file.write(bytes(4000))
    journal = Journal(tmp_path)
    assert list(journal.records()) == [1]
    assert len(journal.notes) == 1
    journal.close()


def test_a_snapshot_stands_for_what_was_before_it(tmp_path: Path) -> None:
    journal = Journal(tmp_path)
    journal.append([1])
    journal.append([2])
    number = journal.begin_snapshot()
    journal.append([3])
    journal.finish_snapshot(number, ['state'])
    journal.append([4])
    journal.close()
    assert reopened(tmp_path) == ['state', 3, 4]
    assert sorted(p.name for p in tmp_path.iterdir()) == ['journal-1.log', 'lock', 'snapshot-1.log']


def test_a_snapshot_that_was_not_finished_changes_nothing(tmp_path: Path) -> None:
    journal = Journal(tmp_path)
    journal.append([1])
    journal.begin_snapshot()
    journal.append([2])
    (tmp_path / 'snapshot-1.tmp').write_bytes(b'half')
    journal.close()
    assert reopened(tmp_path) == [1, 2]
    assert not (tmp_path / 'snapshot-1.tmp').exists()


def test_only_one_process_at_a_time(tmp_path: Path) -> None:
    journal = Journal(tmp_path)
    with pytest.raises(StoreError, match='in use by another process'):
        Journal(tmp_path)
    journal.close()
    Journal(tmp_path).close()


def test_a_write_that_fails_leaves_nothing(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    journal = Journal(tmp_path)
    journal.append([1])

    def full(_: int) -> None:
        raise OSError(28, 'No space left on device')

    with monkeypatch.context() as patch:
        patch.setattr(os, 'fdatasync', full)
        with pytest.raises(StoreError, match='No space left'):
            journal.append([2])
    journal.append([3])
    journal.close()
    assert reopened(tmp_path) == [1, 3]


def test_a_directory_that_cannot_be_used(tmp_path: Path) -> None:
    (tmp_path / 'file').write_text('')
    with pytest.raises(StoreError, match='file'):
        Journal(tmp_path / 'file' / 'store')


def test_a_record_that_fits_in_part_is_refused_and_leaves_nothing(tmp_path: Path) -> None:
    journal = Journal(tmp_path)
    journal.append(['first'])
    end = (tmp_path / 'journal-0.log').stat().st_size
    before = resource.getrlimit(resource.RLIMIT_FSIZE)
    # A file at its size limit takes what fits, as a disk does that is almost full.
    resource.setrlimit(resource.RLIMIT_FSIZE, (end + 20, before[1]))
    try:
        with pytest.raises(StoreError, match='too large'):
            journal.append(['x' * 200])
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, before)
    journal.append(['second'])
    journal.close()
    assert reopened(tmp_path) == ['first', 'second']


def test_what_a_failed_write_left_is_removed_before_the_next(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    journal = Journal(tmp_path)
    journal.append([1])

    def broken(*_: object) -> None:
        raise OSError(5, 'Input/output error')

    with monkeypatch.context() as patch:
        patch.setattr(os, 'fdatasync', broken)
        patch.setattr(os, 'ftruncate', broken)
        for record in (2, 3):
            with pytest.raises(StoreError, match='Input/output error'):
                journal.append([record])
    journal.append([4])
    journal.close()
    assert reopened(tmp_path) == [1, 4]


def test_a_folder_that_was_moved_away_takes_nothing_until_it_is_back(tmp_path: Path) -> None:
    folder, away = tmp_path / 'store', tmp_path / 'away'
    journal = Journal(folder)
    journal.append([1])
    folder.rename(away)
    for _ in range(2):
        with pytest.raises(StoreError, match='is no longer there'):
            journal.append([2])
        # Another one in its place is not the one that is written to.
        folder.mkdir(exist_ok=True)
        (folder / 'journal-0.log').write_bytes(b'')
    (folder / 'journal-0.log').unlink()
    folder.rmdir()
    away.rename(folder)
    journal.append([3])
    journal.close()
    assert reopened(folder) == [1, 3]


@pytest.mark.parametrize('begun', [False, True])
def test_a_snapshot_touches_no_other_store_in_its_place(tmp_path: Path, begun: bool) -> None:
    folder = tmp_path / 'store'
    journal = Journal(folder)
    journal.append([1])
    number = journal.begin_snapshot() if begun else 0
    folder.rename(tmp_path / 'away')
    other = Journal(folder)
    other.append(['other'])
    snapshot = (
        partial(journal.finish_snapshot, number, ['state']) if begun else journal.begin_snapshot
    )
    with pytest.raises(StoreError, match='is no longer there'):
        snapshot()
    for each in (journal, other):
        each.close()
        each.close()
    assert {path.name for path in folder.iterdir()} == {'journal-0.log', 'lock'}
    assert reopened(folder) == ['other']


@pytest.mark.parametrize('lost', ['snapshot-1.log', 'journal-1.log'])
def test_a_part_that_is_missing_is_reported(tmp_path: Path, lost: str) -> None:
    journal = Journal(tmp_path)
    journal.append([1])
    number = journal.begin_snapshot()
    journal.append([2])
    if lost.startswith('snapshot'):
        journal.finish_snapshot(number, ['state'])
    else:
        journal.begin_snapshot()
        journal.append([3])
    journal.close()
    (tmp_path / lost).unlink()
    journal = Journal(tmp_path)
    assert any('is missing' in note for note in journal.notes)
    assert list(journal.records()) == ([2] if lost.startswith('snapshot') else [1, 3])
    journal.close()
