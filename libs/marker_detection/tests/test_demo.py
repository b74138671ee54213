"""The demo reads all of its hard markers and draws them."""

from __future__ import annotations

from pathlib import Path

import cv2
import pytest

from marker_detection import demo

README = Path(__file__).parent.parent / 'README.md'


def test_it_reads_all_markers_and_draws_them(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    path = tmp_path / 'seen.png'
    assert demo.main([str(path)]) == 0
    said = capsys.readouterr().out
    assert all(name in said for name in demo.MARKERS)
    assert 'not read' not in said
    assert 'read and not there: none' in said
    drawn = cv2.imread(str(path))
    assert drawn is not None
    assert drawn.shape == (480, 640, 3)


def test_a_folder_that_is_not_there_is_said(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert demo.main([str(tmp_path / 'none' / 'seen.png')]) == 1
    assert 'cannot be written' in capsys.readouterr().err


def test_the_readme_tells_of_it() -> None:
    assert 'python -m marker_detection.demo' in README.read_text(encoding='utf-8')
