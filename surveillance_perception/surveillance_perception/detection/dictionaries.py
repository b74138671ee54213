"""ArUco dictionaries by name, and their codes as cells for matching.

A marker of `bits` x `bits` is drawn with one black cell around it. `MarkerCodes` adds the white
margin every printed marker needs, so that a code is a square of `bits + 4` cells, +1 for white
and -1 for black, once for each id and quarter turn.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass

import cv2
import numpy as np
import numpy.typing as npt

Cells = npt.NDArray[np.float32]

DICTIONARY_NAMES: tuple[str, ...] = tuple(
    sorted(name for name in dir(cv2.aruco) if name.startswith('DICT_'))
)


def dictionary_named(name: str) -> cv2.aruco.Dictionary:
    """The predefined dictionary of that name, such as `DICT_5X5_100`.

    Raises:
        ValueError: OpenCV has no dictionary of that name.
    """
    if name not in DICTIONARY_NAMES:
        raise ValueError(
            f"unknown marker dictionary '{name}', expected one of {', '.join(DICTIONARY_NAMES)}"
        )
    return cv2.aruco.getPredefinedDictionary(getattr(cv2.aruco, name))


@dataclass(frozen=True)
class MarkerCodes:
    """The codes a decoder may choose from.

    Attributes:
        bits: Cells along a side of the code, without border.
        ids: (k,) marker id of each entry.
        turns: (k,) quarter turns clockwise by which the entry's image is turned.
        cells: (k, bits + 4, bits + 4) +1 white, -1 black, with border and margin.
    """

    bits: int
    ids: npt.NDArray[np.int64]
    turns: npt.NDArray[np.int64]
    cells: Cells

    @property
    def side(self) -> int:
        """Cells along the marker's black square."""
        return self.bits + 2

    @classmethod
    def of(
        cls, dictionary: cv2.aruco.Dictionary, known_ids: Iterable[int] | None = None
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
        cells = np.ones((len(chosen) * 4, bits + 4, bits + 4), np.float32)
        cells[:, 1:-1, 1:-1] = -1.0
        for index, marker_id in enumerate(chosen):
            drawn = dictionary.generateImageMarker(marker_id, bits + 2, borderBits=1)
            code = np.where(drawn[1:-1, 1:-1] > 127, 1.0, -1.0)
            for turn in range(4):
                cells[index * 4 + turn, 2:-2, 2:-2] = np.rot90(code, -turn)
        ids = np.repeat(np.array(list(chosen), np.int64), 4)
        return cls(bits, ids, np.tile(np.arange(4), len(chosen)), cells)
