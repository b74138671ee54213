"""Networks behind one interface: families of ONNX files, what runs them, what is said of them."""

from __future__ import annotations

import importlib
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from indoor_watch import detectors, onnx_network
from indoor_watch.detectors import Detector, Threshold, described, load_detector

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


@pytest.mark.parametrize('content', [b'', b'no network', b'\xff' * 5000, b'\x08\x07'])
@pytest.mark.parametrize('runtime', onnx_network.RUNTIMES)
def test_a_file_that_is_no_network_is_one_line(
    tmp_path: Path, content: bytes, runtime: str
) -> None:
    path = tmp_path / 'mine.onnx'
    path.write_bytes(content)
    with pytest.raises(ValueError, match=r'^person_weights .*mine\.onnx: ') as caught:
        load_detector(str(path), runtime)
    assert '\n' not in str(caught.value)


def test_a_runtime_that_is_not_installed_is_named_with_its_command(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    path = tmp_path / 'mine.onnx'
    path.write_bytes(b'x')
    known = importlib.import_module

    def missing(name: str, package: str | None = None) -> Any:
        if name == 'onnxruntime':
            raise ImportError(name)
        return known(name, package)

    monkeypatch.setattr(importlib, 'import_module', missing)
    with pytest.raises(ValueError, match='onnxruntime: not installed; pip install onnxruntime'):
        load_detector(str(path), 'onnxruntime')


def test_what_runs_and_how_fast_is_one_line(monkeypatch: pytest.MonkeyPatch) -> None:
    detector = Detector(
        'mine.onnx (OpenCV)', lambda _: np.zeros((0, 5)), Threshold(0.6, 0.8), Threshold(0.2, 0.3)
    )
    monkeypatch.setattr(detectors, 'load_detector', lambda weights, runtime: detector)
    ticks = iter([1.0, 1.3])
    said = described('mine.onnx', clock=lambda: next(ticks))
    assert said == 'persons: mine.onnx (OpenCV), 100 ms a picture'


def test_scores_become_how_often_they_are_right() -> None:
    nothing = Threshold(0.0, 0.0)
    plain = Detector('a', lambda _: np.zeros((0, 5)), nothing, nothing)
    assert plain.confidence(0.7) == 0.7
    fitted = Detector('b', plain.look, nothing, nothing, 0.0, ((0.2, 0.1), (0.6, 0.9), (0.9, 0.98)))
    assert fitted.confidence(0.4) == pytest.approx(0.5)
    assert fitted.confidence(0.1) == pytest.approx(0.1)
    assert fitted.confidence(1.0) == pytest.approx(0.98)
