"""Networks behind one interface: what runs them, what is wrong with a file, how fast they are."""

from __future__ import annotations

import importlib
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from indoor_watch import detectors, onnx_network
from indoor_watch.detectors import Detector, Threshold, described, load_detector


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
