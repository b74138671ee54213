"""A network that finds persons, read from TensorFlow's frozen graph and run by OpenCV.

SSDLite on MobileNetV2 (Liu and others, SSD, 2016; Sandler and others, MobileNetV2, 2018) looks at
300 by 300 pixels. On six grids it gives, for each of 1,917 anchors, how likely a person is there
and how the person's box differs from the anchor. Of the graph the layers with weights are kept.
What TensorFlow alone can run, preparing the picture, placing the anchors and reading the boxes, is
done here (TensorFlow's Object Detection API, box_coders/faster_rcnn_box_coder.py and
anchor_generators/multiple_grid_anchor_generator.py, with the values of ssdlite_mobilenet_v2_coco).
"""

from __future__ import annotations

import hashlib
import math
from collections.abc import Callable, Iterator
from pathlib import Path

import cv2
import numpy as np
from numpy.typing import NDArray

Picture = NDArray[np.uint8]
Boxes = NDArray[np.float64]
Network = Callable[[Picture], Boxes]
"""Takes a picture (rows, columns, 3) of BGR; returns (n, 5): how likely a person is, 0 to 1, and
the box's left, top, right and bottom as parts of the picture's width and height."""

SIDE = 300
"""Of what the network looks at, pixels: a picture of any proportions is squeezed into it."""
CELLS = (19, 10, 5, 3, 2, 1)
"""Of each grid, along a side."""
SCALES = (0.2, 0.35, 0.5, 0.65, 0.8, 0.95, 1.0)
"""Sides of the anchors of each grid, as parts of the picture's, and one more."""
LEAST = 0.05
"""Boxes that are less likely are left out."""
_INPUT = 'FeatureExtractor/MobilenetV2/MobilenetV2/input'
_BOXES, _CLASSES = 'BoxEncodingPredictor', 'ClassPredictor'
_STRUCTURE = '013446db1bff975a724d7eb9f31f66f1bace3ac4222bcafd3ffbcd7e135e1092'
"""SHA-256 of the layers' names, operations, inputs and lengths, without their weights. OpenCV ends
the process at a graph that it does not understand."""
_MOST_BYTES = 100_000_000
"""The file has 18 MB: what is larger by far is another one, and not read."""
_LONGEST_VARINT = 10
"""Bytes."""
_CENTRE_UNIT, _SIZE_UNIT = 10.0, 5.0
"""What the network tells is in tenths of the anchor's side, and in fifths of the size's log."""


def read_network(path: Path) -> Network:
    """Return the network of a frozen graph.

    Raises:
        ValueError: One line: the file cannot be read, or holds another network.
    """
    try:
        with path.open('rb') as file:
            content = file.read(_MOST_BYTES + 1)
        if len(content) > _MOST_BYTES:
            raise IndexError
        graph, structure = _layers(content)
    except OSError as error:
        raise ValueError(f'{path}: {error.strerror}') from None
    except (IndexError, UnicodeDecodeError):
        raise ValueError(f'{path}: expected a frozen graph of TensorFlow') from None
    if structure != _STRUCTURE:
        raise ValueError(f'{path}: expected the network ssdlite_mobilenet_v2 for one class')
    anchors = _anchors()
    network = cv2.dnn.readNetFromTensorflow(np.frombuffer(graph, np.uint8))
    # OpenCV 4 names an output after its last layer, OpenCV 5 after the one that took it in.
    outputs = [
        next(each for each in network.getUnconnectedOutLayersNames() if part in each)
        for kind in (_BOXES, _CLASSES)
        for part in (f'BoxPredictor_{grid}/{kind}/' for grid in range(len(CELLS)))
    ]

    def look(picture: Picture) -> Boxes:
        small = cv2.resize(picture, (SIDE, SIDE))
        mean = (127.5, 127.5, 127.5)
        network.setInput(cv2.dnn.blobFromImage(small, 1 / 127.5, (SIDE, SIDE), mean, swapRB=True))
        found = [np.asarray(each, float) for each in network.forward(outputs)]
        codes, classes = (
            np.concatenate([_rows(each, width) for each in some])
            for some, width in ((found[: len(CELLS)], 4), (found[len(CELLS) :], 2))
        )
        return _decoded(codes, classes[:, 1], anchors)

    return look


def _rows(grid: Boxes, width: int) -> Boxes:
    """Return what one grid tells (1, anchors * width, rows, columns) as a row for each anchor."""
    return np.asarray(grid[0].transpose(1, 2, 0).reshape(-1, width))


