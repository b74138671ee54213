"""Codes read from the grey levels of cells, and the probability that they are wrong."""

from __future__ import annotations

import cv2
import numpy as np
import pytest

from marker_detection.cell_differences import CellDifferences
from marker_detection.dictionaries import MarkerCodes, dictionary_named

CODES = MarkerCodes.of(dictionary_named('DICT_5X5_100'))
DIFFERENCES = CellDifferences(CODES)
ROW, COLUMN = np.mgrid[:7, :7]


def levels(entry, black=25.0, white=225.0):
    printed = CODES.cells[entry, 1:-1, 1:-1] > 0
    return np.where(printed, white, black).astype(np.float32)


def glare(row, column, cells):
    return 255.0 * np.exp(-((ROW - row) ** 2 + (COLUMN - column) ** 2) / (2.0 * cells**2))


@pytest.mark.parametrize(
    'light',
    [
        lambda cells: cells,
        lambda cells: cells * np.where(COLUMN > 3, 0.2, 1.0),
        lambda cells: cells * (0.2 + 0.1 * ROW),
        lambda cells: cells * 0.5 + 90.0,
        lambda cells: np.minimum(cells + 0.7 * glare(3.0, 2.5, 1.5), 255.0),
    ],
    ids=['even', 'shadow', 'falling', 'haze', 'glare'],
)
def test_codes_are_read_under_any_light_with_little_doubt(light):
    entries = np.arange(0, len(CODES.ids), 7)
    read = DIFFERENCES.read(np.array([light(levels(entry)) for entry in entries], np.float32))
    assert read.entries.tolist() == entries.tolist()
    assert read.error.max() < 1e-4


def test_cells_without_a_code_are_read_with_much_doubt():
    generator = np.random.default_rng(1)
    noise = generator.uniform(0, 255, (500, 7, 7)).astype(np.float32)
    ramp = np.broadcast_to(20.0 * (ROW + COLUMN), (1, 7, 7)).astype(np.float32)
    even = np.full((1, 7, 7), 128.0, np.float32)
    error = DIFFERENCES.read(np.concatenate([noise, ramp, even])).error
    assert (error < 0.01).mean() < 0.02
    assert error.min() > 1e-4
    assert error[-2:].min() > 1.0


def test_print_of_another_code_is_not_taken_for_the_nearest_one():
    cells = np.array([levels(entry) for entry in range(100)])
    cells[:, 3, 3] = 250.0 - cells[:, 3, 3]
    assert np.isinf(DIFFERENCES.read(cells).error).all()


@pytest.mark.parametrize(
    ('dictionary', 'dirty', 'read'),
    [
        ('DICT_APRILTAG_36h11', 3, True),
        ('DICT_6X6_250', 3, True),
        ('DICT_7X7_250', 4, True),
        ('DICT_5X5_100', 1, False),
        ('DICT_4X4_50', 1, False),
        # so many cells lie between prints of DICT_APRILTAG_36h11 and codes of DICT_6X6_1000
        ('DICT_6X6_1000', 4, False),
    ],
)
def test_code_with_wrong_cells_is_read_where_hardly_any_print_is_so_near(dictionary, dirty, read):
    codes = MarkerCodes.of(dictionary_named(dictionary))
    generator = np.random.default_rng(2)
    entries = generator.choice(len(codes.ids), 50)
    white = codes.cells[entries, 1:-1, 1:-1] > 0
    for each in white:
        row, column = np.divmod(generator.choice(codes.bits**2, dirty, replace=False), codes.bits)
        each[1 + row, 1 + column] ^= True
    cells = np.where(white, 225.0, 25.0).astype(np.float32)
    seen = CellDifferences(codes).read(cells)
    if read:
        assert seen.entries.tolist() == entries.tolist()
        assert seen.error.max() < 1e-4
    else:
        assert seen.error.min() > 1e-4


def test_cells_of_blurred_print_are_not_taken_for_another_code():
    codes = MarkerCodes.of(dictionary_named('DICT_APRILTAG_36h11'))
    entries = np.random.default_rng(1).choice(len(codes.ids), 300)
    printed = [np.where(codes.cells[each] > 0, 225.0, 25.0) for each in entries]
    blurred = [cv2.GaussianBlur(each, (0, 0), 0.65)[1:-1, 1:-1] for each in printed]
    seen = CellDifferences(codes).read(np.array(blurred, np.float32))
    assert seen.entries.tolist() == entries.tolist()
    assert np.isfinite(seen.error).all()


def test_doubtful_cells_are_told_as_such_and_not_held_against_other_print():
    # a cell of the other colour, and so much noise that nobody would take it for a marker anyway
    generator = np.random.default_rng(1)
    cells = np.array([levels(entry) for entry in range(100)])
    cells[:, 3, 3] = 250.0 - cells[:, 3, 3]
    cells = np.clip(cells + generator.normal(0.0, 50.0, cells.shape), 0.0, 255.0)
    error = DIFFERENCES.read(cells.astype(np.float32)).error
    assert (error > 1e-3).sum() > 20
    assert np.isfinite(error).all()


def test_cells_of_the_other_colour_are_counted():
    entries = np.array([40])
    cells = levels(40)[None]
    inner, border = DIFFERENCES.wrong(cells, entries)
    assert (inner.item(), border.item()) == (0, 0)
    cells[0, 3, 3] = 250.0 - cells[0, 3, 3]
    cells[0, 0, 2] = 225.0
    inner, border = DIFFERENCES.wrong(cells, entries)
    assert (inner.item(), border.item()) == (1, 1)
