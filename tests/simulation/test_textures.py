"""What surfaces look like: the same in every run."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest

from surveillance_simulation.world import textures
from surveillance_simulation.world.textures import Texture

DICTIONARY = 'DICT_5X5_100'


def looks(texture: Texture) -> tuple[list[float], list[float], list[float]]:
    """Return mean and deviation of each colour, and the means of the quarters, row by row."""
    assert texture.dtype == np.uint8
    rows, columns = texture.shape[0] // 2, texture.shape[1] // 2
    quarters = [
        texture[top : top + rows, left : left + columns].mean()
        for top in (0, rows)
        for left in (0, columns)
    ]
    return [*texture.mean((0, 1))], [*texture.std((0, 1))], quarters


@pytest.mark.parametrize(
    ('texture', 'size', 'means', 'deviations', 'quarters'),
    [
        (
            textures.plaster,
            (384, 384),
            (203.96, 200.90, 191.70),
            (3.82, 3.76, 3.59),
            (201.28, 199.30, 197.46, 197.37),
        ),
        (
            textures.floor,
            (384, 384),
            (145.30, 138.02, 127.81),
            (10.66, 10.13, 9.39),
            (134.82, 137.03, 137.70, 138.62),
        ),
        (
            textures.leaf,
            (384, 384),
            (146.63, 108.19, 72.77),
            (13.03, 11.27, 9.51),
            (109.66, 108.62, 109.63, 108.87),
        ),
        (
            textures.barrel,
            (96, 32),
            (229.5, 138.0, 80.0),
            (6.06, 58.89, 90.07),
            (149.17, 149.17, 149.17, 149.17),
        ),
        (
            textures.station,
            (192, 192),
            (95.09, 99.47, 59.98),
            (76.24, 67.19, 28.38),
            (86.21, 83.20, 86.64, 83.34),
        ),
        (
            lambda: textures.plain((120, 60, 30)),
            (64, 64),
            (119.54, 59.54, 29.54),
            (3.0, 3.0, 3.0),
            (69.41, 69.48, 69.63, 69.65),
        ),
    ],
)
def test_surfaces_look_as_they_always_did(
    texture: Any, size: tuple[int, int], means: Any, deviations: Any, quarters: Any
) -> None:
    drawn = texture()
    assert drawn.shape == (*size, 3)
    assert texture() is drawn or not hasattr(texture, 'cache_info'), 'drawn once'
    found = looks(drawn)
    for values, expected in zip(found, (means, deviations, quarters), strict=True):
        assert values == pytest.approx(expected, abs=0.02)


def test_what_repeats_has_no_seam_and_the_floor_has_joints_between_its_stones() -> None:
    for surface in (textures.plaster(), textures.floor()[48:-48, 48:-48]):
        steps = np.abs(np.diff(surface.astype(float), axis=0)).mean()
        if len(surface) == len(textures.plaster()):
            seam = np.abs(surface[0].astype(float) - surface[-1]).mean()
            assert seam < 1.5 * steps
    floor = textures.floor().astype(float).mean(axis=2)
    for lines in (floor.mean(axis=1), floor.mean(axis=0)):
        joints = [line for line in range(384) if lines[line] < lines.mean() - 20.0]
        assert joints == [0, 1, 96, 97, 192, 193, 288, 289]
        inside = np.delete(lines, joints)
        assert inside.mean() - lines[joints].mean() == pytest.approx(38 * 0.943, abs=2.0)


def test_a_leaf_has_a_handle_at_its_right_and_two_panels() -> None:
    leaf = textures.leaf().astype(int)
    assert leaf[195, 353].tolist() == [200, 200, 190]
    bright = np.argwhere(leaf[..., 2] == 190)
    assert (bright.min(axis=0).tolist(), bright.max(axis=0).tolist()) == ([186, 344], [204, 362])
    lines = np.argwhere((leaf == (96, 66, 40)).all(axis=2))
    assert lines[:, 1].min() == pytest.approx(0.14 * 384, abs=3)
    assert lines[:, 1].max() == pytest.approx(0.86 * 384, abs=3)
    for top, bottom in ((0.08, 0.45), (0.55, 0.93)):
        rows = lines[(lines[:, 0] > top * 384 - 4) & (lines[:, 0] < bottom * 384 + 4), 0]
        assert (rows.min(), rows.max()) == pytest.approx((top * 384, bottom * 384), abs=3)


@pytest.mark.parametrize('number', [0, 7, 99])
def test_a_panel_has_its_marker_in_ink_within_a_cell_and_a_half_of_paper(number: int) -> None:
    cells = 24
    panel = textures.marker_panel(DICTIONARY, number, 'whole')
    assert panel.shape == (10 * cells, 10 * cells, 3)
    assert set(np.unique(panel)) == {22, 228}
    assert textures.panel_share(DICTIONARY) == pytest.approx(10 / 7)
    grey, margin = panel[..., 0], 36
    rim = grey.copy()
    rim[margin:-margin, margin:-margin] = 228
    assert (rim == 228).all(), 'white all around'
    code = grey[margin:-margin, margin:-margin].reshape(7, cells, 7, cells)
    assert (code == code[:, :1, :, :1]).all(), 'each cell is of one colour'
    bits = code[1:6, 0, 1:6, 0] > 100
    frame = np.delete(
        code[:, 0, :, 0].ravel(), [7 * r + c for r in range(1, 6) for c in range(1, 6)]
    )
    assert (frame == 22).all()
    known = textures.aruco_dictionary(DICTIONARY).bytesList[number]
    expected = type(textures.aruco_dictionary(DICTIONARY)).getBitsFromByteList(known[None], 5)
    assert bits.tolist() == (expected > 0).tolist()
    broken = textures.marker_panel(DICTIONARY, number, 'broken')[..., 0]
    torn = broken == 160
    assert torn[0, :200].all()
    assert torn[:165, 0].all()
    assert not torn[170:].any()
    assert not torn[:, 206:].any()
    assert torn.sum() == pytest.approx(0.7 * 240 * 0.85 * 240 / 2, rel=0.02)
    assert (broken[~torn] == grey[~torn]).all()
    covered = textures.marker_panel(DICTIONARY, number, 'covered')[..., 0]
    assert set(np.unique(covered)) == {150, 176}
    assert (np.diag(covered) == 150).all()
    assert (covered == 150).mean() == pytest.approx(4 * math.sqrt(2) / 240, rel=0.3)
