"""ArUco dictionaries by name, and their codes as cells for matching.

A marker of `bits` x `bits` is drawn with a border of black cells around it: one, or two in Kalibr's
AprilGrids. `MarkerCodes` adds the white margin every printed marker needs, so that a code is a
square of `bits + 2 border + 2` cells, +1 for white and -1 for black, once for each id and quarter
turn.
"""

from __future__ import annotations

import difflib
import errno
import os
from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

import cv2
import numpy as np
import numpy.typing as npt
import yaml

_FILE_SUFFIXES = ('.yaml', '.yml', '.json', '.xml')
_LARGEST_FILE = 10_000_000
_MOST_MARKERS = 100_000
_SMALLEST_SIDE, _LARGEST_SIDE = 3, 16

Cells = npt.NDArray[np.float32]

DICTIONARY_NAMES: tuple[str, ...] = tuple(
    sorted(name for name in dir(cv2.aruco) if name.startswith('DICT_'))
)


def dictionary_named(name: str) -> cv2.aruco.Dictionary:
    """Return a predefined dictionary by its name, such as `DICT_5X5_100`, or one of the user's own.

    Args:
        name: One of `DICTIONARY_NAMES`, or the path of a YAML, JSON or XML file as OpenCV writes
            and reads them: `nmarkers`, `markersize`, `marker_0`, `marker_1`, ...; without
            `maxCorrectionBits` that is 0, as for OpenCV.

    Raises:
        ValueError: OpenCV has no dictionary of that name, and there is no usable file.
    """
    if name in DICTIONARY_NAMES:
        return cv2.aruco.getPredefinedDictionary(getattr(cv2.aruco, name))
    if Path(name).suffix.lower() in _FILE_SUFFIXES:
        return _dictionary_in(Path(name))
    near = difflib.get_close_matches(name, DICTIONARY_NAMES, 1, 0.0)
    raise ValueError(
        f"unknown marker dictionary '{name[:60]}', did you mean {near[0]}? Expected one of "
        f'{", ".join(DICTIONARY_NAMES)}, or a file of OpenCV ({", ".join(_FILE_SUFFIXES)})'
    )


def _dictionary_in(path: Path) -> cv2.aruco.Dictionary:
    what = f'marker dictionary {path}'
    try:
        if not path.is_file():  # a pipe or a device may have no end
            reason = 'expected a file' if path.exists() else os.strerror(errno.ENOENT)
            raise ValueError(f'{what}: {reason}')
        if path.stat().st_size > _LARGEST_FILE:
            raise ValueError(f'{what}: larger than {_LARGEST_FILE} bytes')
        text = path.read_text(encoding='utf-8')
    except OSError as error:
        raise ValueError(f'{what}: {error.strerror}') from None
    except UnicodeDecodeError as error:
        raise ValueError(f'{what} is no text') from error
    expected = "expected OpenCV's form: nmarkers, markersize, marker_0, ..."
    values = _values_in(text, what, expected)
    try:
        count, side = (int(values[key]) for key in ('nmarkers', 'markersize'))
        correction = int(values.get('maxCorrectionBits', 0))
        codes = [str(values[f'marker_{index}']) for index in range(min(count, _MOST_MARKERS))]
    except KeyError as error:
        raise ValueError(f'{what} lacks {error.args[0]}, {expected}') from error
    except (AttributeError, TypeError, ValueError) as error:
        raise ValueError(f'{what} cannot be read, {expected}') from error
    if not 1 <= count == len(codes) or not _SMALLEST_SIDE <= side <= _LARGEST_SIDE:
        raise ValueError(f'{what} has {count} markers of {side}x{side} cells, {expected}')
    if not 0 <= correction <= side * side:
        raise ValueError(f'{what}: maxCorrectionBits must be 0 to {side * side}, got {correction}')
    for index, code in enumerate(codes):
        if len(code) != side * side or set(code) - {'0', '1'}:
            raise ValueError(f'{what}: marker_{index} must be {side * side} digits 0 or 1')
    bits = np.array([list(code) for code in codes]).astype(np.uint8).reshape(count, side, side)
    stored = np.concatenate([cv2.aruco.Dictionary.getByteListFromBits(each) for each in bits])
    return cv2.aruco.Dictionary(stored, side, correction)


