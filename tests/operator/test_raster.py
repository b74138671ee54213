"""The map of a place in characters."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from floor_plans import Grid
from surveillance_operator.watch import raster
from surveillance_operator.watch.raster import CharacterCanvas, Viewport, rasterise


@settings(max_examples=60)
@given(st.integers(1, 90), st.integers(1, 50), st.integers(1, 90), st.integers(1, 50), st.data())
def test_every_wall_is_in_the_picture_where_its_points_are(height, width, columns, rows, data):
    at = data.draw(st.integers(0, height - 1)), data.draw(st.integers(0, width - 1))
    cells = np.zeros((height, width), np.int8)
    cells[at] = 100
    grid = Grid(cells, 0.1, (-3.0, 5.0))
    frame = Viewport.around(grid.known, columns, rows)
    assert 1 <= frame.columns <= columns
    assert 1 <= frame.rows <= rows
    picture = rasterise(grid, frame)
    assert picture.shape == (2 * frame.rows, frame.columns)
    assert (picture == raster.WALL).any()
    # Of the pixels that a cell is in, the last one is its own: look at its lower right corner.
    corner = -3.0 + 0.1 * (at[1] + 1) - 1e-5, 5.0 + 0.1 * at[0] + 1e-5
    assert picture[tuple(frame.pixels([corner])[0])] == raster.WALL


def test_a_picture_keeps_the_aspect_and_leaves_out_what_is_not_known():
    cells = np.full((200, 200), -1, np.int8)
    cells[50:70, 100:180] = 0
    grid = Grid(cells, 0.5)
    assert grid.known == (50.0, 25.0, 90.0, 35.0)
    frame = Viewport.around(grid.known, 40, 40)
    assert (frame.columns, frame.rows, frame.scale) == (40, 5, 1.0)
    assert (rasterise(grid, frame) == raster.FREE).all()


@pytest.mark.parametrize(
    ('box', 'size', 'expected'),
    [
        ((0.0, 0.0, 10.0, 10.0), (20, 10), (0.5, 20, 10)),
        ((0.0, 0.0, 10.0, 4.0), (20, 10), (0.5, 20, 4)),
        ((0.0, 0.0, 10.0, 4.5), (20, 10), (0.5, 20, 5)),
        ((-3.0, 2.0, 1.0, 12.0), (20, 10), (0.5, 8, 10)),
        ((5.0, 5.0, 5.0, 5.0), (20, 10), (1e-6, 1, 1)),
    ],
)
def test_a_frame_is_the_largest_that_fits(
    box: tuple[float, float, float, float], size: tuple[int, int], expected: tuple[float, int, int]
) -> None:
    frame = Viewport.around(box, *size)
    assert (frame.left, frame.top) == (box[0], box[3])
    assert (frame.scale, frame.columns, frame.rows) == pytest.approx(expected)


def test_a_canvas_draws_dots_lines_marks_and_arrows_where_they_are() -> None:
    frame = Viewport(0.0, 4.0, 0.5, 8, 4)
    canvas = CharacterCanvas(frame)
    canvas.dots([(0.1, 3.9), (3.9, 0.1), (-0.1, 2.0), (4.1, 2.0), (2.0, 4.1)], raster.OBSTACLE)
    canvas.line((0.25, 1.25), (3.75, 1.25), raster.LINK)
    canvas.line((1.25, 3.75), (1.25, 2.25), raster.TRAIL)
    plain = [''.join(each.text for each in line) for line in canvas.lines(colours=False)]
    assert plain == ['* ·     ', '  ·     ', '........', '       *']
    for number, arrow in enumerate('→↗↑↖←↙↓↘'):
        canvas.arrow((2.1, 2.9, number * math.pi / 4 + 0.3), raster.Style())
        assert ''.join(each.text for each in [*canvas.lines(colours=False)][1])[4] == arrow
    labelled = CharacterCanvas(Viewport(0.0, 4.0, 0.5, 8, 4))
    for _ in range(6):
        labelled.label(2.1, 2.1, 'name', raster.Style())
    rows = [''.join(each.text for each in line) for line in labelled.lines(colours=False)]
    assert rows == ['   name ', '   name ', '   name ', '   name ']
    narrow = CharacterCanvas(Viewport(0.0, 4.0, 0.5, 3, 4))
    narrow.label(0.1, 2.1, 'name', raster.Style())
    assert not any(''.join(each.text for each in line).strip() for line in narrow.lines())


def test_a_grid_is_drawn_as_its_own_cells_where_they_are_as_large() -> None:
    rng = np.random.default_rng(3)
    cells = rng.choice(np.array([-1, 0, 100], np.int8), (12, 9))
    grid = Grid(cells, 0.5, (1.0, 2.0))
    picture = raster.rasterise(grid, Viewport(1.0, 8.0, 0.5, 9, 6))
    kinds = np.where(cells == 100, raster.WALL, np.where(cells == 0, raster.FREE, raster.UNKNOWN))
    assert (picture == kinds[::-1]).all()
    halved = raster.rasterise(grid, Viewport(1.0, 8.0, 1.0, 5, 3))
    for row in range(6):
        for column in range(5):
            block = kinds[::-1][2 * row : 2 * row + 2, 2 * column : 2 * column + 2]
            assert halved[row, column] == block.max()
    beyond = raster.rasterise(grid, Viewport(1.0, 8.0, 0.5, 11, 7))
    assert (beyond[:12, :9] == picture).all()
    assert (beyond[12:] == raster.UNKNOWN).all()
    assert (beyond[:, 9:] == raster.UNKNOWN).all()
