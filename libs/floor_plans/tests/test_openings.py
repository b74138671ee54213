"""Lines along which a map may be cut: which there are, and how they are drawn."""

from __future__ import annotations

import math

import cv2
import numpy as np
import pytest

from floor_plans.map_rooms import (
    openings,
)


def test_cuts_are_drawn_without_gaps_and_share_out_their_length() -> None:
    cut = openings.Cut(np.array([2.0, 3.0]), np.array([10.0, 7.0]), 9.5)
    weights = openings.drawn([cut], (12, 14))
    rows, columns = np.nonzero(weights)
    assert sorted(set(columns.tolist())) == list(range(2, 11))
    assert (np.abs(rows - (3 + (columns - 2) / 2)) <= 0.51).all()
    assert weights[rows, columns] == pytest.approx(9.5 / 9.0)
    # 4-connected neighbours on both sides do not meet through it.
    free = (weights == 0).astype(np.uint8)
    free[:3], free[8:], free[:, :2], free[:, 11:] = 0, 0, 0, 0
    assert cv2.connectedComponents(free, connectivity=4)[0] == 3
    off = openings.Cut(np.array([-3.0, 5.0]), np.array([20.0, 5.0]), 23.0)
    assert np.count_nonzero(openings.drawn([off], (12, 14))) == 14


def test_of_cuts_with_the_same_ends_the_shortest_is_kept() -> None:
    def cut(x1: float, y1: float, x2: float, y2: float, length: float) -> openings.Cut:
        return openings.Cut(np.array([x1, y1]), np.array([x2, y2]), length)

    first, turned = cut(0, 0, 20, 0, 20.0), cut(20, 6, 0, 6.9, 19.0)
    apart, near_one = cut(0, 8, 20, 8, 20.5), cut(0, 0, 20, 14, 24.0)
    kept = openings.without_doubles([first, turned, apart, near_one])
    assert kept == [turned, near_one]
    assert openings.without_doubles([first, near_one]) == [first, near_one]
    assert openings.without_doubles([]) == []


def test_a_passage_is_cut_across_where_it_is_narrowest() -> None:
    free = np.zeros((40, 60), np.bool_)
    free[5:35, 2:28] = free[5:35, 32:58] = True
    free[15:25, 28:32] = True
    (cut,) = openings.saddle_cuts(free, [(19, 30, 5.0)])
    assert cut.narrow
    assert sorted([cut.start[1], cut.end[1]]) == [14.0, 25.0]
    assert abs(cut.start[0] - 30) <= 2
    assert cut.length == pytest.approx(math.dist(cut.start, cut.end))
    assert openings.saddle_cuts(np.ones((40, 60), np.bool_), [(19, 30, 5.0)]) == []