def _decoded(codes: Boxes, logits: Boxes, anchors: Boxes) -> Boxes:
    likely = 1.0 / (1.0 + np.exp(-np.clip(logits, -50.0, 50.0)))
    kept = np.flatnonzero(likely >= LEAST)
    code, anchor = codes[kept], anchors[kept]
    centres = anchor[:, :2] + code[:, :2] / _CENTRE_UNIT * anchor[:, 2:]
    halves = np.exp(np.clip(code[:, 2:] / _SIZE_UNIT, -10.0, 10.0)) * anchor[:, 2:] / 2.0
    low, high = centres - halves, centres + halves
    # Rows come before columns in the network's answer.
    return np.column_stack([likely[kept], low[:, 1], low[:, 0], high[:, 1], high[:, 0]])


def _anchors() -> Boxes:
    """Return the anchors (1917, 4): row and column of the middle, height, width, 0 to 1."""
    found = []
    for grid, cells in enumerate(CELLS):
        scale, between = SCALES[grid], math.sqrt(SCALES[grid] * SCALES[grid + 1])
        shapes = [(scale, ratio) for ratio in (1.0, 2.0, 0.5, 3.0, 1 / 3)] + [(between, 1.0)]
        if grid == 0:
            shapes = [(0.1, 1.0), (scale, 2.0), (scale, 0.5)]
        for row in range(cells):
            for column in range(cells):
                middle = (row + 0.5) / cells, (column + 0.5) / cells
                found += [
                    (*middle, side / math.sqrt(ratio), side * math.sqrt(ratio))
                    for side, ratio in shapes
                ]
    return np.array(found)


# --- the frozen graph: protocol buffers, GraphDef and NodeDef of TensorFlow ---


def _layers(graph: bytes) -> tuple[bytes, str]:
    """Return a graph with its layers alone and a picture as their input, and its structure.

    Raises:
        IndexError: It is cut off, or no graph.
        UnicodeDecodeError: It is no graph.
    """
    kept, structure = [_placeholder()], hashlib.sha256()
    for number, node in _fields(graph):
        if number != 1 or not isinstance(node, bytes):
            continue
        # Name, operation and inputs; then come the attributes, with the weights.
        texts = [
            (field, each.decode())
            for field, each in _fields(node)
            if field in (1, 2, 3) and isinstance(each, bytes)
        ]
        name = next((each for field, each in texts if field == 1), '')
        root, _, rest = name.partition('/')
        is_layer = root == 'FeatureExtractor' or (
            root.startswith('BoxPredictor_') and rest.startswith((_BOXES, _CLASSES))
        )
        if is_layer and name != _INPUT:
            kept.append(_field(1, node))
            structure.update(f'{texts} {len(node)}\n'.encode())
    return b''.join(kept), structure.hexdigest()


def _placeholder() -> bytes:
    """Return the node of the input: name, op, and the attributes dtype (float) and shape."""
    sides = b''.join(_field(2, b'\x08' + _varint(side)) for side in (1, SIDE, SIDE, 3))
    kind = _field(1, b'dtype') + _field(2, b'\x30\x01')
    shape = _field(1, b'shape') + _field(2, _field(7, sides))
    node = _field(1, _INPUT.encode()) + _field(2, b'Placeholder')
    return _field(1, node + _field(5, kind) + _field(5, shape))


def _fields(message: bytes) -> Iterator[tuple[int, bytes | int]]:
    """Yield the number and the value of each field of a message."""
    at = 0
    while at < len(message):
        key, at = _read_varint(message, at)
        kind = key & 7
        if key < 8:
            raise IndexError  # no field has the number 0
        if kind == 0:
            value, at = _read_varint(message, at)
            yield key >> 3, value
            continue
        if kind not in (1, 2, 5):
            raise IndexError
        length = {1: 8, 5: 4}.get(kind, 0)
        if kind == 2:
            length, at = _read_varint(message, at)
        if at + length > len(message):
            raise IndexError
        yield key >> 3, message[at : at + length]
        at += length


def _read_varint(message: bytes, at: int) -> tuple[int, int]:
    value = shift = 0
    while True:
        if shift >= 7 * _LONGEST_VARINT:
            raise IndexError
        byte = message[at]
        at += 1
        value |= (byte & 0x7F) << shift
        shift += 7
        if byte < 0x80:
            return value, at


def _varint(value: int) -> bytes:
    found = b''
    while value > 0x7F:
        found += bytes([value & 0x7F | 0x80])
        value >>= 7
    return found + bytes([value])


def _field(number: int, value: bytes) -> bytes:
    return _varint(number << 3 | 2) + _varint(len(value)) + value
