"""What stands in a simulated place has the shape that lidar and camera are to see."""

from __future__ import annotations

import math

import numpy as np
import pytest

from floor_plans import PlaceError
from surveillance_simulation.world.things import (
    LIDAR_HEIGHT,
    Shape,
    Thing,
    barrel,
    box,
    boxes_of,
    chair,
    discs_of,
    robot,
)


def parts_at(thing: Thing, height: float) -> list[tuple[float, float, float, float]]:
    """Return what is at a height: middle x and y in the thing's frame, length, width."""
    return [
        (each.x, each.y, each.length, each.width)
        for each in thing.parts
        if each.bottom <= height < each.top
    ]


def test_a_chair_stands_on_four_legs_with_its_back_behind_it() -> None:
    thing = chair('c', 2.0, 3.0, math.pi / 2)
    legs = parts_at(thing, 0.0)
    assert sorted(leg[:2] for leg in legs) == [
        (-0.19, -0.19),
        (-0.19, 0.19),
        (0.19, -0.19),
        (0.19, 0.19),
    ]
    assert parts_at(thing, 0.44) == legs, 'they reach to the seat'
    ((x, y, length, width),) = parts_at(thing, 0.46)
    assert (x, y) == (0.0, 0.0)
    assert all(abs(a) + 0.025 <= side / 2 + 1e-9 for a in (0.19,) for side in (length, width))
    ((x, y, length, width),) = parts_at(thing, 0.9)
    assert (x, y) == (-0.2, 0.0)
    assert length < 0.1 < 0.4 < width
    assert max(each.top for each in thing.parts) == 0.95
    # Turned to the left: its back is in the south.
    discs = discs_of([thing])
    assert sorted(map(tuple, np.round(discs, 6))) == [
        (1.81, 2.81, 0.025),
        (1.81, 3.19, 0.025),
        (2.19, 2.81, 0.025),
        (2.19, 3.19, 0.025),
    ]
    assert len(boxes_of([thing])) == 0, 'the lidar looks below the seat'
    back = thing.parts[-1]
    assert thing.at(back) == pytest.approx((2.0, 2.8))


def test_the_lidar_meets_a_barrel_a_box_and_another_robot_where_they_are() -> None:
    things = [barrel('b', 1.0, 2.0, 0.3), robot('r', 4.0, 5.0, 0.2)]
    assert discs_of(things).tolist() == [[1.0, 2.0, 0.3], [4.0, 5.0, 0.2]]
    assert len(boxes_of(things)) == 0
    row = boxes_of([box('x', 1.0, 2.0, 0.5, 0.6, 0.4, 0.2)])
    assert row[0].tolist() == [1.0, 2.0, math.cos(0.5), math.sin(0.5), 0.3, 0.2]
    assert len(boxes_of([box('x', 1.0, 2.0, 0.5, 0.6, 0.4, LIDAR_HEIGHT - 0.01)])) == 0
    assert len(boxes_of([box('x', 1.0, 2.0, 0.5, 0.6, 0.4, LIDAR_HEIGHT)])) == 0
    assert len(discs_of([])) == len(boxes_of([])) == 0
    assert discs_of([]).shape == (0, 3)
    assert boxes_of([]).shape == (0, 6)


def test_another_robot_is_a_round_base_with_an_arm_upon_it() -> None:
    base, arm = robot('r', 0.0, 0.0, 0.2).parts
    assert (base.x, base.y, arm.x, arm.y) == (0.0, 0.0, 0.0, 0.0)
    assert base.length == base.width == 0.4
    assert arm.length == arm.width < base.length
    assert 0.0 < base.bottom < LIDAR_HEIGHT < base.top == arm.bottom < arm.top < 1.0
    assert {base.shape, arm.shape} == {Shape.CYLINDER}
    standing = barrel('b', 0.0, 0.0, 0.3).parts[0]
    assert (standing.bottom, standing.top, standing.length, standing.width) == (0.0, 0.8, 0.6, 0.6)
    carton = box('x', 0.0, 0.0, 0.0, 0.6, 0.4, 0.2).parts[0]
    assert (carton.x, carton.y, carton.bottom, carton.top) == (0.0, 0.0, 0.0, 0.2)


@pytest.mark.parametrize('size', [0.0099, 5.01, math.nan])
def test_what_is_too_small_or_too_large_is_named_with_the_bounds(size: float) -> None:
    with pytest.raises(PlaceError, match=r"obstacle 'b': radius .* expected 0\.01 to 5 m"):
        barrel('b', 0.0, 0.0, size)
    for number, word in enumerate(('length', 'width', 'height')):
        sides = [1.0, 1.0, 1.0]
        sides[number] = size
        with pytest.raises(PlaceError, match=rf"box 'x': {word} .* expected 0\.02 to 5 m"):
            box('x', 0.0, 0.0, 0.0, *sides)


def test_the_smallest_and_the_largest_are_taken() -> None:
    assert [barrel('b', 0.0, 0.0, each).parts[0].length for each in (0.01, 5.0)] == [0.02, 10.0]
    for side in (0.02, 5.0):
        assert box('x', 0.0, 0.0, 0.0, side, side, side).parts[0].top == side


def test_a_thing_needs_a_name_and_a_place() -> None:
    for make in (
        lambda name, x: barrel(name, x, 0.0, 0.3),
        lambda name, x: robot(name, 0.0, x, 0.3),
        lambda name, x: chair(name, 0.0, 0.0, x),
        lambda name, x: box(name, x, 0.0, 0.0, 1.0, 1.0, 1.0),
    ):
        assert make('n', 1.0).name == 'n'
        with pytest.raises(PlaceError, match="'': expected a name"):
            make('', 1.0)
        with pytest.raises(PlaceError, match=r"'n' at .*: expected two numbers in metres"):
            make('n', math.inf)
    with pytest.raises(PlaceError, match=r'^obstacle '):
        barrel('', 0.0, 0.0, 0.3)
    with pytest.raises(PlaceError, match=r'^chair '):
        chair('', 0.0, 0.0, 0.0)
