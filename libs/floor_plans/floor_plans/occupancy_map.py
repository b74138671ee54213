"""Maps in map_server's format: a YAML file beside a picture, as ROS 1 and ROS 2 write them.

The YAML file names the picture, the side of a pixel in metres, the pose of the picture's lower left
corner in the world, and how a pixel's brightness becomes occupancy (`mode`, `negate`, thresholds;
nav2_map_server's `map_io.cpp` is followed, with its rules for transparency). A picture alone is a
map, too, once somebody says how large its pixels are.

`OccupancyMap` keeps the picture's own rows and columns; `grid` is what the robot works on: cells
along the axes of the world, also where the picture is turned.
"""

from __future__ import annotations

import json
import math
import re
import warnings
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from floor_plans.occupancy_grid import (
    FREE,
    OCCUPIED,
    UNKNOWN,
    Grid,
    Points,
)
from strict_files.files import FileError, in_one_line, like_file, replace_text
from strict_files.suggestions import nearest
from strict_files.yaml_file import YamlFile, read_yaml_file

PICTURES = ('.pgm', '.png', '.bmp', '.jpg', '.jpeg', '.tif', '.tiff', '.pbm', '.ppm', '.gif')
"""Endings of files that are taken for pictures."""
MODES = ('trinary', 'scale', 'raw')
MOST_CELLS = 100_000_000
"""Cells of the largest map: each takes some bytes of memory in several nodes."""
OCCUPIED_THRESHOLD, FREE_THRESHOLD = 0.65, 0.196
"""What is taken where a file names none, as ROS 1 writes them: 205 is unknown."""
_NAV2_FREE, _SAVED_UNKNOWN = 0.25, 205
"""With this threshold nav2_map_saver writes a shade for "unknown" that map_server then reads as
free (slam_toolbox issue 587). What was saved as unknown is taken as unknown.
"""
_KEYS = (
    *('image', 'resolution', 'origin', 'mode', 'negate', 'occupied_thresh', 'free_thresh'),
    *('map_type', 'cost_translation_table'),
)
_FINEST, _COARSEST = 0.001, 5.0
_FURTHEST = 100_000.0
_PARALLEL = 1e-6


