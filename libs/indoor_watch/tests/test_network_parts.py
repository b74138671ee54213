"""The parts of the network that finds persons: anchors, boxes, and the bytes of its graph."""

from __future__ import annotations

import math

import numpy as np
import pytest

from indoor_watch import ssd_network as ssd


def test_anchors_are_those_of_tensorflows_configuration() -> None:
    anchors = ssd._anchors()
    assert anchors.shape == (1917, 4)
    # ssdlite_mobilenet_v2_coco: scales from 0.2 to 0.95 in six steps, aspect ratios 1, 2, 1/2, 3,
    # 1/3 and one between this scale and the next; three smaller ones on the first grid.
    first = 3 * 19 * 19
    assert anchors[0] == pytest.approx([0.5 / 19, 0.5 / 19, 0.1, 0.1])
    assert anchors[1] == pytest.approx([0.5 / 19, 0.5 / 19, 0.2 / 2**0.5, 0.2 * 2**0.5])
    assert anchors[2] == pytest.approx([0.5 / 19, 0.5 / 19, 0.2 * 2**0.5, 0.2 / 2**0.5])
    assert anchors[3][:2] == pytest.approx([0.5 / 19, 1.5 / 19]), 'along a row first'
    assert anchors[3 * 19][:2] == pytest.approx([1.5 / 19, 0.5 / 19])
    at = first
    for grid, cells in enumerate((10, 5, 3, 2, 1), 1):
        scale = 0.2 + 0.15 * grid
        after = 1.0 if grid == 5 else scale + 0.15
        ratios = (1.0, 2.0, 0.5, 3.0, 1 / 3)
        shapes = [(scale / math.sqrt(r), scale * math.sqrt(r)) for r in ratios]
        shapes.append((math.sqrt(scale * after),) * 2)
        part = anchors[at : at + 6 * cells * cells].reshape(cells, cells, 6, 4)
        for row, column in np.ndindex(cells, cells):
            middle = (row + 0.5) / cells, (column + 0.5) / cells
            expected = np.array([(*middle, *shape) for shape in shapes])
            assert part[row, column] == pytest.approx(expected)
        at += 6 * cells * cells
    assert at == 1917


def test_boxes_are_read_as_the_box_coder_wrote_them() -> None:
    anchors = np.array([[0.5, 0.4, 0.2, 0.1], [0.5, 0.5, 0.3, 0.3], [0.1, 0.9, 0.2, 0.2]])
    truth = np.array([[0.3, 0.35, 0.6, 0.45], [0.1, 0.2, 0.5, 0.9], [0.0, 0.8, 0.3, 1.1]])
    low, high = truth[:, :2], truth[:, 2:]
    centre, size = (low + high) / 2, high - low
    # faster_rcnn_box_coder.py: 10 * (centre - anchor) / anchor, 5 * log(size / anchor).
    codes = np.column_stack(
        [10 * (centre - anchors[:, :2]) / anchors[:, 2:], 5 * np.log(size / anchors[:, 2:])]
    )
    logits = np.array([2.0, -3.0, -2.9])
    found = ssd._decoded(codes, logits, anchors)
    likely = 1 / (1 + np.exp(-logits))
    kept = likely >= 0.05
    assert kept.tolist() == [True, False, True]
    assert found[:, 0] == pytest.approx(likely[kept])
    assert found[:, 1:] == pytest.approx(truth[kept][:, [1, 0, 3, 2]])
    assert ssd._decoded(codes, np.full(3, 1e9), anchors)[:, 0] == pytest.approx(1.0)
    huge = ssd._decoded(np.full((3, 4), 1e9), np.zeros(3), anchors)
    assert np.isfinite(huge).all()
    assert ssd._decoded(codes, np.full(3, -9.0), anchors).shape == (0, 5)


