"""The families of ONNX files: known by the shapes of their outputs, read to the same box."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from indoor_watch import onnx_network

SIDE = 64
CELLS = 64 + 16 + 4
PICTURE = np.zeros((48, 96, 3), np.uint8)
"""Shown in a square of 64 as 64 by 32."""
TRUTH = [0.25, 0.5, 0.75, 1.0]
"""The person's left, top, right and bottom as parts of the picture."""
CENTRE, SIZE = (32.0, 24.0), (32.0, 16.0)
"""The same in the square, pixels."""


def yolox() -> list[np.ndarray]:
    found = np.zeros((1, CELLS, 5 + 80), np.float32)
    cell = 64 + 1 * 4 + 2  # of 16 pixels: the second row, the third column
    found[0, cell, :2] = CENTRE[0] / 16 - 2, CENTRE[1] / 16 - 1
    found[0, cell, 2:4] = np.log(np.array(SIZE) / 16)
    found[0, cell, 4:6] = 0.9, 0.8
    return [found]


def yolo5() -> list[np.ndarray]:
    found = np.zeros((1, 3 * CELLS, 5 + 80), np.float32)
    found[0, 100, :6] = *CENTRE, *SIZE, 0.9, 0.8
    return [found]


def yolo8() -> list[np.ndarray]:
    found = np.zeros((1, 4 + 20, CELLS), np.float32)
    found[0, :5, 30] = *CENTRE, *SIZE, 0.72
    return [found]


def ended() -> list[np.ndarray]:
    found = np.zeros((1, 300, 6), np.float32)
    found[0, 7] = 16, 16, 48, 32, 0.72, 0
    found[0, 8] = 16, 16, 48, 32, 0.99, 16  # a dog
    return [found]


def rf_detr() -> list[np.ndarray]:
    boxes, logits = np.zeros((1, 300, 4), np.float32), np.full((1, 300, 91), -9.0, np.float32)
    boxes[0, 5] = 0.5, 0.75, 0.5, 0.5
    logits[0, 5, 1] = np.log(0.72 / 0.28)
    return [boxes, logits]


@pytest.mark.parametrize('family', [yolox, yolo5, yolo8, ended, rf_detr])
def test_each_family_is_known_by_its_shapes_and_gives_the_same_box(family: Any) -> None:
    shown = []

    def run(blob: np.ndarray) -> list[np.ndarray]:
        shown.append(blob)
        return family()

    look = onnx_network._network(run, SIDE)
    found = look(PICTURE)
    assert found == pytest.approx(np.array([[0.72, *TRUTH]]), abs=1e-4)
    assert shown[-1].shape == (1, 3, SIDE, SIDE)
    assert shown[-1].dtype == np.float32


def test_numbers_that_are_none_make_no_box() -> None:
    found = yolox()
    found[0][0, :40] = np.nan
    found[0][0, 40:60] = 1e30
    boxes = onnx_network._network(lambda _: [each.copy() for each in found], SIDE)(PICTURE)
    assert np.isfinite(boxes).all()


@pytest.mark.parametrize('shapes', [[(1, 10)], [(1, 5, 7)], [(1, 3, 4), (1, 4, 91)], [(1, 1000)]])
def test_a_network_of_something_else_is_refused_in_one_line(shapes: list[Any]) -> None:
    with pytest.raises(ValueError, match=r'^outputs of .*expected those of YOLOX') as caught:
        onnx_network._network(lambda _: [np.zeros(each, np.float32) for each in shapes], SIDE)
    assert '\n' not in str(caught.value)
