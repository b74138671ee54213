"""Which recordings a name means."""

from __future__ import annotations

from pathlib import Path

import pytest

from strict_files.files import FileError
from surveillance_operator.recording.reading import files_of
from surveillance_operator.recording.runs import find_recordings, find_run


def test_a_bag_and_its_file_are_found_by_name(bag: Path, tmp_path: Path) -> None:
    (file,) = bag.glob('*.mcap')
    for name in (bag, file):
        found = find_recordings(str(name), tmp_path)['']
        assert (found.is_whole, found.messages) == (False, name)
    with pytest.raises(FileError, match='expected'):
        find_recordings(str(tmp_path / 'nothing.mcap'), tmp_path)['']


@pytest.mark.parametrize('name', ['empty', 'notes.txt', 'recording_0.db3', 'gone.mcap'])
def test_what_holds_no_recording_is_named_and_what_is_expected(name: str, tmp_path: Path) -> None:
    (tmp_path / 'empty').mkdir()
    (tmp_path / 'notes.txt').touch()
    (tmp_path / 'recording_0.db3').touch()
    with pytest.raises(FileError, match=rf'{name}: expected a file \*\.mcap, or a folder'):
        files_of(tmp_path / name)
    (tmp_path / 'recording_0.mcap').touch()
    (tmp_path / 'recording_1.mcap').touch()
    assert [each.name for each in files_of(tmp_path)] == ['recording_0.mcap', 'recording_1.mcap']


def test_a_run_is_found_by_what_it_holds_and_not_by_a_wrong_name(
    run: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    assert find_run(str(run / 'events.jsonl'), run.parent) == run
    monkeypatch.chdir(run)  # the folder of a run itself
    with pytest.raises(FileError, match='nowhere'):
        find_run('nowhere', run.parent)
    (other := run.with_name('20260102-000000')).mkdir()
    (other / 'events.jsonl').touch()
    with pytest.raises(FileError, match=f'e.g. {run.name}, or last'):
        find_run('20260101-00000', run.parent)