@dataclass(frozen=True, eq=False)
class OccupancyMap:
    """A map as its file has it.

    Attributes:
        path: The file that describes it.
        cells: Occupancy of the picture's pixels, row 0 at its top, shape (rows, columns), int8:
            0 free, 100 occupied, -1 unknown.
        resolution: Side of a pixel, metres.
        origin: Pose of the lower left corner in the world: x, y in metres, yaw in rad.
    """

    path: Path
    cells: NDArray[np.int8]
    resolution: float
    origin: tuple[float, float, float]

    @cached_property
    def grid(self) -> Grid:
        """The map with cells along the world's axes; a picture that is turned is drawn anew."""
        own = self.own_grid
        if abs(math.remainder(self.origin[2], 2 * math.pi)) < _PARALLEL:
            return Grid(own.cells, self.resolution, self.origin[:2])
        return self._turned(own.cells)

    @cached_property
    def own_grid(self) -> Grid:
        """The map in the picture's own frame: metres from its lower left corner."""
        return Grid(np.ascontiguousarray(self.cells[::-1]), self.resolution)

    def to_world(self, points: Any) -> Points:
        """Return points of the picture's own frame in the world's, shape (n, 2), metres."""
        x, y, yaw = self.origin
        turn = np.array([[math.cos(yaw), math.sin(yaw)], [-math.sin(yaw), math.cos(yaw)]])
        return np.asarray(np.asarray(points, dtype=float).reshape(-1, 2) @ turn + (x, y))

    def to_own(self, points: Any) -> Points:
        """Return points of the world in the picture's own frame, shape (n, 2), metres."""
        x, y, yaw = self.origin
        turn = np.array([[math.cos(yaw), -math.sin(yaw)], [math.sin(yaw), math.cos(yaw)]])
        return np.asarray((np.asarray(points, dtype=float).reshape(-1, 2) - (x, y)) @ turn)

    def _turned(self, cells: NDArray[np.int8]) -> Grid:
        side = self.resolution
        rows, columns = cells.shape
        corners = self.to_world(
            [(0, 0), (columns * side, 0), (0, rows * side), (columns * side, rows * side)]
        )
        west, south = np.floor(corners.min(axis=0) / side) * side
        east, north = corners.max(axis=0)
        wide, high = math.ceil((east - west) / side), math.ceil((north - south) / side)
        found = np.full((high, wide), UNKNOWN, np.int8)
        x = west + (np.arange(wide) + 0.5) * side
        cos, sin = math.cos(self.origin[2]), math.sin(self.origin[2])
        # Some rows at a time, so that a large map takes no memory for its coordinates.
        for first in range(0, high, 256):
            y = south + (np.arange(first, min(high, first + 256)) + 0.5) * side
            dx, dy = x[None, :] - self.origin[0], y[:, None] - self.origin[1]
            column, row = (cos * dx + sin * dy) / side, (cos * dy - sin * dx) / side
            block = found[first : first + len(y)]
            # A cell is what its middle falls on, and occupied where a wall cuts a part of it:
            # walls of one pixel would get holes otherwise.
            for right, up in ((0.0, 0.0), (-0.3, -0.3), (0.3, -0.3), (-0.3, 0.3), (0.3, 0.3)):
                i, j = np.floor(row + up).astype(np.intp), np.floor(column + right).astype(np.intp)
                inside = (i >= 0) & (i < rows) & (j >= 0) & (j < columns)
                value = np.full(block.shape, UNKNOWN, np.int8)
                value[inside] = cells[i[inside], j[inside]]
                if right == 0.0:
                    block[:] = value
                else:
                    np.copyto(block, value, where=value == OCCUPIED)
        return Grid(found, side, (float(west), float(south)))


def read_map(
    path: str | Path,
    *,
    resolution: float | None = None,
    origin: Sequence[float] = (),
) -> OccupancyMap:
    """Read a map: its YAML file, or a picture with the size of its pixels.

    Args:
        path: A file of map_server's format, or a picture (dark is occupied, bright free).
        resolution: Side of a picture's pixel, metres; only for a picture.
        origin: Pose of a picture's lower left corner, metres and rad; only for a picture.

    Raises:
        FileError: It cannot be read or understood; one line with the file and, for YAML, the line.
    """
    path = Path(path)
    if is_picture(path):
        if resolution is None:
            raise FileError(
                f'{path}: a picture says nothing of its scale: expected the side of a pixel in '
                'metres (map_file_resolution; import: --resolution), or the map.yaml beside it'
            )
        return _made(path, path, resolution, tuple(origin) or (0.0, 0.0, 0.0), _Reading())
    if resolution is not None or origin:
        raise FileError(f'{path}: says its own resolution and origin: expected them for a picture')
    file = read_yaml_file(path)
    _check_keys(file)
    image = file.values['image']
    if not isinstance(image, str) or not image:
        raise file.error(('image',), f'got {image!r}, expected the name of a picture')
    picture = Path(image) if Path(image).is_absolute() else path.parent / image
    side = _number(file, 'resolution', file.values['resolution'], _FINEST, _COARSEST)
    try:
        return _made(path, picture, side, _origin(file), _reading(file))
    except FileError as error:
        if str(error).startswith(f'{picture}'):
            raise file.error_at(('image',), str(error)) from None
        raise


def is_picture(path: str | Path) -> bool:
    """Tell whether a file is taken for a picture, by its ending."""
    return Path(path).suffix.lower() in PICTURES


def is_map_description(values: Mapping[str, Any]) -> bool:
    """Tell whether the top level of a YAML file is that of a map in map_server's format."""
    return 'image' in values and '/**' not in values