def _values_in(text: str, what: str, expected: str) -> Any:
    """Return what OpenCV's FileStorage has at the top of a file, as text.

    Raises:
        ValueError: It is neither YAML nor XML.
    """
    if text.lstrip().startswith('<?xml'):
        if '<!DOCTYPE' in text:
            raise ValueError(f'{what} has a document type, {expected}')
        try:
            root = ElementTree.fromstring(text)
        except ElementTree.ParseError as error:
            raise ValueError(f'{what} is not valid XML ({error}), {expected}') from error
        # strings of digits are in quotes: they would be numbers otherwise
        return {each.tag: (each.text or '').strip().strip('"') for each in root}
    if text.startswith('%YAML'):
        # OpenCV's first line is no YAML of any version
        text = text.partition('\n')[2]
    try:
        return yaml.load(text, yaml.BaseLoader)
    except (yaml.YAMLError, RecursionError) as error:
        raise ValueError(f'{what} is not valid YAML, {expected}') from error


@dataclass(frozen=True)
class MarkerCodes:
    """The codes a decoder may choose from.

    Attributes:
        bits: Cells along a side of the code, without border.
        ids: (k,) marker id of each entry.
        turns: (k,) quarter turns clockwise by which the entry's image is turned.
        cells: (k, n, n) +1 white, -1 black, with border and margin: n is `side + 2`.
        border: Black cells around the code.
    """

    bits: int
    ids: npt.NDArray[np.int64]
    turns: npt.NDArray[np.int64]
    cells: Cells
    border: int = 1

    @property
    def side(self) -> int:
        """Cells along the marker's black square."""
        return self.bits + 2 * self.border

    @classmethod
    def of(
        cls,
        dictionary: cv2.aruco.Dictionary,
        known_ids: Iterable[int] | None = None,
        border: int = 1,
    ) -> MarkerCodes:
        """Codes of a dictionary, all of them or those of `known_ids`.

        Raises:
            ValueError: A known id is not in the dictionary.
        """
        count = int(dictionary.bytesList.shape[0])
        chosen = range(count) if known_ids is None else sorted(set(known_ids))
        beyond = [each for each in chosen if not 0 <= each < count]
        if beyond:
            raise ValueError(
                f'known id {beyond[0]} is not in the dictionary, expected 0 to {count - 1}'
            )
        bits = int(dictionary.markerSize)
        side = bits + 2 * border
        cells = np.ones((len(chosen) * 4, side + 2, side + 2), np.float32)
        cells[:, 1:-1, 1:-1] = -1.0
        code = np.where(_bits_of(dictionary)[list(chosen)], np.float32(1.0), np.float32(-1.0))
        for turn in range(4):
            cells[turn::4, border + 1 : -border - 1, border + 1 : -border - 1] = np.rot90(
                code, -turn, axes=(1, 2)
            )
        ids = np.repeat(np.array(list(chosen), np.int64), 4)
        turns = np.tile(np.arange(4), len(chosen))
        return cls(bits, ids, turns, cells, border)


def _bits_of(dictionary: cv2.aruco.Dictionary) -> npt.NDArray[np.bool_]:
    """Return the cells (n, bits, bits) of all codes, true for white.

    OpenCV packs them row by row into bytes, the last of which has the rest in its lowest bits.
    (Drawing each marker takes ten times as long.)
    """
    side = int(dictionary.markerSize)
    stored = np.ascontiguousarray(dictionary.bytesList, np.uint8)
    # four rotations one after the other, although the array's shape says otherwise
    packed = stored.reshape(len(stored), 4, -1)[:, 0]
    whole, rest = divmod(side * side, 8)
    bits = np.unpackbits(packed, axis=1)
    last = bits[:, 8 * whole + 8 - rest : 8 * whole + 8] if rest else bits[:, :0]
    return np.concatenate([bits[:, : 8 * whole], last], axis=1).astype(bool).reshape(-1, side, side)
