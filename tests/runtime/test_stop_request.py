"""A person's stop as it is kept: in words, by robot, and whatever has become of its file."""

from __future__ import annotations

import json
import os
from pathlib import Path

import pytest

from surveillance_runtime.stop_request import (
    LONGEST_TEXT,
    StopFile,
    StopRequest,
    own_file,
    own_stop,
)

pytestmark = pytest.mark.unit

WISH = StopRequest('the guard', 'a child', 1_767_222_000.0)


@pytest.fixture
def file(tmp_path: Path) -> StopFile:
    return StopFile(tmp_path / 'state' / 'stop.json')


def test_a_wish_is_kept_until_it_is_forgotten(file: StopFile) -> None:
    assert file.read() is None
    assert file.keep(WISH) == ''
    assert file.read() == WISH
    assert file.forget() == ''
    assert file.read() is None
    assert file.forget() == ''


def test_words_say_who_when_and_why() -> None:
    assert WISH.words().startswith('stopped by the guard at ')
    assert WISH.words().endswith(' (a child)')
    assert StopRequest('', '', 0.0).words().startswith('stopped at ')


@pytest.mark.parametrize('text', ['a\nb', '\x1b[2Ja', 'x' * 1_000_000, '\ud800', '\u202eabc'])
def test_a_stranger_s_words_are_one_short_line_and_can_be_kept(file: StopFile, text: str) -> None:
    wish = StopRequest.heard(text, text)
    assert wish.owner == wish.reason
    assert wish.owner.isprintable()
    assert len(wish.owner) <= LONGEST_TEXT
    assert file.keep(wish) == ''
    assert file.read() == wish


@pytest.mark.parametrize('value', [0x00, 0x0A, 0x22, 0x2D, 0x39, 0x65, 0x7D, 0xFF])
def test_a_damaged_byte_stops_the_robot_and_is_told_in_one_line(file: StopFile, value: int) -> None:
    assert file.path is not None
    file.keep(WISH)
    whole = file.path.read_bytes()
    for place in range(len(whole)):
        file.path.write_bytes(whole[:place] + bytes([value]) + whole[place + 1 :])
        found = file.read()
        assert found is not None
        assert '\n' not in found.words()


@pytest.mark.parametrize('since', ['1e300', '-1e300', '1e12', 'NaN', '9' * 400, '[]', 'null'])
def test_a_time_that_is_none_stops_the_robot(file: StopFile, since: str) -> None:
    assert file.path is not None
    file.keep(WISH)
    file.path.write_text(f'{{"owner": "a", "reason": "b", "since": {since}}}')
    found = file.read()
    assert found is not None
    assert 'cannot be read' in found.words()


def test_a_file_that_is_cut_off_or_empty_or_too_large_stops_the_robot(file: StopFile) -> None:
    assert file.path is not None
    file.keep(WISH)
    whole = file.path.read_bytes()
    for content in (*(whole[:size] for size in range(len(whole) - 2)), b' ' * 20_000):
        file.path.write_bytes(content)
        found = file.read()
        assert found is not None
        assert 'cannot be read' in found.words()


def test_what_cannot_be_kept_or_forgotten_says_why(tmp_path: Path) -> None:
    (tmp_path / 'file').write_text('')
    below = StopFile(tmp_path / 'file' / 'stop.json')
    assert str(tmp_path / 'file') in below.keep(WISH)
    assert below.read() is None
    folder = StopFile(tmp_path)
    assert 'expected a file' in folder.keep(WISH)
    assert folder.forget()
    assert folder.read() is not None


def test_without_a_file_nothing_is_kept() -> None:
    nowhere = StopFile(None)
    assert nowhere.keep(WISH)
    assert nowhere.read() is None
    assert nowhere.forget() == ''


def test_each_robot_of_each_domain_has_a_file_of_its_own(tmp_path: Path) -> None:
    state = {'XDG_STATE_HOME': str(tmp_path)}
    robots = ['/', '/a', '/a/b', '/a_b', '/a/b_c', '/a_b/c', '/a_b_c']
    files = {own_file(domain, robot, state) for domain in (0, 1, 11) for robot in robots}
    assert len(files) == 3 * len(robots)
    assert {each.parent for each in files} == {tmp_path / 'surveillance'}
    assert own_file(3, '/a/', state) == own_file(3, 'a', state)


def test_the_state_folder_is_the_user_s(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv('HOME', str(tmp_path))
    for environ in ({}, {'XDG_STATE_HOME': ''}):
        assert own_file(0, '/', environ).parent == tmp_path / '.local/state/surveillance'


def test_what_is_kept_is_readable_by_other_software(file: StopFile) -> None:
    file.keep(WISH)
    assert file.path is not None
    assert os.listdir(file.path.parent) == ['stop.json']
    assert json.loads(file.path.read_text()) == {
        'owner': 'the guard',
        'reason': 'a child',
        'since': 1_767_222_000.0,
    }


def test_a_full_disk_leaves_the_stop_in_memory_until_the_machine_is_off(tmp_path: Path) -> None:
    (tmp_path / 'full').write_text('')
    spare = tmp_path / 'memory' / 'stop.json'
    file = StopFile(tmp_path / 'full' / 'stop.json', spare)
    assert file.keep(WISH).startswith('not once the machine was off: ')
    assert StopFile(tmp_path / 'full' / 'stop.json', spare).read() == WISH
    (tmp_path / 'full').unlink()
    assert file.keep(WISH) == ''
    assert not spare.exists()
    assert file.read() == WISH
    spare.write_text('{}')
    assert file.forget() == ''
    assert file.read() is None


def test_a_disk_that_hangs_is_asked_last(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    written = []
    monkeypatch.setattr(
        'surveillance_runtime.stop_request.replace_file',
        lambda path, _words, *, durable: written.append((path.name, durable)),
    )
    StopFile(tmp_path / 'a', tmp_path / 'b').keep(WISH)
    assert written == [('b', False), ('a', True)]


def test_memory_is_the_user_s(tmp_path: Path) -> None:
    state = {'XDG_STATE_HOME': str(tmp_path / 'state'), 'XDG_RUNTIME_DIR': str(tmp_path)}
    kept = own_stop(3, '/a', state)
    assert kept.path == own_file(3, '/a', state)
    assert kept.spare == tmp_path / 'surveillance' / 'stop_3_a.json'
    elsewhere = own_stop(3, '/a', {**state, 'XDG_RUNTIME_DIR': str(tmp_path / 'none')})
    assert elsewhere.spare is not None


def test_memory_that_others_may_write_into_keeps_no_stop(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    # Who may write there may remove the stop, or set one that nobody can release.
    monkeypatch.setattr('tempfile.tempdir', str(tmp_path))
    environ = {'XDG_STATE_HOME': str(tmp_path / 'state'), 'XDG_RUNTIME_DIR': str(tmp_path / 'no')}
    folder = tmp_path / f'surveillance_{os.getuid()}'
    assert own_stop(3, '/a', environ).spare is not None
    assert folder.stat().st_mode & 0o777 == 0o700
    folder.chmod(0o777)
    assert own_stop(3, '/a', environ).spare is None
    folder.rmdir()
    (tmp_path / 'theirs').mkdir(mode=0o700)
    folder.symlink_to(tmp_path / 'theirs')
    assert own_stop(3, '/a', environ).spare is None
