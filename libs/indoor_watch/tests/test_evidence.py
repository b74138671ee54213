"""Pictures of what was seen: their names, what is deleted, and what they show."""

from __future__ import annotations

import os
from pathlib import Path

import cv2
import numpy as np
import pytest

from floor_plans import Grid
from indoor_watch import EvidenceStore
from indoor_watch.evidence import DAY, oldest, shows_nobody, side_by_side, sweep_picture

PLAIN = np.full((40, 60), 90, np.uint8)
NOW = 1_700_000_000.25


def names(folder: Path) -> list[str]:
    return sorted(each.name for each in folder.iterdir())


def test_pictures_of_one_moment_are_numbered(tmp_path: Path):
    store = EvidenceStore(tmp_path / 'new' / 'folder')
    kept = [store.keep(PLAIN, 'door D1/open', 2, NOW) for _ in range(4)]
    stem = '2_1700000000250_door-D1-open'
    assert kept == [f'{stem}.jpg', f'{stem}-2.jpg', f'{stem}-3.jpg', f'{stem}-4.jpg']
    assert names(tmp_path / 'new' / 'folder') == sorted(kept)


@pytest.mark.parametrize(
    ('what', 'severity', 'stamp', 'name'),
    [
        ('box', 0, 0.0, '0_0000000000000_box.jpg'),
        ('box', 12, 0.0014, '9_0000000000001_box.jpg'),
        ('box', -3, -5.0, '0_0000000000000_box.jpg'),
        ('ä' * 50, 9, 1.5, f'9_0000000001500_{"-" * 40}.jpg'),
    ],
)
def test_a_name_says_severity_time_and_what(
    tmp_path: Path, what: str, severity: int, stamp: float, name: str
):
    assert EvidenceStore(tmp_path).keep(PLAIN, what, severity, stamp) == name


@pytest.mark.parametrize(
    ('name', 'told'),
    [
        ('2_1700000000250_sweep-box.jpg', True),
        ('2_1700000000250_blurred-box.jpg', True),
        ('2_1700000000250_box-sweep-.jpg', False),
        ('2_1700000000250_sweep.jpg', False),
        ('sweep-box.jpg', False),
    ],
)
def test_a_sweep_is_told_by_its_name(name: str, told: bool):
    assert shows_nobody(name) is told


def test_the_least_severe_goes_first_and_of_those_the_oldest(tmp_path: Path):
    size = len(cv2.imencode('.jpg', PLAIN, [cv2.IMWRITE_JPEG_QUALITY, 85])[1])
    store = EvidenceStore(tmp_path, most_bytes=3 * size)
    kept = [
        store.keep(PLAIN, 'b', 5, 10.0),
        store.keep(PLAIN, 'b', 3, 12.0),
        store.keep(PLAIN, 'b', 3, 11.0),
    ]
    assert names(tmp_path) == sorted(kept), 'they just fit'
    assert store.total == 3 * size
    newer = store.keep(PLAIN, 'b', 4, 13.0)
    assert names(tmp_path) == sorted([kept[0], kept[1], newer])
    assert store.keep(PLAIN, 'b', 1, 14.0) == '', 'it went itself'
    assert names(tmp_path) == sorted([kept[0], kept[1], newer])
    assert store.total == 3 * size


def test_what_is_older_than_its_days_is_deleted(tmp_path: Path):
    store = EvidenceStore(tmp_path, most_days=2.0)
    at = [store.keep(PLAIN, 'b', 9, NOW + 60.0 * minute) for minute in (0, 1, 2)]
    (tmp_path / 'notes.txt').write_text('mine')
    EvidenceStore(tmp_path, most_days=2.0).forget_old(NOW + 60.0 + 2.0 * DAY)
    assert names(tmp_path) == sorted([*at[1:], 'notes.txt'])
    store.keep(PLAIN, 'b', 0, NOW + 61.0 + 2.0 * DAY)
    assert at[1] not in names(tmp_path)
    assert oldest(NOW, 2.0) == 1_699_827_200_250


def test_a_full_disk_costs_the_picture_alone(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    store = EvidenceStore(tmp_path)

    def full(*_: object) -> None:
        raise OSError(28, 'No space left on device')

    monkeypatch.setattr(os, 'fdopen', full)
    assert store.keep(PLAIN, 'b', 1, NOW) == ''
    assert names(tmp_path) == []
    assert store.total == 0


def test_two_pictures_stand_beside_each_other_with_their_names():
    before = np.full((100, 200, 3), (200, 10, 10), np.uint8)
    now = np.full((200, 300), 120, np.uint8)
    picture = side_by_side(before, now)
    assert picture.shape == (200, 400 + 4 + 300, 3)
    assert picture[150, 200].tolist() == [200, 10, 10]
    assert (picture[:, 400:404] == 255).all()
    assert picture[150, 600].tolist() == [120, 120, 120]
    for left, plain in ((0, (200, 10, 10)), (404, (120, 120, 120))):
        corner = picture[:40, left : left + 120].reshape(-1, 3)
        assert {(0, 0, 0), (255, 255, 255), plain} <= set(map(tuple, corner.tolist()))
    assert (before == (200, 10, 10)).all()
    assert side_by_side(np.zeros((1000, 1), np.uint8), now).shape == (200, 1 + 4 + 300, 3)


def test_a_sweep_is_drawn_on_the_map_with_north_up():
    cells = np.zeros((200, 200), np.int8)
    cells[120, :] = 100  # a wall at y = 1 to 1.05
    cells[80, :] = 64  # no wall yet
    cells[:, 60] = -1
    grid = Grid(cells, 0.05, (-5.0, -5.0))
    ends = np.array([[1.0, 0.5], [-0.5, -2.0], [3.5, 0.0], [0.0, -3.01]])
    picture = sweep_picture(grid, (0.0, 0.0), (1.0, -1.0), ends)
    assert picture.shape == (360, 360, 3)

    def at(x: float, y: float) -> list[int]:
        return picture[int((3.0 - y) * 60), int((x + 3.0) * 60)].tolist()

    assert at(2.0, 1.025) == [0, 0, 0]
    assert at(2.0, 0.97) == at(2.0, 1.08) == [255, 255, 255]
    assert at(2.0, -0.975) == [255, 255, 255]
    assert at(-1.975, 0.5) == [200, 200, 200]
    assert at(1.0, 0.5) == at(-0.5, -2.0) == [0, 0, 220]
    assert at(1.0 + 8 / 60, -1.0) == [220, 90, 0]
    assert at(0.0, 24 / 60) == at(-24 / 60, 0.0) == [0, 150, 0]
    red = (picture == (0, 0, 220)).all(axis=2)
    assert cv2.connectedComponents(red.astype(np.uint8))[0] == 3, 'two of the four are in it'
    far = sweep_picture(grid, (4.0, 0.0), (0.9, 0.0), ends[:0])
    assert not (far == (220, 90, 0)).all(axis=2).any()
    assert far[100, -30].tolist() == [200, 200, 200], 'off the map nothing is known'
