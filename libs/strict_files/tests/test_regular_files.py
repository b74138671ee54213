"""A file is replaced whole, with its rights, where its links lead, and drafts do not add up."""

from __future__ import annotations

import os
import tempfile
from pathlib import Path

import pytest

from strict_files.files import (
    replace_text,
)


def test_drafts_of_killed_writers_do_not_add_up(tmp_path: Path) -> None:
    old, new, other, backup, folder, link = (
        tmp_path / name
        for name in (
            '.[a].0123abcd.draft',
            '.[a].4567cdef.draft',
            '.[b].0123abcd.draft',
            '.[a].20260101',
            '.[a].aaaaaaaa.draft',
            '.[a].ffffffff.draft',
        )
    )
    folder.mkdir()
    link.symlink_to(other)
    for path in (old, new, other, backup):
        path.touch()
    for path in (old, other, backup, folder):
        os.utime(path, (0, 0))
    replace_text(tmp_path / '[a]', 'new')
    assert {*tmp_path.iterdir()} == {tmp_path / '[a]', new, other, backup, folder, link}


@pytest.mark.parametrize('name', ['a' * 255, 'ä' * 127])
def test_a_file_of_the_longest_name_is_replaced(tmp_path: Path, name: str) -> None:
    path = tmp_path / name
    path.touch()
    replace_text(path, 'new')
    assert path.read_text() == 'new'
    assert [*tmp_path.iterdir()] == [path]


def test_a_file_keeps_its_rights(tmp_path: Path) -> None:
    (path := tmp_path / 'file').write_text('old')
    path.chmod(0o600)
    replace_text(path, 'new')
    assert (path.read_text(), path.stat().st_mode & 0o777) == ('new', 0o600)


def test_a_read_only_file_is_not_replaced() -> None:
    user = os.geteuid()
    with tempfile.TemporaryDirectory() as folder:
        Path(folder).chmod(0o777)
        (path := Path(folder) / 'file').write_text('old')
        path.chmod(0o444)
        os.seteuid(user or 65534)  # root may write everything
        try:
            with pytest.raises(PermissionError) as error:
                replace_text(path, 'new')
        finally:
            os.seteuid(user)
        assert error.value.filename == str(path)
        assert path.read_text() == 'old'


def test_a_link_stays_and_what_it_leads_to_is_replaced(tmp_path: Path) -> None:
    (tmp_path / 'disk').mkdir()
    path, link = tmp_path / 'disk' / 'state.json', tmp_path / 'link.json'
    link.symlink_to(path)
    for text in ('made', 'replaced'):
        replace_text(link, text)
        assert link.is_symlink()
        assert path.read_text() == text
    assert sorted(os.listdir(tmp_path / 'disk')) == ['state.json']
