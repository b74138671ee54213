"""Maps in map_server's format: a YAML file beside a picture, as ROS 1 and ROS 2 write them.

The YAML file names the picture, the side of a pixel in metres, the pose of the picture's lower left
corner in the world, and how a pixel's brightness becomes occupancy (`mode`, `negate`, thresholds).
Cells are those of nav2_map_server 1.3.13 (Jazzy, `map_io.cpp`): the grey value is the luminance of
the colours in 8 bits, thresholds belong to what they bound, transparency makes a cell unknown but
in `raw`. A picture alone is a map, too, once somebody says how large its pixels are.

What was written on another computer is read where it can be: a picture that is not where the file
says is looked for beside it. `notes` says so, and which keys nobody knows.

`OccupancyMap` keeps the picture's own rows and columns; `grid` is what the robot works on: cells
along the axes of the world, also where the picture is turned.
"""

from __future__ import annotations

import json
import math
import os
import re
import warnings
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any

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

if TYPE_CHECKING:
    from PIL import Image

PICTURES = ('.pgm', '.png', '.bmp', '.jpg', '.jpeg', '.tif', '.tiff', '.pbm', '.ppm', '.gif')
"""Endings of files that are taken for pictures."""
MODES = ('trinary', 'scale', 'raw')
MOST_CELLS = 100_000_000
"""Cells of the largest map: each takes some bytes of memory in several nodes."""
OCCUPIED_THRESHOLD, FREE_THRESHOLD = 0.65, 0.196
"""What is taken where a file names none, as ROS 1 writes them: 205 is unknown."""
_NAV2_FREE, _SAVED_UNKNOWN = 0.25, 205
"""With this threshold nav2_map_saver writes a shade for "unknown" that map_server then reads as
free (slam_toolbox issue 587): see `OccupancyMap.as_saved`.
"""
_LUMINANCE = (306, 601, 117)
"""Of red, green and blue, 1,024ths: GraphicsMagick's intensity (Rec. 601), as map_server has it."""
_KEYS = (
    *('image', 'resolution', 'origin', 'mode', 'negate', 'occupied_thresh', 'free_thresh'),
    *('map_type', 'cost_translation_table'),
)
_MOST_LISTED = 5
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
        picture: The picture; None: it is made of something else.
        notes: What a person should know of how it was read, a line each.
        saved_unknown: The cells that are free by the file's threshold, but have the shade that
            nav2_map_saver gives to unknown ones; None: none are.
    """

    path: Path
    cells: NDArray[np.int8]
    resolution: float
    origin: tuple[float, float, float]
    picture: Path | None = None
    notes: tuple[str, ...] = ()
    saved_unknown: NDArray[np.bool_] | None = None

    def as_saved(self) -> OccupancyMap:
        """Return the map as the robot saved it: unknown where map_server reads free by mistake."""
        if self.saved_unknown is None:
            return self
        cells = np.where(self.saved_unknown, np.int8(UNKNOWN), self.cells)
        return replace(self, cells=cells, saved_unknown=None)

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
    if os.path.isfile(path) and (kind := _kind_of(path)):
        raise FileError(f'{path}: {kind}: expected a map.yaml, or a picture such as PNG')
    if resolution is not None or origin:
        raise FileError(f'{path}: says its own resolution and origin: expected them for a picture')
    file = read_yaml_file(path)
    notes = _checked_keys(file)
    image = file.values['image']
    if not isinstance(image, str) or not image:
        raise file.error(('image',), f'got {image!r}, expected the name of a picture')
    side = _number(file, 'resolution', file.values['resolution'], _FINEST, _COARSEST)
    where, reading = _origin(file), _reading(file)
    picture = _found_picture(file, image)
    if picture != path.parent / image:
        notes = (*notes, f'{path}: the picture {image} is not there: {picture} is taken')
    try:
        return _made(path, picture, side, where, reading, notes)
    except FileError as error:
        if str(error).startswith(f'{picture}'):
            raise file.error_at(('image',), str(error)) from None
        raise


def _found_picture(file: YamlFile, image: str) -> Path:
    """Return the picture that a map's file means, where it is on this computer.

    Raises:
        FileError: Neither is it where the file says, nor is one of its name beside the file.
    """
    named = file.path.parent / image
    name = image.replace('\\', '/').rstrip('/').rpartition('/')[2]
    beside = file.path.parent / name
    for tried in (named, Path(os.path.expanduser(image)), beside):
        if os.path.isfile(tried):  # False for a name that is too long, too
            return tried
    there = _pictures_in(file.path.parent)
    same = [each for each in there if each.stem.casefold() == beside.stem.casefold()]
    if len(same) == 1:
        return same[0]
    if os.path.exists(named):
        return named  # a folder or a device: reading it says so
    listed = ', '.join(each.name for each in (same or there)[:_MOST_LISTED])
    found = f'the pictures there are {listed}' if listed else 'there is no picture'
    also = f', nor is {beside}' if beside != named else ''
    what = 'a link that leads to no file' if os.path.islink(named) else 'no such file'
    raise file.error(('image',), f'{named}: {what}{also}; {found}: expected its name')


def _pictures_in(folder: Path) -> list[Path]:
    try:
        return sorted(
            each for each in folder.iterdir() if is_picture(each) and os.path.isfile(each)
        )
    except OSError:
        return []


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


def _checked_keys(file: YamlFile) -> tuple[str, ...]:
    """Return a line that names the keys which nobody knows; map_server passes over them, too."""
    for key in ('image', 'resolution'):
        if key not in file.values:
            raise file.error((), f"a map in map_server's format needs '{key}'")
    unknown = [str(key) for key in file.values if key not in _KEYS]
    if not unknown:
        return ()
    like = [(key, name) for key in unknown for name in _KEYS if nearest(key, _KEYS) == f"'{name}'"]
    meant = ''.join(f"; is '{name}' meant by '{key}'?" for key, name in like)
    return (f'{file.path}: keys that no map has are ignored: {", ".join(unknown)}{meant}',)


def _origin(file: YamlFile) -> tuple[float, ...]:
    value = file.values.get('origin', [0.0, 0.0, 0.0])
    if not isinstance(value, list) or len(value) not in (2, 3):
        raise file.error(('origin',), f'got {value!r}, expected [x, y, yaw]')
    return tuple(_number(file, 'origin', each, -_FURTHEST, _FURTHEST) for each in (*value, 0.0)[:3])


def _reading(file: YamlFile) -> _Reading:
    given = file.values
    mode = given.get('mode', 'trinary')
    if not isinstance(mode, str) or mode.lower() not in MODES:
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
    return _Reading(mode.lower(), bool(negate), occupied, free)


def _number(file: YamlFile, key: str, value: Any, low: float, high: float) -> float:
    if isinstance(value, bool) or not isinstance(value, int | float) or not low <= value <= high:
        raise file.error((key,), f'got {value!r}, expected a number from {low:g} to {high:g}')
    return float(value)


def _made(
    path: Path,
    picture: Path,
    resolution: float,
    origin: Sequence[float],
    reading: _Reading,
    notes: tuple[str, ...] = (),
) -> OccupancyMap:
    if not _FINEST <= resolution <= _COARSEST:
        raise FileError(
            f'{path}: a resolution of {resolution:g} m: expected {_FINEST:g} to {_COARSEST:g}'
        )
    if len(origin) != 3 or not all(abs(each) <= _FURTHEST for each in origin):
        raise FileError(f'{path}: an origin of {list(origin)}: expected [x, y, yaw]')
    grey, alpha = _pixels(picture)
    cells = _occupancy(grey, alpha, reading)
    saved = None
    if reading.mode == 'trinary' and reading.free == _NAV2_FREE:
        unknown = (grey == _SAVED_UNKNOWN) & (cells == FREE)
        saved = unknown if unknown.any() else None
    x, y, yaw = (float(each) for each in origin)
    return OccupancyMap(path, cells, resolution, (x, y, yaw), picture, notes, saved)


def _pixels(picture: Path) -> tuple[NDArray[np.uint8], NDArray[np.uint8] | None]:
    """Return a picture's luminance and, where it has one, opacity; 0 to 255, (rows, columns)."""
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
            values = _channels(picture, opened)
    except FileError:
        raise
    except FileNotFoundError as error:
        there = like_file(picture)
        hint = f", expected '{there}'" if there else ''
        raise FileError(f'{picture}: {error.strerror}{hint}') from None
    except UnidentifiedImageError:
        raise FileError(f'{picture}: {_what_it_is(picture)}') from None
    except Image.DecompressionBombError:
        raise FileError(
            f'{picture}: more pixels than any map has: expected at most {MOST_CELLS} in all'
        ) from None
    except OSError as error:
        raise FileError(
            in_one_line(error) if error.errno else f'{picture}: a damaged picture: {error}'
        ) from None
    except (ValueError, SyntaxError, EOFError) as error:
        raise FileError(f'{picture}: a damaged picture: {error}') from None
    alpha = _in_8_bits(values[..., -1]) if values.ndim == 3 and values.shape[2] in (2, 4) else None
    if values.ndim == 2 or values.shape[2] < 3:
        return _in_8_bits(values if values.ndim == 2 else values[..., 0]), alpha
    grey = np.empty(values.shape[:2], np.uint8)
    for top in range(0, len(values), 256):  # 8 bytes of each pixel, some rows at a time
        some = values[top : top + 256]
        weighted = np.zeros(some.shape[:2], np.uint32)
        for channel, weight in enumerate(_LUMINANCE):
            weighted += some[..., channel].astype(np.uint32) * np.uint32(weight)
        # GraphicsMagick computes in 16 bits, where a sample of 8 bits stands twice.
        if values.dtype == np.uint8:
            weighted *= np.uint32(257)
        grey[top : top + 256] = _in_8_bits((weighted >> 10).astype(np.uint16))
    return grey, alpha


