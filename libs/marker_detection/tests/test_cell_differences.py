"""Codes read from the grey levels of cells, and the probability that they are wrong."""

from __future__ import annotations

import math

import cv2
import numpy as np
import pytest
from scipy.special import stdtr

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


# Beside the formulas of the module's docstring, cell by cell in double precision.


def neighbours(side):
    """Return pairs of neighbouring cells: first those beside, then those below each other."""
    places = np.arange(side**2).reshape(side, side)
    beside = np.stack([places[:, :-1].ravel(), places[:, 1:].ravel()])
    return np.concatenate([beside, np.stack([places[:-1].ravel(), places[1:].ravel()])], axis=1)


def between(values, pairs):
    return values.ravel()[pairs[1]] - values.ravel()[pairs[0]]


def agreement(seen, room, white, pairs):
    expected = room * between(white, pairs)
    size = np.linalg.norm(seen) * np.linalg.norm(expected)
    return float(seen @ expected / np.maximum(size, 1e-9))


def unexplained(correlation):
    return 1.0 - max(correlation, 0.0) ** 2 + 1e-6


def flipped_where(white, cells):
    result = white.copy()
    for cell in cells:
        result[cell] = 1.0 - result[cell]
    return result


def improving(seen, room, white, pairs):
    """Return the cells that agree better with the other colour, and how well each does."""
    before = agreement(seen, room, white, pairs)
    each = {
        cell: agreement(seen, room, flipped_where(white, [cell]), pairs)
        for cell in np.ndindex(white.shape)
    }
    return [cell for cell, found in each.items() if found > before], max(each.values())


def differences_seen(values, pairs):
    found = between(values, pairs)
    step = np.maximum(np.sort(np.abs(found))[round(0.85 * (len(found) - 1))], 1e-3)
    return np.clip(found / step, -1.0, 1.0), step


def read_slowly(codes, cells, logarithms):
    """Return the entry, correlation, lead and error of one candidate's cells (side, side)."""
    pairs = neighbours(codes.side)
    whites = (codes.cells[:, 1:-1, 1:-1] > 0).astype(float)
    seen, step = differences_seen(np.log(cells + 12.0) if logarithms else cells, pairs)
    room = np.ones_like(seen)
    if not logarithms:
        lower = cells.ravel()[pairs].min(axis=0)
        room = np.clip((252.0 - lower) / max(step, 20.0), 0.0, 1.0)
    correlations = np.array([agreement(seen, room, white, pairs) for white in whites])
    entry = int(correlations.argmax())
    best, second = (unexplained(each) for each in np.sort(correlations)[:-3:-1])
    flips = np.array([between(cell, pairs) for cell in np.eye(codes.side**2)])
    covariance = flips.T @ flips
    freedom = np.trace(covariance) ** 2 / np.square(covariance).sum() * room.mean()
    # the t of a correlation coefficient
    squared = (freedom - 1.0) * (1.0 - min(best, 1.0)) / best
    by_chance = stdtr(freedom - 1.0, -math.sqrt(squared))
    error = 2.0 * len(whites) * by_chance + (second / best) ** (-freedom / 2.0)
    if error < 1e-3:
        better, highest = improving(seen, room, whites[entry], pairs)
        nearest = agreement(seen, room, flipped_where(whites[entry], better), pairs)
        other = best > 1.4 * unexplained(highest) or best > 4.0 * unexplained(nearest)
        bits = codes.bits**2
        near = sum(math.comb(bits, count) for count in range(min(len(better), bits) + 1))
        share = len(whites) * near / 2.0**bits
        if other and share > 3e-4:
            error = np.inf
    return entry, correlations[entry], second / best, error


def varied(codes, count, seed):
    """Return cells of codes under light, reflections, dirt and noise, and some of no code."""
    generator = np.random.default_rng(seed)
    side = codes.side
    row, column = np.mgrid[:side, :side] / (side - 1.0)
    result = []
    for index in range(count):
        white = codes.cells[generator.integers(len(codes.ids)), 1:-1, 1:-1] > 0
        dirty = generator.choice(side**2, generator.choice([0, 0, 1, 3]), replace=False)
        white = white ^ np.isin(np.arange(side**2), dirty).reshape(white.shape)
        cells = np.where(white, 220.0, 30.0)
        light = (1.0, np.where(column > 0.4, 0.25, 1.0), 0.3 + 0.7 * row)[index % 3]
        bright = generator.choice([0.0, 0.0, 240.0])
        cells = light * cells + bright * np.exp(-8.0 * ((row - 0.5) ** 2 + column**2))
        cells = cells + generator.normal(0.0, generator.choice([1.0, 8.0, 45.0]), cells.shape)
        if index % 11 == 10:
            cells = generator.uniform(0.0, 255.0, cells.shape)
        result.append(np.clip(cells, 0.0, 255.0))
    return np.array(result, np.float32)


@pytest.mark.parametrize(
    ('dictionary', 'border'), [('DICT_4X4_50', 1), ('DICT_5X5_50', 1), ('DICT_APRILTAG_16h5', 2)]
)
def test_cells_are_read_as_the_formulas_say(dictionary, border):
    codes = MarkerCodes.of(dictionary_named(dictionary), range(12), border)
    differences, cells = CellDifferences(codes), varied(codes, 44, 3)
    read = differences.read(cells)
    outcomes = set()
    for index, each in enumerate(cells.astype(float)):
        ways = [read_slowly(codes, each, logarithms) for logarithms in (False, True)]
        entry, correlation, lead, error = ways[int(ways[1][3] < ways[0][3])]
        outcomes.add((bool(ways[1][3] < ways[0][3]), bool(np.isinf(error)), bool(error < 1e-3)))
        assert read.entries[index] == entry
        assert read.correlation[index] == pytest.approx(correlation, abs=1e-4)
        assert read.lead[index] == pytest.approx(lead, rel=1e-2)
        assert read.error[index] == pytest.approx(error, rel=0.1, abs=1e-30)
    # by levels and by logarithms, refused, sure and doubtful
    assert len(outcomes) >= 5
    alone = read.chosen(np.array([4, 2]))
    assert [each.tolist() for each in alone] == [each[[4, 2]].tolist() for each in read]


@pytest.mark.parametrize('border', [1, 2])
def test_cells_of_the_other_colour_are_those_that_agree_better_so(border):
    codes = MarkerCodes.of(dictionary_named('DICT_4X4_50'), range(6), border)
    cells = varied(codes, 24, 5)
    entries = np.random.default_rng(1).integers(0, len(codes.ids), len(cells))
    counts = CellDifferences(codes).wrong(cells, entries)
    pairs = neighbours(codes.side)
    for each, entry, inner, outer in zip(cells.astype(float), entries, *counts, strict=True):
        seen, _ = differences_seen(np.log(each + 12.0), pairs)
        white = (codes.cells[entry, 1:-1, 1:-1] > 0).astype(float)
        better = improving(seen, np.ones_like(seen), white, pairs)[0]
        own = [cell for cell in better if all(border <= at < codes.side - border for at in cell)]
        assert (inner, outer) == (len(own), len(better) - len(own))