def _as_yaml(name: str) -> str:
    """Return a file's name as YAML reads it, in quotes where it has other signs than most."""
    return name if re.fullmatch(r'\w[\w .-]*', name) else json.dumps(name, ensure_ascii=False)


def write_map(
    path: Path,
    cells: NDArray[np.int8],
    resolution: float,
    origin: tuple[float, float, float],
    kind: str = 'png',
) -> None:
    """Write a map in map_server's format: a YAML file, and a picture of the same name beside it.

    What is there is replaced at once: a reader finds no half of it.

    Args:
        path: The YAML file.
        cells: Occupancy, row 0 at the top of the picture, shape (rows, columns).
        resolution: Side of a cell, metres.
        origin: Pose of the lower left corner, metres and rad.
        kind: Of the picture: png or pgm.

    Raises:
        FileError: It cannot be written.
    """
    from PIL import Image

    grey = np.full(cells.shape, 205, np.uint8)  # as map_saver does: 205 is unknown
    grey[cells >= 0] = 254
    grey[cells >= 65] = 0
    x, y, yaw = (round(float(each), 7) for each in origin)
    text = (
        f'image: {_as_yaml(f"{path.stem}.{kind}")}\nmode: trinary\nresolution: {resolution:g}\n'
        f'origin: [{x}, {y}, {yaw}]\nnegate: 0\noccupied_thresh: 0.65\nfree_thresh: 0.196\n'
    )
    try:
        fresh = path.with_name(f'.{path.stem}.new.{kind}')
        Image.fromarray(grey).save(fresh)
        fresh.replace(path.with_suffix(f'.{kind}'))
        replace_text(path, text)
    except OSError as error:
        raise FileError(f'{path}: cannot be written: {error.strerror or error}') from None


@dataclass(frozen=True)
class _Reading:
    """How a pixel becomes occupancy."""

    mode: str = 'trinary'
    negate: bool = False
    occupied: float = OCCUPIED_THRESHOLD
    free: float = FREE_THRESHOLD


def _check_keys(file: YamlFile) -> None:
    for key in file.values:
        if key not in _KEYS:
            raise file.error((str(key),), f'no key of a map, expected {nearest(str(key), _KEYS)}')
    for key in ('image', 'resolution'):
        if key not in file.values:
            raise file.error((), f"a map in map_server's format needs '{key}'")


def _origin(file: YamlFile) -> tuple[float, ...]:
    value = file.values.get('origin', [0.0, 0.0, 0.0])
    if not isinstance(value, list) or len(value) not in (2, 3):
        raise file.error(('origin',), f'got {value!r}, expected [x, y, yaw]')
    return tuple(_number(file, 'origin', each, -_FURTHEST, _FURTHEST) for each in (*value, 0.0)[:3])


def _reading(file: YamlFile) -> _Reading:
    given = file.values
    mode = given.get('mode', 'trinary')
    if mode not in MODES:
        raise file.error(('mode',), f'got {mode!r}, expected {", ".join(MODES)}')
    negate = given.get('negate', 0)
    if negate not in (0, 1):  # also false and true
        raise file.error(('negate',), f'got {negate!r}, expected 0 or 1')
    occupied = _number(
        file, 'occupied_thresh', given.get('occupied_thresh', OCCUPIED_THRESHOLD), 0.0, 1.0
    )
    default = min(FREE_THRESHOLD, occupied)
    free = _number(file, 'free_thresh', given.get('free_thresh', default), 0.0, 1.0)
    if free > occupied:
        raise file.error(
            ('free_thresh',), f'{free:g}: expected at most occupied_thresh, {occupied:g}'
        )
    return _Reading(mode, bool(negate), occupied, free)


def _number(file: YamlFile, key: str, value: Any, low: float, high: float) -> float:
    if isinstance(value, bool) or not isinstance(value, int | float) or not low <= value <= high:
        raise file.error((key,), f'got {value!r}, expected a number from {low:g} to {high:g}')
    return float(value)


