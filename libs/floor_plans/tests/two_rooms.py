"""Two rooms with a door between them, as a map and as a place that refers to it."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
from PIL import Image

SIDE = 0.05
"""Of a pixel, metres."""


def building() -> np.ndarray:
    """Return the pixels of two rooms of 3 x 4 m with a door of 1 m and a table; white is free."""
    pixels = np.full((90, 130), 205, np.uint8)
    pixels[5:85, 5:125] = 254
    for row, column in ((5, slice(5, 125)), (84, slice(5, 125))):
        pixels[row : row + 1, column] = 0
    pixels[5:85, 5] = pixels[5:85, 124] = pixels[5:85, 64] = 0
    pixels[35:55, 64] = 254
    pixels[10:16, 10:26] = 0
    return pixels


def written(folder: Path, text: str = '', ending: str = 'pgm', pixels: Any = None) -> Path:
    image = Image.fromarray(building() if pixels is None else pixels)
    image.save(folder / f'building.{ending}')
    (folder / 'building.yaml').write_text(
        text or f'image: building.{ending}\nresolution: {SIDE}\norigin: [0, 0, 0]\nnegate: 0\n'
    )
    return folder / 'building.yaml'


def place(folder: Path, more: str = '', a: str = '[1.5, 3.0]', b: str = '[5, 3]') -> Path:
    path = folder / 'place.yaml'
    path.write_text(
        '# What a person wrote.\n/**:\n  ros__parameters:\n    map_file: building.yaml  # ours\n'
        f'    map: {{A: [D], B: [D]}}\n    room_positions: {{A: {a}, B: {b}}}\n'
        f'    robot_room: A\n    doors:\n      D: [3.225, 2.25, 1.5707963, 1.0]  # wide\n{more}'
    )
    return path
