"""The cheapest way over a grid of costs, over the eight neighbours of each cell.

A step costs its length times the mean cost of its two cells, as in scikit-image's
`MCP_Geometric`, which searches small grids. A large grid is searched twice: first over blocks of
cells, with the mean cost of what is free in them, then cell by cell (Dijkstra's algorithm of
scipy) within the blocks beside the way found. Where the blocks promise a way that the cells do not
have, the whole grid is searched.

Dijkstra's algorithm is kept in favour of a faster A* such as pyastar2d's: that one takes a diagonal
step for as long as a straight one, so that its ways are longer and ignore the room beside them.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import cv2
import numpy as np
from numpy.typing import NDArray
from skimage.graph import MCP_Geometric

if TYPE_CHECKING:
    from scipy.sparse import csr_array

SMALL = 100_000
"""A grid of fewer cells is searched as it is."""
COARSE_SIDE = 360
"""A large grid becomes about this many blocks long."""
BESIDE = 2
"""Blocks beside the coarse way that are searched cell by cell."""

Cell = tuple[int, int]
Cells = NDArray[np.intp]


class GridSearch:
    """Searches one grid; where its costs change, it is told.

    Args:
        cost: Cost of each cell, shape (rows, columns); not above 0 where there is no way.
    """

    def __init__(self, cost: NDArray[np.float32]) -> None:
        self._cost = cost
        blocks = round(math.sqrt(cost.size) / COARSE_SIDE)
        self._block = max(2, blocks) if cost.size > SMALL else 1
        self._whole: MCP_Geometric | None = None
        self._coarse = cost
        if self._block > 1:
            rows, columns = (math.ceil(side / self._block) for side in cost.shape)
            self._coarse = np.full((rows, columns), -1, np.float32)
        self.changed(0, cost.shape[0], 0, cost.shape[1])

    def changed(self, top: int, bottom: int, left: int, right: int) -> None:
        """Take note that costs changed in rows `top` to `bottom`, columns `left` to `right`."""
        self._whole = None
        size = self._block
        if size == 1:
            return
        first_row, first_column = top // size, left // size
        last_row, last_column = math.ceil(bottom / size), math.ceil(right / size)
        part = self._cost[
            first_row * size : last_row * size, first_column * size : last_column * size
        ]
        free = part > 0
        sums = _blocks(np.where(free, part, np.float32(0)), size)
        counts = _blocks(free.astype(np.float32), size)
        self._coarse[first_row:last_row, first_column:last_column] = np.where(
            counts > 0, sums / np.maximum(counts, 1), -1
        )

    def path(self, start: Cell, goal: Cell) -> Cells:
        """Return the cells of the cheapest way, shape (n, 2), both ends included.

        Raises:
            ValueError: There is none.
        """
        if self._block > 1:
            found = self._refined(start, goal)
            if found is not None:
                return found
        if self._whole is None:
            # It copies the costs into its own layout, which takes about as long as a short search.
            self._whole = MCP_Geometric(self._cost)
        self._whole.find_costs([start], [goal])
        return np.asarray(self._whole.traceback(goal), dtype=np.intp)

    def _refined(self, start: Cell, goal: Cell) -> Cells | None:
        """Search the blocks, then the cells near the way over them; None where that fails."""
        size = self._block
        first, last = ((cell[0] // size, cell[1] // size) for cell in (start, goal))
        search = MCP_Geometric(self._coarse)
        try:
            search.find_costs([first], [last])
            blocks = np.asarray(search.traceback(last))
        except ValueError:
            return None
        near = np.zeros(self._coarse.shape, np.uint8)
        near[blocks[:, 0], blocks[:, 1]] = 1
        wide = cv2.dilate(near, np.ones((2 * BESIDE + 1,) * 2, np.uint8))
        return self._among(wide.astype(np.bool_), start, goal)

    def _among(self, near: NDArray[np.bool_], start: Cell, goal: Cell) -> Cells | None:
        """Search the cells of some blocks; None where they have no way."""
        size, columns = self._block, self._cost.shape[1]
        from scipy.sparse.csgraph import dijkstra  # takes 0.2 s: only where a grid is large

        inside = np.arange(size)
        at = np.argwhere(near)
        rows = (at[:, :1] * size + inside)[:, :, None]
        ranks = (at[:, 1:] * size + inside)[:, None, :]
        on_map = (rows < self._cost.shape[0]) & (ranks < columns)
        cells = np.sort((rows * columns + ranks)[on_map])
        cost = self._cost.ravel()[cells]
        cells, cost = cells[cost > 0], cost[cost > 0].astype(np.float64)
        graph = _graph(cells, cost, columns)
        source, target = np.searchsorted(
            cells, [start[0] * columns + start[1], goal[0] * columns + goal[1]]
        )
        lengths, before = dijkstra(  # type: ignore[call-overload]  # its stubs want more
            graph, directed=False, indices=int(source), return_predecessors=True
        )
        if not np.isfinite(lengths[target]):
            return None
        way = [int(target)]
        while way[-1] != source:
            way.append(int(before[way[-1]]))
        return np.stack(np.divmod(cells[way[::-1]], columns), axis=1).astype(np.intp)


def _graph(cells: Cells, cost: NDArray[np.float64], columns: int) -> csr_array:
    """Return the steps between neighbouring cells (flat, in order) with what they cost."""
    from scipy.sparse import csr_array  # see above

    origins, ends, prices = [], [], []
    for offset, length in ((1, 1.0), (columns - 1, 2**0.5), (columns, 1.0), (columns + 1, 2**0.5)):
        there = np.minimum(np.searchsorted(cells, cells + offset), len(cells) - 1)
        here = np.flatnonzero(cells[there] == cells + offset)
        if offset != columns:
            # A step over the edge of a row would come out on the other side of the map.
            apart = np.abs(cells[here] % columns - cells[there[here]] % columns)
            here = here[apart <= 1]
        origins.append(here)
        ends.append(there[here])
        prices.append(length * (cost[here] + cost[there[here]]) / 2)
    return csr_array(
        (np.concatenate(prices), (np.concatenate(origins), np.concatenate(ends))),
        shape=(len(cells), len(cells)),
    )


def _blocks(field: NDArray[np.float32], size: int) -> NDArray[np.float32]:
    """Return the sum of each block of size x size cells; what the last blocks lack is 0."""
    rows, columns = (math.ceil(side / size) for side in field.shape)
    lacking = ((0, rows * size - field.shape[0]), (0, columns * size - field.shape[1]))
    padded = np.pad(field, lacking) if any(pair[1] for pair in lacking) else field
    return np.asarray(padded.reshape(rows, size, columns, size).sum(axis=(1, 3)), np.float32)
