"""The demo shows what it says: a robot finds itself, drives around a box and arrives."""

from __future__ import annotations

from pathlib import Path

import cv2
import pytest

from lidar_navigation import demo


def test_the_robot_finds_itself_and_arrives(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    file = tmp_path / 'map.png'
    assert demo.main(['--picture', str(file)]) == 0
    shown = capsys.readouterr().out
    assert set('#.*oAB') <= set(shown)
    assert 'There after' in shown
    image = cv2.imread(str(file))
    assert image is not None
    assert image.shape[1] > image.shape[0] > 300
    told = demo.journey()
    assert max(told.off) < 0.1
    assert len(told.plans) >= 2, 'the box has it plan again'