def _in_8_bits(samples: NDArray[Any]) -> NDArray[np.uint8]:
    """Return samples of 16 bits, rounded; those of 8 bits as they are."""
    if samples.dtype == np.uint8:
        return samples
    rounded = np.empty(samples.shape, np.uint8)
    for top in range(0, len(samples), 256):  # 4 bytes of each, some rows at a time
        rounded[top : top + 256] = (samples[top : top + 256].astype(np.uint32) + 128) // 257
    return rounded


def _channels(picture: Path, image: Image.Image) -> NDArray[Any]:
    """Return a picture's samples of 8 or 16 bits: grey, grey and alpha, colours (and alpha)."""
    if image.format == 'PNG' and image.mode in ('RGB', 'RGBA', 'LA') and _has_16_bits(picture):
        # Pillow keeps the upper half of each sample of these; map_server rounds.
        import cv2

        samples = cv2.imread(str(picture), cv2.IMREAD_UNCHANGED)
        if samples is not None and samples.dtype == np.uint16:
            # In its own memory: a copy of the largest takes 800 MB.
            order = cv2.COLOR_BGRA2RGBA if samples.shape[2] == 4 else cv2.COLOR_BGR2RGB
            return np.asarray(cv2.cvtColor(samples, order, samples))
    if image.mode == 'P' or 'transparency' in image.info:
        image = image.convert('RGBA' if 'transparency' in image.info else 'RGB')
    elif image.mode == '1':
        image = image.convert('L')
    elif image.mode not in ('L', 'LA', 'RGB', 'RGBA', 'I', 'I;16', 'I;16B', 'I;16L', 'I;16N'):
        image = image.convert('RGBA' if image.getbands()[-1] in ('A', 'a') else 'RGB')
    values: NDArray[Any] = np.asarray(image)
    if values.dtype.itemsize > 1:
        return np.asarray(np.clip(values, 0, 65535), np.uint16)
    return values


