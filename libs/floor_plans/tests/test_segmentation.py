"""The numbers of the rooms of a map."""

from __future__ import annotations

import math

import numpy as np

from floor_plans import Grid
from floor_plans.map_rooms import (
    Segmentation,
)
from floor_plans.map_rooms.segmentation import spread


def test_rooms_that_are_joined_are_numbered_without_a_gap() -> None:
    labels = np.array([[1, 1, 2, 3], [1, 0, 4, 4]], np.int32)
    grid = Grid(np.zeros((2, 4), np.int8), 0.05)
    found = Segmentation(labels, 4, frozenset({2, 4}), grid, labels)
    both = found.joined(3, 1)
    assert both.labels.tolist() == [[1, 1, 2, 1], [1, 0, 3, 3]]
    assert (both.rooms, both.corridors) == (3, {2, 3})
    assert both.working_labels.tolist() == both.labels.tolist()
    assert found.joined(4, 2).corridors == {2}, 'the larger one is long'
    assert found.joined(1, 2).corridors == {3}, 'the smaller one was'


def test_cells_without_a_room_get_that_of_the_nearest() -> None:
    labels = np.zeros((9, 12), np.int32)
    labels[1, 1], labels[7, 10] = 5, 2
    found = spread(labels)
    for row, column in np.ndindex(9, 12):
        one, other = math.dist((row, column), (1, 1)), math.dist((row, column), (7, 10))
        if abs(one - other) > 0.3:
            assert found[row, column] == (5 if one < other else 2)
    assert (spread(np.zeros((3, 3), np.int32)) == 0).all()
