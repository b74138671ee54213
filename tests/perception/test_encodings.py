"""Raw pixels of real cameras' encodings, held against OpenCV's own conversions."""

from __future__ import annotations

import cv2
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from marker_detection import MarkerDetector, dictionary_named
from surveillance_perception.stream.encodings import ENCODING_NAMES, image_of_pixels, printable
from surveillance_perception.stream.image_files import ImageError, decode_image

GREY = np.arange(10, 250, 10, dtype=np.uint8).reshape(4, 6)
COLOUR = np.stack([GREY, GREY[::-1], GREY[:, ::-1]], axis=2)
LIMIT = 10**6


def read(encoding, values, height=4, width=6, **options):
    rows = np.ascontiguousarray(values)
    step = options.pop('step', rows.nbytes // rows.shape[0])
    return image_of_pixels(
        encoding, width, height, step, rows.tobytes(), max_pixels=LIMIT, **options
    )


@pytest.mark.parametrize(
    ('encoding', 'values', 'expected'),
    [
        ('mono8', GREY, GREY),
        ('8UC1', GREY, GREY),
        ('8UC3', COLOUR, COLOUR),
        ('rgb8', COLOUR[..., ::-1], COLOUR),
        ('bgr8', COLOUR, COLOUR),
        ('rgba8', np.dstack([COLOUR[..., ::-1], GREY]), COLOUR),
        ('bgra8', np.dstack([COLOUR, GREY]), COLOUR),
        ('8UC4', np.dstack([COLOUR, GREY]), COLOUR),
        ('rgb16', COLOUR[..., ::-1].astype(np.uint16), COLOUR),
        ('bgr16', COLOUR.astype(np.uint16), COLOUR),
        ('16UC3', COLOUR.astype(np.uint16), COLOUR),
        ('rgba16', np.dstack([COLOUR[..., ::-1], GREY]).astype(np.uint16), COLOUR),
        ('bgra16', np.dstack([COLOUR, GREY]).astype(np.uint16), COLOUR),
        ('16UC4', np.dstack([COLOUR, GREY]).astype(np.uint16), COLOUR),
    ],
)
def test_values_arrive_unchanged(encoding, values, expected):
    assert (read(encoding, values) == expected).all()


@pytest.mark.parametrize('encoding', ['mono16', '16UC1'])
@pytest.mark.parametrize('bits', [10, 12, 16])
@pytest.mark.parametrize('big_endian', [False, True])
def test_sixteen_bits_fill_the_eight(encoding, bits, big_endian):
    values = GREY.astype(np.uint16) << (bits - 8)
    stored = values.astype('>u2' if big_endian else '<u2')
    found = read(encoding, stored, big_endian=big_endian).astype(float)
    assert found.max() == 255
    assert np.allclose(found / 255, GREY / GREY.max(), atol=0.005)


def marker_in_ten_bits(defective):
    """Return a faint marker of ten bits, and some pixels of the sensor that are always white."""
    generator = np.random.default_rng(defective)
    sheet = np.full((240, 320), 200, np.uint16)
    sheet[60:160, 80:180] = 120 + dictionary_named('DICT_5X5_100').generateImageMarker(12, 100) // 4
    sheet[generator.integers(0, 240, defective), generator.integers(0, 320, defective)] = 65535
    return sheet


@pytest.mark.parametrize('defective', [0, 40])
def test_marker_of_ten_bits_is_read_however_it_is_sent(defective):
    values = marker_in_ten_bits(defective)
    packed = cv2.imencode('.png', values)[1].tobytes()
    coloured = np.dstack([values] * 3 + [np.full_like(values, 65535)])
    for image in (
        read('mono16', values, 240, 320),
        read('rgba16', coloured, 240, 320),
        decode_image(packed, 'image'),
    ):
        assert [each.marker_id for each in MarkerDetector().detect(image)] == [12]


@pytest.mark.parametrize('encoding', ENCODING_NAMES)
def test_odd_sizes_are_read(encoding):
    data = bytes(13 * 9 * 32)
    image = image_of_pixels(encoding, 13, 9, 13 * 8 + 1, data, max_pixels=LIMIT)
    assert image.shape[:2] == (9, 13)


@pytest.mark.parametrize(
    ('encoding', 'brightness'),
    [('yuv422', 1), ('uyvy', 1), ('yuv422_yuy2', 0), ('yuyv', 0)],
)
def test_interleaved_yuv_gives_its_brightness(encoding, brightness):
    values = np.full((4, 6, 2), 128, np.uint8)
    values[..., brightness] = GREY
    assert (read(encoding, values.reshape(4, 12)) == GREY).all()


@pytest.mark.parametrize('encoding', ['nv12', 'nv21'])
def test_planar_yuv_gives_its_brightness(encoding):
    values = np.concatenate([GREY, np.full((2, 6), 77, np.uint8)])
    assert (read(encoding, values, step=6) == GREY).all()
    with pytest.raises(ImageError, match='has 24 bytes, expected 36'):
        read(encoding, GREY)


def test_colour_as_fine_as_brightness_behind_it_is_left_out():
    values = np.concatenate([GREY, np.full((8, 6), 77, np.uint8)])
    assert (read('nv24', values, step=6) == GREY).all()
    with pytest.raises(ImageError, match='has 24 bytes, expected 72'):
        read('nv24', GREY)


@pytest.mark.parametrize(
    ('pattern', 'red', 'blue'),
    [
        ('rggb', (0, 0), (1, 1)),
        ('bggr', (1, 1), (0, 0)),
        ('gbrg', (1, 0), (0, 1)),
        ('grbg', (0, 1), (1, 0)),
    ],
)
def test_bayer_weighs_the_colours_as_grey_does(pattern, red, blue):
    # a red scene: only the red cells are lit
    mosaic = np.zeros((16, 16), np.uint8)
    mosaic[red[0] :: 2, red[1] :: 2] = 200
    seen = read(f'bayer_{pattern}8', mosaic, 16, 16)[4:-4, 4:-4]
    expected = cv2.cvtColor(np.full((1, 1, 3), (0, 0, 200), np.uint8), cv2.COLOR_BGR2GRAY)[0, 0]
    assert abs(float(seen.mean()) - float(expected)) < 3
    mosaic = np.zeros((16, 16), np.uint8)
    mosaic[blue[0] :: 2, blue[1] :: 2] = 200
    assert read(f'bayer_{pattern}8', mosaic, 16, 16)[4:-4, 4:-4].mean() < 30


@pytest.mark.parametrize(
    ('width', 'height', 'text'),
    [
        (0, 4, 'image of 0x4 pixels is empty'),
        (6, 0, 'image of 6x0 pixels is empty'),
        (1001, 1000, 'image of 1001x1000 pixels is larger than 1000000 pixels'),
    ],
)
def test_sizes_that_no_image_has_are_refused(width, height, text):
    with pytest.raises(ImageError) as error:
        read('mono8', GREY, height, width)
    assert str(error.value) == text


def test_the_largest_image_is_read():
    assert image_of_pixels('mono8', 6, 4, 6, GREY.tobytes(), max_pixels=24).shape == (4, 6)
    with pytest.raises(ImageError, match='is larger than 23 pixels'):
        image_of_pixels('mono8', 6, 4, 6, GREY.tobytes(), max_pixels=23)


@pytest.mark.parametrize(
    ('encoding', 'least'),
    [
        *(('mono8', 6), ('8UC1', 6), ('rgb8', 18), ('8UC4', 24), ('mono16', 12), ('16UC1', 12)),
        *(('bgra16', 48), ('uyvy', 12), ('nv12', 6), ('bayer_rggb8', 6), ('bayer_rggb16', 12)),
    ],
)
def test_a_row_has_all_its_bytes(encoding, least):
    assert image_of_pixels(encoding, 6, 4, least, bytes(1000), max_pixels=LIMIT).shape[:2] == (4, 6)
    with pytest.raises(ImageError) as error:
        image_of_pixels(encoding, 6, 4, least - 1, bytes(1000), max_pixels=LIMIT)
    assert str(error.value) == (
        f'image has rows of {least - 1} bytes, expected at least {least} for 6 pixels of {encoding}'
    )


def test_a_byte_too_few_is_told():
    with pytest.raises(ImageError) as error:
        image_of_pixels('mono8', 6, 4, 8, bytes(29), max_pixels=LIMIT)
    assert str(error.value) == 'image of 6x4 pixels has 29 bytes, expected 30'


@pytest.mark.parametrize('wide', [False, True])
def test_bayer_of_sixteen_bits_is_that_of_eight(wide):
    mosaic = np.tile(np.array([[250, 90], [120, 40]], np.uint8), (8, 8))
    expected = cv2.cvtColor(mosaic, cv2.COLOR_BayerRGGB2GRAY)
    values = mosaic.astype(np.uint16) * 257 if wide else mosaic
    found = read(f'bayer_rggb{16 if wide else 8}', values, 16, 16)
    scale = expected.max() / 255 if wide else 1.0
    assert np.allclose(found * scale, expected, atol=1.0)


@pytest.mark.parametrize(('length', 'shown'), [(40, 'x' * 40), (41, 'x' * 40 + '...')])
def test_long_names_are_shortened(length, shown):
    assert printable('x' * length) == repr(shown)


def test_last_row_may_lack_its_padding():
    data = np.pad(GREY, ((0, 0), (0, 2))).tobytes()[:-2]
    assert (image_of_pixels('mono8', 6, 4, 8, data, max_pixels=LIMIT) == GREY).all()


def test_one_row_with_a_huge_step_takes_no_memory():
    data = GREY[0].tobytes()
    assert (image_of_pixels('mono8', 6, 1, 2**32 - 1, data, max_pixels=LIMIT) == GREY[:1]).all()


def test_unknown_encoding_is_quoted_in_one_line():
    with pytest.raises(ImageError) as error:
        read('mono8\n[ERROR] [armor]: forged\x1b[2J' + 'x' * 1000, GREY)
    assert str(error.value).isprintable()
    assert len(str(error.value)) < 600
    assert 'expected one of mono8' in str(error.value)
    assert printable('plain') == "'plain'"


@settings(max_examples=300)
@given(
    st.one_of(st.sampled_from(ENCODING_NAMES), st.text(max_size=12)),
    st.integers(0, 40),
    st.integers(0, 40),
    st.integers(0, 2**32 - 1) | st.integers(0, 200),
    st.binary(max_size=4000),
    st.booleans(),
)
def test_any_pixels_are_an_image_or_refused(encoding, width, height, step, data, big_endian):
    try:
        image = image_of_pixels(
            encoding, width, height, step, data, big_endian=big_endian, max_pixels=1000
        )
    except ImageError:
        return
    assert image.shape[:2] == (height, width)
    assert image.dtype == np.uint8
