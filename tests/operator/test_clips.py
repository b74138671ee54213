"""A film of an event, from a recording of camera and map; what leaves the machine is blurred."""

from __future__ import annotations

import io
import shutil
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from surveillance_operator.desk import clips
from surveillance_operator.desk.clips import clip_of
from tests.operator.foreign_bag import START
from tests.operator.test_timeline import record


def frames(film: bytes) -> list[np.ndarray]:
    image = Image.open(io.BytesIO(film))
    assert image.format == 'WEBP'
    found = []
    for number in range(image.n_frames):  # type: ignore[attr-defined]
        image.seek(number)
        found.append(np.asarray(image.convert('RGB'), np.int16))
    return found


def test_a_film_shows_what_the_camera_saw_and_where_the_robot_was(
    bag: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    shutil.copytree(bag, tmp_path / 'recording')
    found = frames(clip_of(tmp_path, '', START + 10, None, blur=False))
    red = [bool((each[:, :, 0] - each[:, :, 1] > 150).sum() > 20) for each in found]
    assert any(red)
    blurred = []

    def blur(picture: np.ndarray, _find: object) -> np.ndarray:
        blurred.append(picture.shape)
        return np.zeros_like(picture)

    monkeypatch.setattr('indoor_watch.privacy.blurred', blur)
    monkeypatch.setattr('indoor_watch.privacy.installed_finder', lambda: None)
    clips._made.cache_clear()
    found = frames(clip_of(tmp_path, '', START + 10, None, blur=True))
    assert blurred
    assert not any((each[:200, :400, 0] - each[:200, :400, 1] > 150).any() for each in found)


def test_a_run_without_a_camera_shows_the_map(tmp_path: Path) -> None:
    record(tmp_path / 'timeline.jsonl', 60)
    found = frames(clip_of(tmp_path, '', 1030.0, (3.0, 0.0), blur=True))
    assert len(found) > 5


def test_what_was_not_recorded_says_so(tmp_path: Path) -> None:
    with pytest.raises(ValueError, match='nothing is recorded'):
        clip_of(tmp_path, '', 1030.0, None, blur=False)
    record(tmp_path / 'timeline.jsonl', 60)
    with pytest.raises(ValueError, match='nothing is recorded'):
        clip_of(tmp_path, '', 5000.0, None, blur=False)
