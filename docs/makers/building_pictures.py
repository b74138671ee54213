"""Draws the pictures of your_building.md in docs/images anew.

    .venv/bin/python docs/makers/building_pictures.py [FOLDER]

The map is the project's own office, furnished and turned, as a robot would have it. Needs Chromium
and its driver (apt-get install chromium chromium-driver).
"""

from __future__ import annotations

import os
import sys
import tempfile
from pathlib import Path

import cv2
import numpy as np
from PIL import Image

ROOT = Path(__file__).resolve().parents[2]
sys.path.insert(0, str(ROOT))

from floor_plans import read_place
from floor_plans.imports import ImportRequest, import_place
from floor_plans.occupancy_map import write_map
from surveillance_operator.place_page.edit_command import editor_page
from tests.operator.browser import DESK, Viewer
from tests.operator.test_dropped_map import drop_of

SIDE = 0.05
TURN = 8.0
WIDE = 900
"""Width of the drawings, pixels."""


def furnished_map(path: Path) -> None:
    """Write the map of a furnished, turned office."""
    grid = read_place(ROOT / 'config' / 'office.yaml').plan.grid(SIDE)
    rows, columns = grid.cells.shape
    grey = np.full((rows, columns), 128, np.uint8)
    grey[grid.free], grey[grid.occupied] = 255, 0
    rng = np.random.default_rng(7)
    free = np.argwhere(cv2.erode(grid.free.astype(np.uint8), np.ones((25, 25), np.uint8)) > 0)
    for row, column in free[rng.choice(len(free), 70, replace=False)].tolist():
        size = rng.uniform(0.3, 0.7, 2) / SIDE
        corners = cv2.boxPoints(((column, row), tuple(size), float(rng.uniform(0, 90))))
        cv2.fillPoly(grey, [corners.astype(np.int32)], 0)
    span = int(np.hypot(rows, columns))
    turn = cv2.getRotationMatrix2D((columns / 2, rows / 2), TURN, 1.0)
    high = rows + int(columns * np.sin(np.radians(TURN))) + 20
    turn[:, 2] += ((span - columns) / 2, (high - rows) / 2)
    grey = cv2.warpAffine(grey, turn, (span, high), flags=cv2.INTER_NEAREST, borderValue=128)
    cells = np.full(grey.shape, -1, np.int8)
    cells[grey > 200], cells[grey < 60] = 0, 100
    write_map(path, cells[::-1], SIDE, (0.0, 0.0, 0.0))


def smaller(source: Path, target: Path) -> None:
    """Write a picture as wide as the page shows it, with few colours."""
    with Image.open(source) as image:
        size = (WIDE, round(image.height * WIDE / image.width))
        small = image.convert('RGB').resize(size, Image.Resampling.LANCZOS)
    small.quantize(64).save(target, optimize=True)


def main() -> None:
    """Draw all pictures."""
    folder = Path(sys.argv[1]) if len(sys.argv) > 1 else ROOT / 'docs/images'
    folder = folder.resolve()
    with tempfile.TemporaryDirectory() as scratch:
        os.chdir(scratch)
        Path('desk').mkdir()
        building = Path('building.yaml')
        furnished_map(building)
        smaller(building.with_suffix('.png'), folder / 'building_map.png')
        import_place(ImportRequest(building, Path('place.yaml')))
        smaller(Path('place.png'), folder / 'building_place.png')
        os.chdir('desk')
        page = editor_page(None, '127.0.0.1', 0, 0.22)
        page.start()
        viewer = Viewer(page.address)
        try:
            viewer.size(*DESK)
            viewer.until(lambda: viewer.js('return Boolean(window.editor)'))
            drop_of(viewer, Path(scratch, 'building.yaml'), Path(scratch, 'building.png'))
            viewer.until(lambda: viewer.js('return Boolean(editor.place)'), 120.0)
            viewer.until(lambda: viewer.count('[data-kind=room]'), 60.0)
            viewer.js(
                'const list = document.querySelector("#list"); list.value = "room C1";'
                'list.dispatchEvent(new Event("change"))'
            )
            viewer.picture(Path(scratch, 'editor.png'), *DESK)
            smaller(Path(scratch, 'editor.png'), folder / 'building_editor.png')
        finally:
            viewer.close()
            page.stop()
            os.chdir(ROOT)


if __name__ == '__main__':
    main()
