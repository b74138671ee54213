"""The demo shows what it says."""

from __future__ import annotations

from pathlib import Path

import cv2

from indoor_watch import EventState
from indoor_watch.demo import main, run


def test_the_demo_tells_of_the_box_and_the_door_and_of_nothing_else() -> None:
    demo = run(say=None)
    found = sorted((each.kind, each.seen, each.state) for each in demo.book.events)
    assert found == [('door', 'closed', EventState.OVER), ('object', 'appeared', EventState.OVER)]
    assert demo.lines[0].startswith('first round')


def test_the_demo_draws_a_picture(tmp_path: Path, capsys) -> None:
    assert main(['--picture', str(tmp_path / 'sweep.png')]) == 0
    assert 'object has appeared in hall' in capsys.readouterr().out
    assert cv2.imread(str(tmp_path / 'sweep.png')).std() > 10
