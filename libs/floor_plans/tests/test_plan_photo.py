"""A photographed floor plan becomes a map: straight, to scale, with its walls and nothing else."""

from __future__ import annotations

from pathlib import Path

import cv2
import numpy as np
import pytest

from floor_plans import read_place
from floor_plans.imports import ImportRequest, PlanPhoto, import_place
from floor_plans.imports.plan_photo import SIDE, read_photo, walls_of_photo
from strict_files.files import FileError

CORNERS = ((100.0, 100.0), (1100.0, 100.0), (1100.0, 700.0), (100.0, 700.0))
"""Of the building on the straight plan, pixels; it is 10 m x 6 m."""


def plan(thickness: int, filled: bool = True) -> np.ndarray:
    """Return a plan of two rooms with a door, text, a table, arcs, an arrow and a window."""
    image = np.full((800, 1200, 3), 255, np.uint8)

    def wall(x1: int, y1: int, x2: int, y2: int) -> None:
        half = thickness // 2
        start, end = (x1 - half, y1 - half), (x2 + half, y2 + half)
        cv2.rectangle(image, start, end, (20, 20, 20), -1 if filled else 2)

    for line in (
        *((100, 100, 400, 100), (560, 100, 1100, 100), (100, 700, 1100, 700)),
        *((100, 100, 100, 700), (1100, 100, 1100, 700)),
        *((600, 100, 600, 360), (600, 450, 600, 700)),
    ):
        wall(*line)
    for y in (96, 104):  # a window
        cv2.line(image, (400, y), (560, y), (20, 20, 20), 2)
    cv2.ellipse(image, (600, 450), (90, 90), 0, 180, 270, (20, 20, 20), 2)
    cv2.putText(image, 'Office 12 m2', (180, 300), cv2.FONT_HERSHEY_SIMPLEX, 1.2, (0, 0, 0), 2)
    cv2.rectangle(image, (250, 450), (330, 500), (20, 20, 20), 2)  # a table of 0.9 m
    cv2.arrowedLine(image, (800, 500), (1000, 500), (0, 140, 0), 18)  # a way out
    cv2.circle(image, (800, 250), 30, (0, 0, 210), -1)
    return image


def photographed(image: np.ndarray) -> tuple[np.ndarray, PlanPhoto]:
    """Return a photo of a plan: askew, darker on one side, noisy; and what a person clicks."""
    to = np.array([(260, 180), (1320, 120), (1400, 900), (180, 830)], np.float32)
    turn = cv2.getPerspectiveTransform(np.array(CORNERS, np.float32), to)
    photo = cv2.warpPerspective(image, turn, (1600, 1100), borderValue=(235, 240, 240)).astype(
        float
    )
    photo *= np.linspace(0.95, 0.55, 1600)[None, :, None]
    photo += np.random.default_rng(3).normal(0.0, 4.0, photo.shape)
    clicked = tuple((float(x), float(y)) for x, y in to)
    return np.clip(photo, 0, 255).astype(np.uint8), PlanPhoto(
        clicked, (clicked[0], clicked[1]), 10.0
    )


@pytest.mark.parametrize('style', ['thick', 'thin', 'outlined'])
def test_two_rooms_are_found_in_a_photo_of_their_plan(style: str, tmp_path: Path) -> None:
    drawn = plan({'thick': 24, 'thin': 3, 'outlined': 24}[style], filled=style != 'outlined')
    photo, shown = photographed(drawn)
    cv2.imwrite(str(tmp_path / 'plan.jpg'), photo)
    report = import_place(
        ImportRequest(tmp_path / 'plan.jpg', tmp_path / 'place.yaml', photo=shown)
    )
    found = read_place(tmp_path / 'place.yaml')
    assert len(found.place.rooms) == 2, report
    (door,) = found.plan.doors.values()
    assert 0.6 < door.width < 1.2
    areas = [each['area'] for each in report.content['rooms']]
    assert areas == pytest.approx([29.0, 29.0], abs=3.5)
    assert report.content['outside']


def test_signs_and_words_are_no_walls() -> None:
    walls = walls_of_photo(plan(24), PlanPhoto((), ((100, 100), (1100, 100)), 10.0)) > 0
    to = 0.01 / SIDE
    for x, y in ((290, 290), (290, 475), (900, 500), (800, 250)):
        box = np.s_[round((y - 40) * to) : round((y + 40) * to)]
        assert not walls[box, round((x - 60) * to) : round((x + 60) * to)].any(), (x, y)
    assert walls[round(100 * to), round(480 * to)], 'a window closes the wall'
    assert not walls[round(405 * to), round(600 * to)], 'an arc closes no door'


def test_what_cannot_be_is_said_in_a_line(tmp_path: Path) -> None:
    image = plan(24)
    for words, said in (
        (('1,2 3,4', '0,0 9,9 5'), 'corners: 2 points, expected four'),
        (('', '0,0 9,9'), 'expected `x,y x,y x,y x,y`'),
        (('', '0,0 9,9 nan'), 'expected `x,y x,y x,y x,y`'),
        (('', '0,0 9,9 -3'), 'scale: -3 m, expected 0.1 to 1000'),
    ):
        with pytest.raises(ValueError, match=said.replace('`', '.')):
            PlanPhoto.from_words(*words)
    for shown, said in (
        (PlanPhoto((), ((0, 0), (5000, 0)), 5.0), r'\(5000, 0\): expected a point of the picture'),
        (PlanPhoto((), ((5, 5), (6, 5)), 5.0), 'its two points are one'),
        (PlanPhoto((), ((0, 0), (20, 0)), 900.0), 'the plan would be'),
        (PlanPhoto((), ((0, 0), (1200, 0)), 0.2), 'the plan would be'),
        (PlanPhoto(((0, 0), (9, 9), (0, 9), (9, 0)), ((0, 0), (900, 0)), 9.0), 'four corners'),
    ):
        with pytest.raises(ValueError, match=said):
            walls_of_photo(image, shown)
    (tmp_path / 'plan.jpg').write_bytes(b'<html>')
    with pytest.raises(FileError, match=r'plan.jpg: cannot be read as a picture'):
        read_photo(tmp_path / 'plan.jpg')
    shown = PlanPhoto((), ((0, 0), (900, 0)), 9.0)
    with pytest.raises(ValueError, match='expected the picture of a plan'):
        import_place(ImportRequest(tmp_path / 'map.yaml', tmp_path / 'p.yaml', photo=shown))
