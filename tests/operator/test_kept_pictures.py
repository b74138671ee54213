"""A kept picture is given by its name alone, and blurred beyond this machine."""

from __future__ import annotations

from pathlib import Path

import pytest

from surveillance_operator import kept_pictures
from surveillance_operator.kept_pictures import kept_picture

pytestmark = pytest.mark.unit
NAME = '3_1772660000000_door-D6-open.jpg'


def test_a_picture_is_found_by_run_robot_and_name(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    for folder, text in (('run/evidence', b'own'), ('run/bob/evidence', b'of bob')):
        (tmp_path / folder).mkdir(parents=True)
        (tmp_path / folder / NAME).write_bytes(text)
    (tmp_path / NAME).write_bytes(b'secret')
    assert kept_picture(tmp_path, NAME, '', 'run', False) == b'own'
    assert kept_picture(tmp_path, NAME, 'bob', 'run', False) == b'of bob'
    for name, robot, run in (
        (NAME, '', '..'),
        (NAME, '..', 'run'),
        (NAME, 'eve', 'run'),
        (f'../{NAME}', '', 'run'),
        ('events.jsonl', '', 'run'),
        (NAME, '', ''),
    ):
        assert kept_picture(tmp_path, name, robot, run, False) is None
    # No picture at all: what cannot be blurred does not leave.
    kept_pictures._shown.cache_clear()
    assert kept_picture(tmp_path, NAME, '', 'run', True) is None
