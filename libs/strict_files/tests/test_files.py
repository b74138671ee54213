"""Files are replaced and lengthened whole, and errors name them."""

from __future__ import annotations

import os
import resource
from pathlib import Path

import pytest

from strict_files.files import (
    FileError,
    KeptFile,
    LineFile,
    in_one_line,
    read_file,
    read_json,
    replace_text,
)


@pytest.mark.parametrize('kind', ['a pipe', 'a folder', 'a device'])
def test_what_is_no_file_is_neither_read_nor_replaced(tmp_path: Path, kind: str) -> None:
    """The link keeps a real device out of reach of a failing test."""
    path = tmp_path / 'path'
    {
        'a pipe': lambda: os.mkfifo(path),
        'a folder': path.mkdir,
        'a device': lambda: path.symlink_to('/dev/full'),
    }[kind]()
    with pytest.raises(FileError, match=f'^{path}: expected a file, got {kind}$'):
        read_file(path, 100)
    for write in (lambda: replace_text(path, 'new'), lambda: LineFile(path)):
        with pytest.raises(OSError, match=f'expected a file, got {kind}'):
            write()
    assert not path.is_file()


def test_a_file_is_read_up_to_a_bound(tmp_path: Path) -> None:
    path = tmp_path / 'path'
    path.write_bytes(b'12345')
    assert read_file(path, 5) == b'12345'
    assert read_file(Path('/proc/self/stat'), 10) != b''
    with pytest.raises(FileError, match='5 bytes, at most 4 are read'):
        read_file(path, 4)
    with pytest.raises(FileError, match='none: No such file'):
        read_file(tmp_path / 'none', 4)


@pytest.mark.parametrize(
    ('given', 'expected'),
    [
        ('config/ofice.yaml', ", expected 'config/office.yaml'"),
        ('confg/office.yaml', ", expected 'config/office.yaml'"),
        ('confg/new.yaml', ", expected 'config'"),
        ('config/Office.yml', ", expected 'config/office.yaml'"),
        # The ending alone is no likeness.
        ('config/nothere.yaml', ''),
        ('config/nothing-like-it', ''),
        ('config/zebra', ''),
    ],
)
def test_a_file_that_is_not_there_is_told_with_the_one_most_like_it(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, given: str, expected: str
) -> None:
    monkeypatch.chdir(tmp_path)
    Path('config').mkdir()
    for name in ('office', 'notify'):
        Path(f'config/{name}.yaml').touch()
    Path('config/nothing-like-it').symlink_to('nowhere')
    with pytest.raises(FileError) as refused:
        read_file(Path(given), 100)
    assert str(refused.value) == f'{given}: No such file or directory{expected}'


def test_a_file_that_cannot_be_replaced_is_named_and_stays_whole(tmp_path: Path) -> None:
    path = tmp_path / 'state.json'
    replace_text(path, 'old')
    before = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (1_000_000, before[1]))
    try:
        with pytest.raises(OSError, match='too large') as refused:
            replace_text(path, 'x' * 1_000_001)
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, before)
    assert in_one_line(refused.value) == f'{path}: File too large'
    assert path.read_text() == 'old'
    assert os.listdir(tmp_path) == ['state.json'], 'a draft is left'


def test_lines_go_to_where_a_link_points_behind_the_last_whole_one(tmp_path: Path) -> None:
    path, link = tmp_path / 'lines', tmp_path / 'link'
    link.symlink_to(path)
    for content in (None, b'one\nhalf'):
        if content is not None:
            path.write_bytes(content)
        file = LineFile(link)
        assert file.append(b'two\n') == path.stat().st_size
        file.close()
    assert link.is_symlink()
    assert path.read_bytes() == b'one\ntwo\n'
    with pytest.raises(OSError, match=f"{link}'"):
        file.append(b'three\n')


def test_an_error_that_names_no_file_is_said_all_the_same() -> None:
    assert in_one_line(OSError('the port is taken')) == 'the port is taken'


@pytest.mark.parametrize('text', ['', 'null', 'NaN', '1e999', '1' + '0' * 400, '[' * 100_000])
def test_a_json_file_that_holds_nothing_of_use_is_one_line(tmp_path: Path, text: str) -> None:
    path = tmp_path / 'state.json'
    assert read_json(path, 1_000_000) is None
    path.write_text(text)
    with pytest.raises(FileError, match=r'state\.json: '):
        read_json(path, 1_000_000)
    with pytest.raises(FileError, match='too long'):
        read_json(tmp_path / ('n' * 300), 1_000_000)


@pytest.mark.parametrize(
    ('content', 'words'),
    [
        ('[' * 200_000, 'nested too deep'),
        ('{"level": Infinity}', 'expected a finite number'),
        ('[]', 'does not fit'),
        ('{"other": 1}', "expected 'level' in it"),
    ],
)
def test_a_kept_file_that_is_damaged_is_one_line(tmp_path: Path, content: str, words: str) -> None:
    path = tmp_path / 'kept.json'
    path.write_text(content)
    taken: list[int] = []
    said = KeptFile(str(path), 'starting without it').read(lambda kept: taken.append(kept['level']))
    assert said.startswith(f'{path}: ')
    assert words in said
    assert said.endswith('; starting without it')
    assert '\n' not in said
    assert taken == []


def test_a_kept_file_that_cannot_be_read_is_kept_aside_at_a_write(
    tmp_path: Path,
) -> None:
    path = tmp_path / 'kept.json'
    (tmp_path / 'link.json').symlink_to(path)
    for content in ('one', 'two', 'three'):
        path.write_text(content)
        kept = KeptFile(str(tmp_path / 'link.json'), 'starting without it')
        assert kept.read(lambda found: None)
        assert path.read_text() == content, 'nothing is moved that is not replaced'
        assert [kept.write({'level': level}) for level in (7, 8)] == ['', '']
    assert {each.name: each.read_text().strip() for each in tmp_path.iterdir()} == {
        'kept.json': '{"level": 8}',
        'link.json': '{"level": 8}',
        'kept.json.unread': 'one',
        'kept.json.unread2': 'two',
        'kept.json.unread3': 'three',
    }
    assert (tmp_path / 'link.json').is_symlink()
    kept = KeptFile(str(path))
    assert kept.read(lambda found: None) == ''
    assert kept.write({'level': 9}) == ''
    assert len(list(tmp_path.iterdir())) == 5, 'one that was read is replaced'


def test_a_kept_file_is_written_however_many_were_kept_aside(tmp_path: Path) -> None:
    path = tmp_path / 'kept.json'
    path.write_text('damaged')
    for ending in ('', *range(2, 1001)):
        (tmp_path / f'kept.json.unread{ending}').touch()
    kept = KeptFile(str(path))
    assert kept.read(lambda found: None)
    assert kept.write({'level': 7}) == ''
    assert path.read_text() == '{"level": 7}\n'
    assert (tmp_path / 'kept.json.unread1001').read_text() == 'damaged'


def test_what_is_kept_is_found_and_a_file_that_cannot_be_written_is_told(tmp_path: Path) -> None:
    taken: list[int] = []
    assert KeptFile.of_record(str(tmp_path / 'new' / 'm.jsonl'), '.level').write({'level': 7}) == ''
    for kept in (KeptFile(str(tmp_path / 'new' / 'm.jsonl.level')), KeptFile()):
        assert kept.read(lambda found: taken.append(found['level'])) == ''
    assert taken == [7]
    there = tmp_path / 'absent' / 'kept.json'
    assert KeptFile(str(there)).write({'level': 7}).startswith(f'{there}: No such file')
    assert KeptFile().write({'level': 7}) == ''
