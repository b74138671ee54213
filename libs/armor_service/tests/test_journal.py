"""The journal: what was appended is there again, whatever happened to the process."""

from __future__ import annotations

import os
import resource
import shutil
import zlib
from functools import partial
from pathlib import Path

import pytest

from armor_service.protocol import StoreError
from armor_service.store import Journal


def full(*_: object) -> None:
    """Stand for a call that finds the disk full."""
    raise OSError(28, 'No space left on device')


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


def test_folders_are_made_as_deep_as_they_are_named(tmp_path: Path) -> None:
    Journal(tmp_path / 'deep' / 'er' / 'store').close()
    Journal(tmp_path / 'deep' / 'er' / 'store').close()
    assert (tmp_path / 'deep' / 'er' / 'store' / 'journal-0.log').exists()


def test_sizes_are_those_of_the_files(tmp_path: Path) -> None:
    journal = Journal(tmp_path)
    assert (journal.size, journal.snapshot_size) == (0, 0)
    journal.append([['a', 1], ['b', 2]])
    size = (tmp_path / 'journal-0.log').stat().st_size
    assert journal.size == size > 0
    journal.close()
    journal = Journal(tmp_path)
    assert (journal.size, journal.snapshot_size) == (size, 0)
    number = journal.begin_snapshot()
    assert (number, journal.size) == (1, 0)
    journal.append([['c', 3]])
    journal.finish_snapshot(number, ['state', 'more'])
    sizes = [(tmp_path / f'{kind}-1.log').stat().st_size for kind in ('journal', 'snapshot')]
    assert [journal.size, journal.snapshot_size] == sizes
    journal.close()
    journal = Journal(tmp_path)
    assert [journal.size, journal.snapshot_size] == sizes
    assert journal.records() == ['state', 'more', ['c', 3]]
    assert journal.records() == [], 'once'
    journal.close()


def test_a_line_has_its_checksum_its_length_and_whether_the_batch_goes_on(tmp_path: Path) -> None:
    """Written out, so that a store of today can be read by every later version."""
    journal = Journal(tmp_path)
    journal.append([['a', 1], ['b', 'ü']])
    journal.append([[]])
    journal.close()
    bodies = [b'7+ ["a",1]', b'14 ["b","\\u00fc"]', b'2 []']
    lines = [b'%08x %s\n' % (zlib.crc32(body), body) for body in bodies]
    assert (tmp_path / 'journal-0.log').read_bytes() == b''.join(lines)


@pytest.mark.parametrize(
    ('end', 'is_cut'),
    [
        (b'0', True),
        (b'0123abcd', True),
        (b'0123abcd ', True),
        (b'0123abcd 12', True),
        (b'0123abcd 12+', True),
        (b'0123abcd 12+ ["a', True),
        (b'0123abcd 12 ["a",1', True),
        # No write that was cut off looks like these.
        (b'0123abcde', False),
        (b'xyz', False),
        (b'0123abcd x', False),
        (b'0123abcd 12 \x00', False),
        (b'0123ABCD', False),
    ],
)
def test_what_a_crash_cut_off_is_told_from_damage(tmp_path: Path, end: bytes, is_cut: bool) -> None:
    journal = Journal(tmp_path)
    journal.append([1])
    journal.close()
    with (tmp_path / 'journal-0.log').open('ab') as file:
        file.write(end)
    journal = Journal(tmp_path)
    assert journal.records() == [1]
    assert bool(journal.notes) != is_cut
    assert len(list(tmp_path.glob('damaged-*'))) == (0 if is_cut else 1)
    journal.append([2])
    journal.close()
    assert reopened(tmp_path) == [1, 2]


def test_only_the_last_segment_may_be_cut_off(tmp_path: Path) -> None:
    journal = Journal(tmp_path)
    journal.append([1])
    journal.append([2, 3])
    journal.begin_snapshot()
    journal.append([4])
    journal.close()
    path = tmp_path / 'journal-0.log'
    path.write_bytes(path.read_bytes()[:-2])
    journal = Journal(tmp_path)
    # The first of the batch that was damaged is whole, and kept.
    assert journal.records() == [1, 2, 4]
    (note,) = journal.notes
    assert f'{path}: 1 damaged entry, from byte ' in note
    assert note.endswith('; 2 whole ones are kept')
    journal.close()


def test_several_damaged_entries_are_counted(tmp_path: Path) -> None:
    journal = Journal(tmp_path)
    for number in range(4):
        journal.append([number])
    journal.close()
    path = tmp_path / 'journal-0.log'
    lines = path.read_bytes().splitlines(keepends=True)
    lines[1] = lines[3] = b'no record\n'
    path.write_bytes(b''.join(lines))
    journal = Journal(tmp_path)
    assert journal.records() == [0, 2]
    (note,) = journal.notes
    assert note.startswith(f'{path}: 2 damaged entries, from byte {len(lines[0])}, put aside in ')
    journal.close()


def test_damage_that_cannot_be_put_aside_is_told_and_costs_no_more(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    journal = Journal(tmp_path)
    journal.append([1])
    journal.close()
    with (tmp_path / 'journal-0.log').open('ab') as file:
        file.write(b'no record\n')

    with monkeypatch.context() as patch:
        patch.setattr(shutil, 'copyfile', full)
        journal = Journal(tmp_path)
    assert journal.records() == [1]
    (note,) = journal.notes
    assert note.endswith('; 1 whole ones are kept; not put aside: No space left on device')
    journal.append([2])
    journal.close()
    assert reopened(tmp_path) == [1, 2]


def test_a_part_that_cannot_be_read_ends_the_start_with_its_name(tmp_path: Path) -> None:
    (tmp_path / 'journal-0.log').mkdir()
    with pytest.raises(StoreError, match=r'journal-0\.log: Is a directory'):
        Journal(tmp_path)
    (tmp_path / 'journal-0.log').rmdir()
    Journal(tmp_path).close()


def test_a_snapshot_that_cannot_be_written_leaves_the_journal(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    journal = Journal(tmp_path)
    journal.append([1])

    with monkeypatch.context() as patch:
        patch.setattr(os, 'fsync', full)
        with pytest.raises(StoreError, match=r': No space left on device$'):
            journal.begin_snapshot()
        journal.append([2])
    number = journal.begin_snapshot()
    with monkeypatch.context() as patch:
        patch.setattr(os, 'fsync', full)
        with pytest.raises(StoreError, match=r': No space left on device$'):
            journal.finish_snapshot(number, ['state'])
    assert not list(tmp_path.glob('*.tmp'))
    journal.append([3])
    journal.close()
    assert reopened(tmp_path) == [1, 2, 3]


def test_a_closed_journal_takes_nothing(tmp_path: Path) -> None:
    journal = Journal(tmp_path)
    journal.close()
    for use in (partial(journal.append, [1]), journal.begin_snapshot, journal.check_open):
        with pytest.raises(StoreError, match=r': closed$'):
            use()
    assert reopened(tmp_path) == []
