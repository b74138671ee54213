"""Images from files: what is damaged or no regular file is refused in one line."""

from __future__ import annotations

import resource
from pathlib import Path

import cv2
import pytest

from surveillance_perception.stream.image_files import ImageError, decode_image, read_image


def test_png_whose_length_was_damaged_is_refused_before_memory_is_taken(image):
    data = bytearray(cv2.imencode('.png', image)[1].tobytes())
    data[data.index(b'IDAT') - 4] = 0x70
    before = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    with pytest.raises(ImageError, match='no whole PNG'):
        decode_image(bytes(data), 'image')
    assert resource.getrusage(resource.RUSAGE_SELF).ru_maxrss - before < 100_000


@pytest.mark.parametrize('path', ['/dev/zero', '/dev'])
def test_what_is_no_regular_file_is_not_read(path):
    with pytest.raises(ImageError, match='expected a file, got a'):
        read_image(Path(path))


@pytest.mark.parametrize('data', [b'', b'\x89PNG\r\n\x1a\n', b'\xff\xd8\xff\xe0junk', b'BM'])
def test_corrupted_images_are_refused_in_one_line(data):
    with pytest.raises(ImageError) as error:
        decode_image(data, 'image')
    assert '\n' not in str(error.value)
