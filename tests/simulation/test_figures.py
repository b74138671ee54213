"""What a simulated person looks like."""

from __future__ import annotations

from collections import defaultdict
from typing import Any

import numpy as np
import pytest

from surveillance_simulation.world.figures import person
from surveillance_simulation.world.things import Shape

SHOE, TROUSERS, SHIRT, SKIN = (44, 38, 36), (58, 68, 104), (150, 62, 60), (214, 168, 138)
HAIR, EYE, LIP = (58, 42, 32), (46, 36, 32), (160, 92, 84)
OUTLINE = [
    # Height, how far it reaches back, ahead and to each side, what of it is seen there.
    (0.01, 0.285, 0.385, 0.158, {SHOE}),
    (0.06, 0.285, 0.385, 0.158, {SHOE, TROUSERS}),
    (0.16, 0.216, 0.216, 0.159, {TROUSERS}),
    (0.26, 0.205, 0.194, 0.167, {TROUSERS}),
    (0.36, 0.190, 0.174, 0.171, {TROUSERS}),
    (0.46, 0.157, 0.155, 0.166, {TROUSERS}),
    (0.56, 0.140, 0.140, 0.172, {TROUSERS}),
    (0.66, 0.130, 0.130, 0.176, {TROUSERS}),
    (0.76, 0.193, 0.288, 0.286, {TROUSERS, SKIN}),
    (0.86, 0.172, 0.248, 0.294, {TROUSERS, SKIN}),
    (0.91, 0.161, 0.219, 0.297, {TROUSERS, SKIN}),
    (0.96, 0.158, 0.206, 0.298, {SHIRT, SKIN}),
    (1.06, 0.144, 0.155, 0.298, {SHIRT, SKIN}),
    (1.16, 0.139, 0.121, 0.293, {SHIRT, SKIN}),
    (1.26, 0.111, 0.124, 0.281, {SHIRT}),
    (1.36, 0.105, 0.106, 0.263, {SHIRT}),
    (1.41, 0.085, 0.085, 0.249, {SHIRT}),
    (1.46, 0.065, 0.065, 0.120, {SHIRT, SKIN}),
    (1.51, 0.049, 0.088, 0.056, {SKIN}),
    (1.565, 0.094, 0.107, 0.067, {SKIN, HAIR, LIP}),
    (1.61, 0.100, 0.1245, 0.081, {SKIN, HAIR}),
    (1.64, 0.101, 0.108, 0.083, {SKIN, HAIR, EYE}),
    (1.66, 0.101, 0.108, 0.083, {SKIN, HAIR, EYE}),
    (1.70, 0.092, 0.101, 0.080, {SKIN, HAIR}),
    (1.74, 0.0575, 0.0585, 0.051, {HAIR}),
]


def test_a_person_has_the_outline_of_one_in_mid_step() -> None:
    parts = person('p', 0.0, 0.0, 0.0).parts
    assert min(each.bottom for each in parts) == 0.0
    assert max(each.top for each in parts) == pytest.approx(1.75)
    for height, back, ahead, side, colours in OUTLINE:
        there = [each for each in parts if each.bottom <= height < each.top]
        assert {each.colour for each in there} == colours, height
        assert -min(e.x - e.length / 2 for e in there) == pytest.approx(back, abs=4e-3), height
        assert max(e.x + e.length / 2 for e in there) == pytest.approx(ahead, abs=4e-3), height
        for reach in (
            -min(e.y - e.width / 2 for e in there),
            max(e.y + e.width / 2 for e in there),
        ):
            assert reach == pytest.approx(side, abs=4e-3), height
    face = [(e.y, e.width, e.bottom) for e in parts if e.shape == Shape.BOX and e.bottom > 1.5]
    assert sorted(face) == sorted((-y, *rest) for y, *rest in face), 'two like halves'
    # The left foot is ahead, and the right hand.
    left_shoe = next(each for each in parts if each.colour == SHOE and each.y > 0)
    assert (left_shoe.x, left_shoe.y) == (0.25, 0.11)
    hands = {each.y > 0: each.x for each in parts if each.colour == SKIN and each.bottom < 0.76}
    assert hands[False] > 0.2 > 0.0 > -0.1 > hands[True]


def test_a_person_is_made_of_slices_that_lie_on_each_other() -> None:
    parts = person('p', 0.0, 0.0, 0.0).parts
    slices = [each for each in parts if each.shape == Shape.ELLIPSE]
    assert len(slices) == 146
    stacks: dict[Any, list[Any]] = defaultdict(list)
    for each in slices:
        stacks[each.colour, np.sign(each.y)].append(each)
    for stack in stacks.values():
        for below in stack:
            assert 0.01 < below.top - below.bottom < 0.051
            top = max(each.top for each in stack)
            assert below.top > top - 0.2 or any(
                each.bottom <= below.top + 1e-9 < each.top for each in stack
            ), 'no gap'
    # What the lidar meets: two shanks, where it looks for legs.
    cut = [each for each in parts if each.is_cut]
    assert sorted((round(e.x, 2), round(e.y, 2)) for e in cut) == [(-0.16, -0.11), (0.16, 0.11)]
    assert all(0.09 < (each.length + each.width) / 2 < 0.12 for each in cut)
