"""Folders and video files played as a camera."""

from __future__ import annotations

import cv2
import numpy as np
import pytest

from surveillance_perception.stream.image_files import ImageError
from surveillance_perception.stream.video import open_source


def test_folder_is_played_in_order_of_names(tmp_path, image):
    for index, level in enumerate((10, 20, 30)):
        cv2.imwrite(str(tmp_path / f'{index}.png'), np.full((8, 8), level, np.uint8))
    (tmp_path / 'notes.txt').write_text('no image')
    (tmp_path / '1b.png').write_bytes(b'broken')
    frames = list(open_source(str(tmp_path)).frames)
    assert [int(each[0, 0, 0]) for each in frames if not isinstance(each, ImageError)] == [
        10,
        20,
        30,
    ]
    assert '1b.png' in str(frames[2])


def test_video_file_is_played_at_its_own_rate(tmp_path):
    path = tmp_path / 'video.avi'
    writer = cv2.VideoWriter(str(path), cv2.VideoWriter_fourcc(*'MJPG'), 12.5, (64, 48))  # type: ignore[attr-defined]
    for level in (0, 100, 200):
        writer.write(np.full((48, 64, 3), level, np.uint8))
    writer.release()
    source = open_source(str(path))
    assert source.rate == pytest.approx(12.5)
    assert [round(float(np.mean(each)), -1) for each in source.frames] == [0, 100, 200]  # type: ignore[arg-type]
    source.frames.close()


def test_source_that_is_not_there_is_named(tmp_path):
    with pytest.raises(ImageError, match='no such video file or folder'):
        open_source(str(tmp_path / 'none.avi'))
    with pytest.raises(ImageError, match='holds no images'):
        open_source(str(tmp_path))
