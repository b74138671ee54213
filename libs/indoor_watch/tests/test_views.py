"""Views that change or do not, under other lights, on photographs that nobody here took."""

from __future__ import annotations

from pathlib import Path

import cv2
import numpy as np
import pytest
import skimage

from indoor_watch.views import Sight, light_of, sight_of, view_changes

pytestmark = pytest.mark.early

PHOTOS = sorted((Path(__file__).resolve().parents[4] / 'shared' / 'photos').glob('*.jpg'))[:12]
needs_photos = pytest.mark.skipif(not PHOTOS, reason='the shared photographs are not there')


def grey(path: Path) -> np.ndarray:
    picture = cv2.imread(str(path), cv2.IMREAD_GRAYSCALE)
    assert picture is not None
    return cv2.resize(picture, (640, round(640 * picture.shape[0] / picture.shape[1])))


def lights(picture: np.ndarray, seed: int = 0) -> list[np.ndarray]:
    """Return a picture under six lights, a little shaken and noisy."""
    generator = np.random.default_rng(seed)
    rows, columns = picture.shape
    slope = np.linspace(0.6, 1.2, columns)[None, :]
    lamp = np.exp(-(((np.arange(columns) - 0.3 * columns) / columns) ** 2) * 3)[None, :]
    kinds = [
        picture * 0.5,
        picture * 0.8 + 40,
        255 * (picture / 255.0) ** 1.6,
        255 * (picture / 255.0) ** 0.7,
        picture * slope,
        picture * lamp,
    ]
    made = []
    for kind in kinds:
        angle, shift = generator.normal(0, 0.6), generator.normal(0, 3, 2)
        matrix = cv2.getRotationMatrix2D((columns / 2, rows / 2), angle, 1.0)
        matrix[:, 2] += shift
        shaken = cv2.warpAffine(kind, matrix, (columns, rows), borderMode=cv2.BORDER_REFLECT)
        noisy = shaken + generator.normal(0, 3, shaken.shape)
        made.append(np.clip(noisy, 0, 255).astype(np.uint8))
    return made


@needs_photos
def test_another_light_is_no_change():
    false = told = 0
    for path in PHOTOS:
        reference = grey(path)
        for picture in lights(reference):
            found = view_changes(reference, picture)
            told += found is not None
            false += bool(found)
            assert not [each for each in found or () if not each.may_be_light]
    assert told >= 0.8 * 6 * len(PHOTOS)
    assert false <= 0.03 * told


@needs_photos
def test_a_dim_picture_is_compared_and_a_dark_one_is_not():
    """At a fifth of the light, with the camera's noise: the thing is seen, and nothing else."""
    face = cv2.imread(str(Path(skimage.__file__).parent / 'data' / 'astronaut.png'), 0)
    thing = cv2.resize(np.asarray(face, np.uint8), (120, 120))
    seen = 0
    for number, path in enumerate(PHOTOS[1:7]):
        reference = grey(path)
        changed = reference.copy()
        changed[150:270, 250:370] = thing
        generator = np.random.default_rng(number)

        def dim(picture: np.ndarray, light: float, noise: np.random.Generator) -> np.ndarray:
            taken = picture * light + noise.normal(0, 2, picture.shape)
            return np.clip(taken, 0, 255).astype(np.uint8)

        found = view_changes(reference, dim(reference, 0.2, generator))
        assert not [each for each in found or () if not each.may_be_light], path.name
        changes = view_changes(reference, dim(changed, 0.2, generator))
        seen += any(not each.may_be_light for each in changes or ())
        # Too dim is "not seen", which is not "nothing changed".
        assert view_changes(reference, dim(changed, 0.1, generator)) is None
    assert seen >= 4, 'as many as in full light'


@needs_photos
def test_a_thing_of_one_percent_is_found_under_every_light():
    thing = grey(PHOTOS[0])
    found = tried = 0
    for number, path in enumerate(PHOTOS[1::2]):
        reference = grey(path)
        rows, columns = reference.shape
        side = int(0.13 * np.sqrt(rows * columns))
        generator = np.random.default_rng(number)
        top, left = (
            int(generator.integers(80, rows - 80 - side)),
            int(generator.integers(80, columns - 80 - side)),
        )
        changed = reference.copy()
        changed[top : top + side, left : left + side] = thing[100 : 100 + side, 200 : 200 + side]
        for picture in lights(changed, number):
            changes = view_changes(reference, picture)
            if changes is None:
                continue
            tried += 1
            found += any(
                box[0] < left + side
                and left < box[0] + box[2]
                and box[1] < top + side
                and top < box[1] + box[3]
                for box in (change.box for change in changes)
            )
    assert tried >= 28
    assert found >= 0.75 * tried


@needs_photos
def test_another_view_is_not_compared():
    for one, other in zip(PHOTOS, PHOTOS[3:], strict=False):
        if one.name[:12] != other.name[:12]:
            assert view_changes(grey(one), grey(other)) is None


@needs_photos
def test_darkness_and_a_covered_lens_are_told():
    generator = np.random.default_rng(1)
    for path in PHOTOS:
        picture = grey(path)
        assert sight_of(picture) == Sight.CLEAR
        dark = np.clip(picture * 0.03 + generator.normal(4, 3, picture.shape), 0, 255).astype(
            np.uint8
        )
        assert sight_of(dark) == Sight.DARK
        cloth = cv2.GaussianBlur(picture, (0, 0), 60) * 0.3 + 60
        assert sight_of(np.clip(cloth, 0, 255).astype(np.uint8)) == Sight.BLOCKED