def test_what_a_grid_tells_is_a_row_for_each_anchor() -> None:
    grid = np.arange(2 * 3 * 4 * 5, dtype=float).reshape(1, 6, 4, 5)
    rows = ssd._rows(grid, 3)
    assert rows.shape == (40, 3)
    assert rows[0].tolist() == grid[0, :3, 0, 0].tolist()
    assert rows[1].tolist() == grid[0, 3:, 0, 0].tolist()
    assert rows[2].tolist() == grid[0, :3, 0, 1].tolist()
    assert rows[-1].tolist() == grid[0, 3:, 3, 4].tolist()


@pytest.mark.parametrize(
    ('value', 'content'),
    # From the description of protocol buffers' encoding, and the ends of one and two bytes.
    [(1, '01'), (150, '9601'), (300, 'ac02'), (127, '7f'), (128, '8001'), (16384, '808001')],
)
def test_numbers_are_written_and_read_as_protocol_buffers_do(value: int, content: str) -> None:
    assert ssd._varint(value).hex() == content
    assert ssd._read_varint(b'\x55' + bytes.fromhex(content) + b'\x01', 1) == (
        value,
        1 + len(content) // 2,
    )


def test_a_number_that_has_no_end_is_refused() -> None:
    for message in (b'\xff' * 10 + b'\x01', b'\x80', b''):
        with pytest.raises(IndexError):
            ssd._read_varint(message, 0)
    assert ssd._read_varint(b'\x80' * 9 + b'\x01', 0) == (1 << 63, 10)


def test_fields_are_read_in_turn_and_others_passed_over() -> None:
    message = (
        ssd._field(2, b'testing')
        + bytes.fromhex('089601')  # field 1: 150
        + b'\x1d' + bytes(4)  # field 3, four bytes
        + b'\x21' + bytes(8)  # field 4, eight bytes
    )  # fmt: skip
    assert message[:2].hex() == '1207'
    assert list(ssd._fields(message)) == [(2, b'testing'), (1, 150), (3, bytes(4)), (4, bytes(8))]
    for broken in (message[:-1], b'\x13', b'\x14', b'\x07', b'\x12\x05abc', b'\x00\x01'):
        with pytest.raises(IndexError):
            list(ssd._fields(broken))
    assert list(ssd._fields(b'')) == []


def test_of_a_graph_the_layers_are_kept_and_the_rest_is_not() -> None:
    def node(name: str, *inputs: str) -> bytes:
        texts = (ssd._field(number, text.encode()) for number, text in ((1, name), (2, 'Conv2D')))
        return b''.join([*texts, *(ssd._field(3, each.encode()) for each in inputs)])

    layers = [
        node('FeatureExtractor/MobilenetV2/Conv/Conv2D', 'input'),
        node('BoxPredictor_0/BoxEncodingPredictor/Conv2D', 'a', 'b'),
        node('BoxPredictor_5/ClassPredictor/Conv2D'),
    ]
    others = [
        node('Postprocessor/scale'),
        node('BoxPredictor_0/Reshape'),
        node('FeatureExtractor/MobilenetV2/MobilenetV2/input'),
        node('Preprocessor/map'),
    ]
    graph = b''.join(ssd._field(1, each) for each in [*layers, *others]) + ssd._field(
        4, b'\x08\x01'
    )
    kept, structure = ssd._layers(graph)
    found = [content for number, content in ssd._fields(kept) if number == 1]
    assert found[1:] == layers
    assert isinstance(found[0], bytes)
    fields = list(ssd._fields(found[0]))
    assert fields[:2] == [
        (1, b'FeatureExtractor/MobilenetV2/MobilenetV2/input'),
        (2, b'Placeholder'),
    ]
    # Attributes: the type is float, the shape 1 by 300 by 300 by 3.
    assert [(number, each.hex()) for number, each in fields[2:] if isinstance(each, bytes)] == [
        (5, '0a05647479706512023001'),
        (5, '0a0573686170651214' + '3a12' + '12020801' + '120308ac02' * 2 + '12020803'),
    ]
    assert ssd._layers(graph)[1] == structure
    swapped = b''.join(ssd._field(1, each) for each in [*layers[::-1], *others])
    assert ssd._layers(swapped)[1] != structure
    assert ssd._layers(b''.join(ssd._field(1, each) for each in layers))[1] == structure