def _has_16_bits(png: Path) -> bool:
    with png.open('rb') as file:
        return file.read(25)[24:] == b'\x10'  # behind the signature and the size, in IHDR


_KINDS = (
    (b'%PDF', 'a PDF'),
    (b'PK', 'a zip archive'),
    (b'\x1f\x8b', 'a gzip archive'),
    (b'version https://git-lfs', "Git LFS's pointer to a picture, which `git lfs pull` fetches"),
    (b'<svg', 'an SVG drawing'),
    (b'<?xml', 'an XML text, such as an SVG drawing'),
    (b'<!DOCTYPE', 'a web page'),
    (b'<html', 'a web page'),
)


def _kind_of(path: Path) -> str:
    """Return what a file is by its first bytes, if that is neither a picture nor a text; or ''."""
    try:
        with path.open('rb') as file:
            start = file.read(64)
    except OSError:
        return ''
    return next((said for begin, said in _KINDS if start.lstrip()[: len(begin)] == begin), '')


def _what_it_is(path: Path) -> str:
    """Return what a file is that is no picture, in words."""
    size = path.stat().st_size
    if not size:
        return 'an empty file: expected a picture'
    with path.open('rb') as file:
        start = file.read(200)
    kinds = [said for begin, said in _KINDS if start.lstrip()[: len(begin)] == begin]
    if not kinds and not start.strip(bytes([*range(32, 127), 9, 10, 13])):
        kinds = ['a text']
    what = kinds[0] if kinds else 'no picture that can be read'
    return f'{what} ({size:,} bytes): expected a picture, such as PGM, PNG or BMP'


def _occupancy(
    grey: NDArray[np.uint8], alpha: NDArray[np.uint8] | None, reading: _Reading
) -> NDArray[np.int8]:
    """Return the cells of a picture.

    Each of the 256 grey values has one result, in single precision as map_server computes it.
    """
    shades = np.arange(256)
    if reading.mode == 'raw':
        # As it is, whatever its opacity and whether it is to be negated.
        return np.where(shades <= OCCUPIED, shades, UNKNOWN).astype(np.int8)[grey]
    bright = shades.astype(np.float32) / np.float32(255)
    value = bright if reading.negate else np.float32(1) - bright
    low, high = np.float32(reading.free), np.float32(reading.occupied)
    found = np.full(256, UNKNOWN, np.int8)
    found[value >= high] = OCCUPIED
    found[value <= low] = FREE
    if reading.mode == 'scale':
        between = (value > low) & (value < high)
        span = np.float32(reading.occupied - reading.free)
        share = (value[between] - low) / span * np.float32(100)
        found[between] = np.floor(share + np.float32(0.5)).astype(np.int8)
    cells = found[grey]
    if alpha is not None:
        cells[alpha < 255] = UNKNOWN
    return cells