@pytest.mark.parametrize(('grey_level', 'noise'), [(20.0, 2.0), (22.5, 2.0), (27, 4.0), (60, 8.0)])
def test_a_noisy_camera_that_is_covered_sees_nothing_in_each_picture(grey_level, noise):
    generator = np.random.default_rng(2)
    for _ in range(10):
        picture = generator.normal(grey_level, noise, (480, 640))
        assert sight_of(np.clip(picture, 0, 255).astype(np.uint8)) == Sight.BLOCKED


@pytest.mark.parametrize('light', [1.0, 0.3, 0.15])
def test_a_plain_wall_above_a_plain_floor_is_a_view_in_any_light(light):
    generator = np.random.default_rng(3)
    wall = np.full((480, 640), 150.0)
    wall[300:] = 120.0
    for _ in range(10):
        picture = cv2.GaussianBlur(wall, (0, 0), 1.0) * light + generator.normal(0, 2, wall.shape)
        assert sight_of(np.clip(picture, 0, 255).astype(np.uint8)) == Sight.CLEAR


def coloured(path: Path) -> np.ndarray:
    picture = cv2.imread(str(path), cv2.IMREAD_COLOR)
    assert picture is not None
    return cv2.resize(picture, (480, round(480 * picture.shape[0] / picture.shape[1])))


def under_a_shadow(picture: np.ndarray, slope: float, softness: float) -> np.ndarray:
    """Return a picture with a shadow over one side of it, and noise."""
    rows, columns = np.indices(picture.shape[:2])
    away = (columns - 0.5 * picture.shape[1]) + slope * (rows - 0.5 * picture.shape[0])
    shade = 1.0 - 0.6 / (1.0 + np.exp(-np.clip(away / softness, -50, 50)))
    noise = np.random.default_rng(2).normal(0, 2, picture.shape)
    return np.clip(picture * shade[..., None] + noise, 0, 255).astype(np.uint8)


@needs_photos
def test_the_edge_of_a_shadow_is_no_thing_and_a_thing_of_another_colour_is_one():
    seen = 0
    for path in PHOTOS[:4]:
        reference = coloured(path)
        changed = reference.copy()
        cv2.rectangle(changed, (200, 140), (250, 190), (40, 60, 200), -1)
        for slope, softness in ((0.4, 1.0), (-0.7, 12.0)):
            shaded = view_changes(reference, under_a_shadow(reference, slope, softness))
            assert not [each for each in shaded or () if not each.may_be_light]
            found = view_changes(reference, under_a_shadow(changed, slope, softness))
            seen += any(not each.may_be_light and each.box[0] > 150 for each in found or ())
    assert seen >= 7


def test_what_stands_near_is_seen_beside_its_old_spot_when_the_camera_moved():
    generator = np.random.default_rng(4)
    far = cv2.resize(generator.integers(60, 200, (60, 80, 3), np.uint8), (480, 360))
    near = cv2.resize(generator.integers(60, 200, (40, 20, 3), np.uint8), (120, 240))
    pictures = []
    for shift in (0, 5):
        picture = far.copy()
        picture[60:300, 180 + shift : 300 + shift] = near
        pictures.append(picture)
    changes = view_changes(*pictures)
    assert changes is not None
    assert not [each for each in changes if not each.may_be_light]


def spoilt(where: tuple[slice | int, ...]) -> np.ndarray:
    """Return the dark with the noise of a sensor of which some pixels are always white."""
    noise = np.random.default_rng(4).normal(4.0, 1.0, (360, 480))
    picture = np.clip(noise, 0, 255).astype(np.uint8)
    picture[where] = 255
    return picture


@pytest.mark.parametrize(
    'where',
    [
        (slice(None, None, 60), slice(None)),
        (slice(None), slice(None, None, 60)),
        (slice(None, None, 8), slice(None, None, 8)),
    ],
    ids=['rows', 'columns', 'pixels'],
)
def test_a_sensor_s_bad_rows_columns_and_pixels_are_no_light(where):
    picture = spoilt(where)
    assert (picture == 255).mean() > 0.01
    assert sight_of(picture) == Sight.DARK


@pytest.mark.parametrize(('side', 'sight'), [(60, Sight.CLEAR), (20, Sight.DARK)])
def test_a_lit_window_in_the_dark_is_seen_when_it_is_large_enough(side, sight):
    """Of 60 pixels a side it has a fiftieth of the picture, of 20 a four-hundredth."""
    picture = spoilt((slice(100, 100 + side), slice(200, 200 + side)))
    assert picture.mean() < 18.0
    assert sight_of(picture) == sight


@pytest.mark.parametrize(
    ('grey_level', 'sight'), [(17, Sight.DARK), (19, Sight.BLOCKED)], ids=['dark', 'covered']
)
def test_a_plain_picture_is_dark_or_covered_by_its_brightness(grey_level, sight):
    assert sight_of(np.full((360, 480), grey_level, np.uint8)) == sight


def test_a_colour_picture_of_any_size_is_judged_by_its_grey():
    picture = np.zeros((720, 960, 3), np.uint8)
    picture[..., 1] = 20
    assert sight_of(picture) == Sight.DARK, 'green of 20 is a grey of 12'
    picture[:, 480:] = 200
    assert sight_of(picture) == Sight.CLEAR


@pytest.mark.parametrize(
    ('dark', 'light'), [(0, 'on'), (238, 'on'), (242, ''), (332, ''), (338, 'off'), (480, 'off')]
)
def test_the_light_is_on_where_less_than_half_is_dark_and_off_where_most_is(dark, light):
    picture = np.full((360, 480), 120, np.uint8)
    picture[:, :dark] = 18
    assert light_of(picture, Sight.CLEAR) == light


def test_a_dark_view_has_no_light_and_a_covered_one_says_nothing():
    picture = np.full((360, 480), 120, np.uint8)
    assert light_of(picture, Sight.DARK) == 'off'
    assert light_of(picture, Sight.BLOCKED) == ''
