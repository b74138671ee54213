"""A network that finds persons, read from an ONNX file and run by OpenCV or onnxruntime.

The families that export one network for all their users differ in how a picture goes in and boxes
come out. Which one it is the shapes of the outputs tell:

| family | outputs | picture | boxes |
|---|---|---|---|
| YOLOX (Ge and others, 2021) | (1, n, 5 + classes) | BGR, 0 to 255 | in cells |
| YOLOv5 | (1, 3 n, 5 + classes) | RGB, 0 to 1 | in pixels |
| YOLOv8 and later | (1, 4 + classes, n) | RGB, 0 to 1 | in pixels |
| end to end, as YOLOv10 | (1, m, 6): corners, score, class | RGB, 0 to 1 | in pixels |
| RF-DETR | (1, m, 4), (1, m, classes) | RGB, by ImageNet's mean | as parts |

n are the cells of 8, 16 and 32 pixels. A person is the first class of the YOLO families, and number
1 of RF-DETR, as COCO counts. Others are refused in one line.
"""

from __future__ import annotations

import importlib
from collections.abc import Callable
from pathlib import Path
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from indoor_watch.ssd_network import Boxes, Network, Picture

Array = NDArray[np.float32]
Run = Callable[[Array], list[Array]]

RUNTIMES = ('auto', 'opencv', 'onnxruntime')
MOST_BYTES = 1_000_000_000
STRIDES = (8, 16, 32)
"""Pixels of a cell, of the YOLO families."""
PAD = 114
"""Grey around a picture that is not square, as these networks were trained."""
LEAST = 0.05
"""Boxes that are less likely are left out."""
SIDE = 640
"""Of what a network looks at that takes any size, pixels."""
MEAN, DEVIATION = (0.485, 0.456, 0.406), (0.229, 0.224, 0.225)
"""ImageNet's, of RGB from 0 to 1."""
INSTALL = 'pip install onnxruntime'


def read_onnx(path: Path, runtime: str = 'auto') -> tuple[Network, str]:
    """Return the network of an ONNX file, and what runs it.

    Args:
        path: The file.
        runtime: Of `RUNTIMES`; auto: OpenCV, or onnxruntime where OpenCV cannot read it.

    Raises:
        ValueError: One line: the file cannot be read, or is of no family that is known; or
            onnxruntime is not installed.
    """
    try:
        with path.open('rb') as file:
            content = file.read(MOST_BYTES + 1)
    except OSError as error:
        raise ValueError(f'{path}: {error.strerror}') from None
    if not content or len(content) > MOST_BYTES:
        raise ValueError(f'{path}: expected an ONNX file of at most {MOST_BYTES // 10**6} MB')
    made = {'opencv': _by_opencv, 'onnxruntime': _by_onnxruntime}
    problems = []
    for name in made if runtime == 'auto' else [runtime]:
        try:
            run, side = made[name](content)
            return _network(run, side), {'opencv': 'OpenCV'}.get(name, name)
        except ValueError as error:
            problems.append(f'{name}: {error}')
    raise ValueError(f'{path}: {"; ".join(problems)}')


def _by_opencv(content: bytes) -> tuple[Run, int]:
    try:
        network = cv2.dnn.readNetFromONNX(np.frombuffer(content, np.uint8))
        names = network.getUnconnectedOutLayersNames()
    except cv2.error:
        raise ValueError('cannot read it') from None

    def run(blob: Array) -> list[Array]:
        network.setInput(blob)
        return [np.asarray(each, np.float32) for each in network.forward(names)]

    # OpenCV tells no input's size: the first of the usual ones that goes through.
    for side in (SIDE, 416, 320, 512, 560, 384, 576, 704):
        try:
            run(np.zeros((1, 3, side, side), np.float32))
        except cv2.error:
            continue
        return run, side
    raise ValueError('takes no picture of 320 to 704 pixels')


def _by_onnxruntime(content: bytes) -> tuple[Run, int]:
    try:
        runtime: Any = importlib.import_module('onnxruntime')
    except ImportError:
        raise ValueError(f'not installed; {INSTALL}') from None
    options = runtime.SessionOptions()
    options.intra_op_num_threads = 1  # other nodes run beside it
    options.log_severity_level = 3
    try:
        session = runtime.InferenceSession(content, options, providers=['CPUExecutionProvider'])
    except Exception as error:  # its errors have no common class
        raise ValueError(f'cannot read it ({str(error).splitlines()[0][:80]})') from None
    inputs = session.get_inputs()
    given = inputs[0].shape[-1] if len(inputs) == 1 and len(inputs[0].shape) == 4 else None
    if given is None:
        raise ValueError('takes something else than one picture')
    side = given if isinstance(given, int) else SIDE
    name = inputs[0].name

    def run(blob: Array) -> list[Array]:
        return [np.asarray(each, np.float32) for each in session.run(None, {name: blob})]

    return run, side


