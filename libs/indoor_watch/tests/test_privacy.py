"""Pictures that leave the machine show nobody who can be recognised."""

from __future__ import annotations

from pathlib import Path

import cv2
import numpy as np
import pytest
from skimage import data

from indoor_watch import EvidenceStore
from indoor_watch.evidence import DAY, shows_nobody
from indoor_watch.privacy import PictureError, blurred, shareable


def detail(picture: np.ndarray) -> float:
    """Return how much fine structure a picture has."""
    return float(cv2.Laplacian(cv2.cvtColor(picture, cv2.COLOR_BGR2GRAY), cv2.CV_64F).std())


def astronaut() -> np.ndarray:
    """Return a photograph with a face; its middle is near row 113, column 220."""
    return np.asarray(cv2.cvtColor(data.astronaut(), cv2.COLOR_RGB2BGR), np.uint8)


def test_a_face_in_a_photograph_is_blurred_and_the_rest_stays() -> None:
    picture = astronaut()
    shown = blurred(picture, lambda _: [])
    face = np.s_[75:150, 180:260]
    assert detail(shown[face]) < 0.15 * detail(picture[face])
    assert (shown[:40] == picture[:40]).all()


def test_whoever_was_found_is_blurred() -> None:
    picture = np.asarray(cv2.cvtColor(data.coffee(), cv2.COLOR_RGB2BGR), np.uint8)
    shown = blurred(picture, lambda _: [(300, 100, 80, 200)])
    assert detail(shown[110:290, 310:370]) < 0.3 * detail(picture[110:290, 310:370])


def test_where_nobody_can_look_for_persons_the_whole_picture_is_coarse() -> None:
    picture = astronaut()
    shown = blurred(picture, None)
    assert detail(shown) < 0.15 * detail(picture)
    assert shown.mean() == pytest.approx(picture.mean(), abs=3.0)


def test_what_shows_nobody_is_sent_as_it_is_and_no_picture_is_refused(tmp_path: Path) -> None:
    store = EvidenceStore(tmp_path)
    camera = store.keep(astronaut(), 'person-R1-seen', 3, 1000.0)
    sweep = store.keep(astronaut(), 'sweep-door-D1-ajar', 3, 1000.0)
    done = store.keep(astronaut(), 'blurred-person-R1-seen', 3, 1000.0)
    assert [shows_nobody(each) for each in (camera, sweep, done)] == [False, True, True]

    def sent(name: str, *, blur: bool = True) -> np.ndarray:
        jpeg = np.frombuffer(shareable(tmp_path / name, blur=blur, find=lambda _: []), np.uint8)
        return np.asarray(cv2.imdecode(jpeg, cv2.IMREAD_COLOR))

    face = np.s_[75:150, 180:260]
    assert detail(sent(sweep)[face]) > 3 * detail(sent(camera)[face])
    assert detail(sent(done)[face]) > 3 * detail(sent(camera)[face]), 'it is not blurred twice'
    assert detail(sent(camera, blur=False)[face]) > 3 * detail(sent(camera)[face])
    (tmp_path / 'x.jpg').write_bytes(b'nothing')
    for name in ('x.jpg', 'gone.jpg'):
        with pytest.raises(PictureError, match=name):
            shareable(tmp_path / name)


def test_pictures_are_deleted_after_their_time(tmp_path: Path) -> None:
    store = EvidenceStore(tmp_path, most_days=2.0)
    old = store.keep(np.zeros((8, 8), np.uint8), 'a', 3, 1000.0)
    new = store.keep(np.zeros((8, 8), np.uint8), 'b', 1, 1000.0 + 1.5 * DAY)
    store.forget_old(1000.0 + 2.5 * DAY)
    assert [each.name for each in tmp_path.iterdir()] == [new]
    assert old


def test_two_things_that_are_noticed_at_once_have_a_picture_each(tmp_path):
    store = EvidenceStore(tmp_path)
    names = [
        store.keep(np.full((8, 8), shade, np.uint8), 'sweep-object-C1-appeared', 3, 64.0)
        for shade in (0, 128, 255)
    ]
    assert len(set(names)) == 3
    assert all(shows_nobody(name) for name in names)
    shades = [float(np.mean(np.asarray(cv2.imread(str(tmp_path / name))))) for name in names]
    assert np.allclose(shades, [0, 128, 255], atol=4)
