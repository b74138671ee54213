"""Files are read with a bound, and replaced as a whole, with nothing left beside them."""

from __future__ import annotations

import errno
import os
import stat
import time
from pathlib import Path

import pytest

from strict_files import regular_files as files


def test_a_file_is_read_up_to_its_bound(tmp_path):
    path = tmp_path / 'file'
    path.write_bytes(b'abcd')
    assert files.read_file(path, 4) == b'abcd'
    with pytest.raises(OSError, match='4 bytes, at most 3 are read') as caught:
        files.read_file(path, 3)
    assert (caught.value.errno, caught.value.filename) == (errno.EFBIG, str(path))
    # It says that it is empty.
    assert files.read_file('/proc/self/cmdline', 2) == Path('/proc/self/cmdline').read_bytes()[:2]


@pytest.mark.parametrize(
    ('make', 'kind'),
    [
        (lambda path: path.mkdir(), 'a folder'),
        (os.mkfifo, 'a pipe'),
        (lambda path: path.symlink_to('/dev/null'), 'a device'),
    ],
)
def test_what_is_no_file_is_told(tmp_path, make, kind):
    path = tmp_path / 'path'
    make(path)
    for use in (lambda: files.read_file(path, 9), lambda: files.replace_file(path, b'')):
        with pytest.raises(OSError, match=f'expected a file, got {kind}') as caught:
            use()
        assert (caught.value.errno, caught.value.filename) == (errno.EINVAL, str(path))
    with pytest.raises(FileNotFoundError) as missing:
        files.read_file(tmp_path / 'none', 9)
    assert missing.value.filename == str(tmp_path / 'none')


@pytest.mark.parametrize('durable', [False, True])
@pytest.mark.parametrize('mode', [0o600, 0o644, 0o640, None])
def test_a_file_that_is_replaced_keeps_its_rights(tmp_path, durable, mode):
    path = tmp_path / 'file'
    if mode is not None:
        path.write_bytes(b'old')
        path.chmod(mode)
    files.replace_file(path, b'new', durable=durable)
    assert path.read_bytes() == b'new'
    usual = tmp_path / 'usual'
    usual.write_bytes(b'')
    expected = stat.S_IMODE(usual.stat().st_mode) if mode is None else mode
    assert stat.S_IMODE(path.stat().st_mode) == expected
    assert sorted(each.name for each in tmp_path.iterdir()) == ['file', 'usual']


def test_a_file_without_the_right_to_write_is_not_replaced(tmp_path, monkeypatch):
    path = tmp_path / 'file'
    path.write_bytes(b'old')
    monkeypatch.setattr(os, 'access', lambda *_, **__: False)
    with pytest.raises(PermissionError) as caught:
        files.replace_file(path, b'new')
    assert caught.value.filename == str(path)
    assert path.read_bytes() == b'old'
    files.replace_file(tmp_path / 'other', b'new')


def test_a_file_that_cannot_be_written_leaves_the_old_one_and_no_draft(tmp_path, monkeypatch):
    path = tmp_path / 'file'
    path.write_bytes(b'old')

    def full(*_):
        raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC), 'draft')

    monkeypatch.setattr(os, 'replace', full)
    with pytest.raises(OSError, match='No space left') as caught:
        files.replace_file(path, b'new')
    assert (caught.value.errno, caught.value.filename) == (errno.ENOSPC, str(path))
    assert [each.name for each in tmp_path.iterdir()] == ['file']
    assert path.read_bytes() == b'old'


def test_drafts_of_killed_writers_are_removed_and_nothing_else(tmp_path):
    def draft(name, age):
        path = tmp_path / name
        path.write_bytes(b'')
        os.utime(path, (time.time() - age,) * 2)

    hour = files.ABANDONED
    kept = ['.a.0123456g.draft', '.a.012345678.draft', '.b.01234567.draft', '.a.01234567.txt']
    for name in kept:
        draft(name, 2 * hour)
    draft('.a.01234567.draft', hour + 60.0)
    draft('.a.89abcdef.draft', hour - 60.0)
    (tmp_path / '.a.00000000.draft').symlink_to(tmp_path / kept[0])
    os.utime(tmp_path / '.a.00000000.draft', (0, 0), follow_symlinks=False)
    files.replace_file(tmp_path / 'a', b'new')
    left = {each.name for each in tmp_path.iterdir()}
    assert left == {'a', *kept, '.a.89abcdef.draft', '.a.00000000.draft'}


def test_a_file_with_the_longest_name_is_replaced(tmp_path):
    for name in ('ä' * 127, 'x' * 255):
        files.replace_file(tmp_path / name, b'new')
        assert (tmp_path / name).read_bytes() == b'new'


def test_text_that_is_nested_too_deep_is_damaged():
    assert files.parse_json('[[1]]') == [[1]]
    assert files.parse_json(b'1.0', parse_float=str) == '1.0'
    with pytest.raises(ValueError, match=r'^damaged: nested too deep$'):
        files.parse_json('[' * 100_000 + ']' * 100_000)