def _network(run: Run, side: int) -> Network:
    """Return the network of a family; the shapes of its outputs tell which one.

    Raises:
        ValueError: It is of none.
    """
    shapes = [each.shape for each in run(np.zeros((1, 3, side, side), np.float32))]
    cells = sum((side // stride) ** 2 for stride in STRIDES)
    if len(shapes) == 1 and len(shapes[0]) == 3:
        _, rows, columns = shapes[0]
        if rows == cells and columns > 5:
            grid = _grid(side)
            return _letterboxed(run, side, lambda found: _yolox(found[0][0], grid), scale=1.0)
        if rows == 3 * cells and columns > 5:
            return _letterboxed(run, side, lambda found: _yolo5(found[0][0]), scale=1 / 255)
        if columns == cells and rows > 4:
            return _letterboxed(run, side, lambda found: _yolo8(found[0][0]), scale=1 / 255)
        if columns == 6:
            return _letterboxed(run, side, lambda found: _ended(found[0][0]), scale=1 / 255)
    if len(shapes) == 2 and all(len(each) == 3 for each in shapes):
        of_boxes = next((n for n, each in enumerate(shapes) if each[2] == 4), None)
        if of_boxes is not None and shapes[0][1] == shapes[1][1]:
            return _squeezed(run, side, of_boxes)
    told = ', '.join(str(each) for each in shapes)
    raise ValueError(f'outputs of {told}: expected those of YOLOX, YOLO or RF-DETR')


def _letterboxed(
    run: Run, side: int, read: Callable[[list[Array]], Boxes], *, scale: float
) -> Network:
    """Return a network that sees a picture in a square, as large as fits, in the corner."""

    def look(picture: Picture) -> Boxes:
        rows, columns = picture.shape[:2]
        shrink = side / max(rows, columns)
        size = max(1, round(columns * shrink)), max(1, round(rows * shrink))
        way = cv2.INTER_AREA if shrink < 1 else cv2.INTER_LINEAR
        square = np.full((side, side, 3), PAD, np.uint8)
        square[: size[1], : size[0]] = cv2.resize(picture, size, interpolation=way)
        if scale != 1.0:
            square = square[:, :, ::-1]
        found = read(run(np.float32(scale) * square.transpose(2, 0, 1)[None].astype(np.float32)))
        found[:, 1:] /= np.array([columns, rows, columns, rows]) * shrink
        return found

    return look


def _squeezed(run: Run, side: int, of_boxes: int) -> Network:
    """Return a network that sees a picture of any proportions as a square."""

    def look(picture: Picture) -> Boxes:
        small = cv2.resize(picture, (side, side))[:, :, ::-1].astype(np.float32) / 255.0
        blob = ((small - MEAN) / DEVIATION).transpose(2, 0, 1)[None].astype(np.float32)
        found = run(np.ascontiguousarray(blob))
        boxes, logits = found[of_boxes][0], found[1 - of_boxes][0]
        likely = 1.0 / (1.0 + np.exp(-np.clip(logits[:, 1], -50.0, 50.0)))
        return _boxes(likely, boxes)

    return look


def _grid(side: int) -> Array:
    """Return column, row and stride of each cell, (n, 3)."""
    found = []
    for stride in STRIDES:
        rows, columns = np.mgrid[: side // stride, : side // stride]
        strides = np.full(rows.size, stride)
        found.append(np.stack([columns.ravel(), rows.ravel(), strides], axis=1))
    return np.concatenate(found).astype(np.float32)


def _yolox(rows: Array, grid: Array) -> Boxes:
    """Read middle and log of the size in cells, that something is there, and that it is of a class.

    As demo/ONNXRuntime of YOLOX does.
    """
    stride = grid[:, 2:]
    middle = (np.clip(rows[:, :2], -1e4, 1e4) + grid[:, :2]) * stride
    size = np.exp(np.minimum(rows[:, 2:4], 20.0)) * stride
    sure = np.clip(rows[:, 4:6], 0.0, 1.0)
    return _boxes(sure[:, 0] * sure[:, 1], np.concatenate([middle, size], axis=1))


def _yolo5(rows: Array) -> Boxes:
    return _boxes(rows[:, 4] * rows[:, 5], rows[:, :4])


def _yolo8(columns: Array) -> Boxes:
    return _boxes(columns[4], columns[:4].T)


def _ended(rows: Array) -> Boxes:
    persons = rows[np.round(rows[:, 5]) == 0]
    low, high = persons[:, :2], persons[:, 2:4]
    return _boxes(persons[:, 4], np.concatenate([(low + high) / 2, high - low], axis=1))


def _boxes(likely: NDArray[Any], boxes: NDArray[Any]) -> Boxes:
    """Return (n, 5): score, left, top, right, bottom, of middles and sizes (n, 4)."""
    kept = np.flatnonzero(np.isfinite(boxes).all(axis=1) & (likely >= LEAST))
    middle, half = boxes[kept, :2], boxes[kept, 2:] / 2
    sure = np.minimum(likely[kept], 1.0)
    return np.column_stack([sure, middle - half, middle + half]).astype(np.float64)