def _made(
    path: Path, picture: Path, resolution: float, origin: Sequence[float], reading: _Reading
) -> OccupancyMap:
    if not _FINEST <= resolution <= _COARSEST:
        raise FileError(
            f'{path}: a resolution of {resolution:g} m: expected {_FINEST:g} to {_COARSEST:g}'
        )
    if len(origin) != 3 or not all(abs(each) <= _FURTHEST for each in origin):
        raise FileError(f'{path}: an origin of {list(origin)}: expected [x, y, yaw]')
    cells = _occupancy(*_pixels(picture), reading)
    x, y, yaw = (float(each) for each in origin)
    return OccupancyMap(path, cells, resolution, (x, y, yaw))


def _pixels(picture: Path) -> tuple[NDArray[np.float32], NDArray[np.float32] | None]:
    """Return a picture's brightness and, where it has one, opacity; 0 to 1, shape (rows, columns).

    The brightness is the mean of the colours, as map_server takes it.
    """
    from PIL import Image, UnidentifiedImageError

    try:
        with warnings.catch_warnings():
            warnings.simplefilter('ignore', Image.DecompressionBombWarning)
            opened = Image.open(picture)
        with opened:
            if opened.width * opened.height > MOST_CELLS:
                raise FileError(
                    f'{picture}: {opened.width} by {opened.height} pixels: expected at most '
                    f'{MOST_CELLS} in all'
                )
            image: Image.Image = opened
            if image.mode == 'P':
                image = image.convert('RGBA' if 'transparency' in image.info else 'RGB')
            elif image.mode == '1':
                image = image.convert('L')
            values = np.asarray(image)
            bands = image.getbands()
    except FileNotFoundError as error:
        there = like_file(picture)
        hint = f", expected '{there}'" if there else ''
        raise FileError(f'{picture}: {error.strerror}{hint}') from None
    except (UnidentifiedImageError, Image.DecompressionBombError) as error:
        bomb = isinstance(error, Image.DecompressionBombError)
        what = str(error) if bomb else 'no picture that can be read'
        raise FileError(f'{picture}: {what}') from None
    except OSError as error:
        raise FileError(
            in_one_line(error) if error.errno else f'{picture}: a damaged picture: {error}'
        ) from None
    except (ValueError, SyntaxError, EOFError) as error:
        raise FileError(f'{picture}: a damaged picture: {error}') from None
    whole = np.float32(65535 if bands[0].startswith('I') or values.dtype.itemsize > 1 else 255)
    if values.ndim == 2:
        return values.astype(np.float32) / whole, None
    has_alpha = bands[-1] == 'A'
    colours = values[..., :-1] if has_alpha else values
    bright = colours.astype(np.float32).mean(axis=2) / whole
    return bright, values[..., -1].astype(np.float32) / whole if has_alpha else None


def _occupancy(
    bright: NDArray[np.float32], opacity: NDArray[np.float32] | None, reading: _Reading
) -> NDArray[np.int8]:
    if opacity is not None and reading.mode == 'trinary':
        # In this mode opacity is averaged in with red, green and blue.
        bright = (3 * bright + opacity) / np.float32(4)
    if reading.mode == 'raw':
        value = np.rint(bright * 255).astype(np.int16)
        return np.where(value <= 100, value, UNKNOWN).astype(np.int8)
    occupied = bright if reading.negate else np.float32(1) - bright
    found = np.full(bright.shape, UNKNOWN, np.int8)
    if reading.mode == 'scale':
        span = max(reading.occupied - reading.free, 1e-9)
        found = np.rint(np.clip((occupied - reading.free) / span, 0.0, 1.0) * 100).astype(np.int8)
    found[occupied > reading.occupied] = OCCUPIED
    found[occupied < reading.free] = FREE
    if reading.mode == 'trinary' and reading.free == _NAV2_FREE:
        found[np.rint(bright * 255) == _SAVED_UNKNOWN] = UNKNOWN
    if opacity is not None and reading.mode == 'scale':
        found[opacity < 1] = UNKNOWN
    return found
