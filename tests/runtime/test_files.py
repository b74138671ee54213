"""Files are replaced and lengthened whole, and errors name them."""

from __future__ import annotations

from pathlib import Path

import pytest

from surveillance_runtime.files import LineFile, in_one_line, replace_text


def test_a_file_that_cannot_be_replaced_is_named_and_stays_whole(tmp_path: Path) -> None:
    path = tmp_path / 'state.json'
    replace_text(path, 'old')
    path.with_name('state.json.new').mkdir()
    with pytest.raises(IsADirectoryError) as refused:
        replace_text(path, 'new')
    assert in_one_line(refused.value) == f'{path}: Is a directory'
    assert path.read_text() == 'old'


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
