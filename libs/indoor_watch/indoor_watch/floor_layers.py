"""What normally stands on a floor, as text that a state file keeps."""

from __future__ import annotations

import base64
import zlib
from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from floor_plans import Grid
from indoor_watch.floor import FloorView

Mask = NDArray[np.bool_]

MOST_CELLS = 25_000_000
"""Of the largest map on which a robot watches."""


def same_map(one: Grid, other: Grid) -> bool:
    """Tell whether two maps are the same one, sent twice."""
    return (
        one.resolution == other.resolution
        and one.origin == other.origin
        and np.array_equal(one.cells, other.cells)
    )


def packed(view: FloorView) -> dict[str, Any]:
    """Return what was seen as plain values: a bit a cell, compressed, in base64."""

    def text(mask: Mask) -> str:
        return base64.b64encode(zlib.compress(np.packbits(mask).tobytes(), 6)).decode()

    grid = view.grid
    return {
        'shape': list(grid.cells.shape),
        'resolution': grid.resolution,
        'origin': list(grid.origin),
        'occupied': text(view.occupied),
        'free': text(view.free),
    }


def unpacked(values: Mapping[str, Any], grid: Grid) -> FloorView | None:
    """Return what is normal on a map; None where it was on another one.

    Raises:
        ValueError, KeyError, TypeError: It is something else.
    """
    if _where(values) != (list(grid.cells.shape), grid.resolution, list(grid.origin)):
        return None
    occupied, free = _masks(values)
    return FloorView(grid, occupied, free, np.zeros_like(free))


def check(values: Mapping[str, Any]) -> None:
    """Check what `packed` gave.

    Raises:
        ValueError, KeyError, TypeError: It is something else.
    """
    _masks(values)
    _where(values)


def _where(values: Mapping[str, Any]) -> tuple[list[int], float, list[float]]:
    """Return the shape, resolution and origin of the map that a packed layer is of."""
    return list(values['shape']), values['resolution'], list(values['origin'])


def _masks(values: Mapping[str, Any]) -> tuple[Mask, Mask]:
    """Return which cells of a packed layer are occupied and which are free."""
    rows, columns = map(int, values['shape'])

    def mask(text: str) -> Mask:
        unpacking = zlib.decompressobj()
        try:
            # Not more than a map can hold: a file may be packed a thousand times smaller.
            data = unpacking.decompress(base64.b64decode(text), MOST_CELLS // 8 + 1)
        except zlib.error as error:
            raise ValueError(f'a layer of the map: {error}') from None
        if not unpacking.eof:
            raise ValueError(f'a layer of the map: cut off, or of more than {MOST_CELLS} cells')
        # before room is made for the cells
        if min(rows, columns) < 0 or len(data) != -(-rows * columns // 8):
            raise ValueError(f'a layer of the map of {len(data)} bytes, not {rows} by {columns}')
        cells = np.unpackbits(np.frombuffer(data, np.uint8), count=rows * columns)
        return np.asarray(cells.reshape(rows, columns), np.bool_)

    return mask(values['occupied']), mask(values['free'])
