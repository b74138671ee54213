"""Right of way: one robot on each narrow way, one in each narrow block, and nobody stuck."""

from __future__ import annotations

import random

import pytest

from patrol_policy.fleet import Intention, Layout, may_be_contested, right_of_way

STAR = {
    'R1': ['C1'],
    'R2': ['C1'],
    'R3': ['C2'],
    'C1': ['R1', 'R2', 'C2'],
    'C2': ['R3', 'C1'],
}


def test_of_two_at_one_door_the_older_wish_goes_first() -> None:
    layout = Layout.of(STAR, ())
    wishes = [Intention('b', 'R1', 'C1', 5.0), Intention('a', 'C1', 'R1', 7.0)]
    assert right_of_way(wishes, 'b', STAR, layout).go
    told = right_of_way(wishes, 'a', STAR, layout)
    assert not told.go
    assert told.because == 'b goes first on the way C1 - R1'
    moving = [Intention('b', 'R1', 'C1', 9.0, is_moving=True), wishes[1]]
    assert right_of_way(moving, 'a', STAR, layout).because == 'b is on the way C1 - R1'


def test_in_a_wide_door_nobody_waits() -> None:
    layout = Layout.of(STAR, ['C1 R1'])
    wishes = [Intention('b', 'R1', 'C1', 5.0, is_moving=True), Intention('a', 'C1', 'R1', 7.0)]
    assert right_of_way(wishes, 'a', STAR, layout).go


def test_who_only_stays_in_a_narrow_place_leaves_for_one_who_wants_it() -> None:
    layout = Layout.of(['C1', 'C2'], ())
    wishes = [Intention('a', 'R1'), Intention('b', 'C1', 'R1', 3.0)]
    told = right_of_way(wishes, 'a', STAR, layout)
    assert (told.go, told.place) == (True, 'C1')
    assert told.because == 'b wants to R1, and R1 is narrow'
    assert right_of_way(wishes, 'b', STAR, layout).because == 'R1 is narrow, and a is in R1'
    charging = [Intention('a', 'R1', is_fixed=True), wishes[1]]
    assert right_of_way(charging, 'a', STAR, layout).place == 'R1'


def test_a_robot_without_an_intention_is_named() -> None:
    with pytest.raises(ValueError, match='c has no intention'):
        right_of_way([Intention('a', 'R1')], 'c', STAR, Layout())


WIDE_DOORS = Layout.of(['C1', 'C2'], ['C1 R1', 'C1 C2'])


def test_into_a_narrow_place_goes_one_at_a_time() -> None:
    me = Intention('a', 'C1', 'R1', 5.0)

    def why(other: Intention) -> str:
        told = right_of_way([me, other], 'a', STAR, WIDE_DOORS)
        assert told.go == (not told.because)
        assert told.place == 'R1'
        assert told.other == ('' if told.go else 'b')
        return told.because

    assert why(Intention('b', 'R1')) == 'R1 is narrow, and b is in R1'
    moving = Intention('b', 'C1', 'R1', 9.0, is_moving=True)
    assert why(moving) == 'R1 is narrow, and b is on its way to R1'
    first = 'b goes first to R1, where there is room for one'
    assert why(Intention('b', 'C1', 'R1', 4.0)) == first
    assert why(Intention('b', 'C1', 'R1', 6.0)) == ''
    # Of two that have wished for as long the first by name goes.
    assert why(Intention('b', 'C1', 'R1', 5.0)) == ''
    swapped = right_of_way([me, Intention('A', 'C1', 'R1', 5.0)], 'a', STAR, WIDE_DOORS)
    assert swapped.other == 'A'
    assert why(Intention('b', 'C1', 'R1', 4.0, is_fixed=True)) == ''
    assert why(Intention('b', 'C1', 'R2', 4.0, is_moving=True)) == ''
    # Where it is wide there is room for all.
    into_wide = [Intention('a', 'C1', 'C2', 5.0), Intention('b', 'C2', 'C1', 4.0)]
    assert right_of_way(into_wide, 'a', STAR, WIDE_DOORS).go


SIDING = {'W': ['N1'], 'N1': ['W', 'N2'], 'N2': ['N1', 'N3'], 'N3': ['N2']}
"""A wide place, and three narrow ones in a row behind it."""


def test_two_that_begin_in_one_block_leave_it_one_after_the_other() -> None:
    layout = Layout.of(['W'], ['W N1', 'N1 N2', 'N2 N3'])
    behind, ahead = Intention('a', 'N2', 'N1', 5.0), Intention('b', 'N1', 'W', 9.0)
    told = right_of_way([behind, ahead], 'a', SIDING, layout)
    assert (told.go, told.because) == (False, 'b leaves N1 first')
    assert right_of_way([behind, ahead], 'b', SIDING, layout).go
    farther = Intention('b', 'N3', 'N2', 1.0)
    assert right_of_way([behind, farther], 'a', SIDING, layout).go
    driving = Intention('b', 'N3', 'N2', 9.0, is_moving=True)
    assert right_of_way([behind, driving], 'a', SIDING, layout).because == 'b leaves N3 first'
    fixed = Intention('b', 'N1', '', 1.0, is_fixed=True)
    assert right_of_way([behind, fixed], 'a', SIDING, layout).go
    beside = Intention('b', 'N2', 'N1', 4.0)
    assert right_of_way([behind, beside], 'a', SIDING, layout).other == 'b'
    assert right_of_way([behind, Intention('b', 'N2', 'N1', 6.0)], 'a', SIDING, layout).go


def test_who_leaves_a_block_goes_before_who_wants_in() -> None:
    layout = Layout.of(['W'], ())
    out, into = Intention('a', 'N1', 'W', 9.0), Intention('b', 'W', 'N1', 1.0)
    assert right_of_way([out, into], 'a', SIDING, layout).go
    told = right_of_way([out, into], 'b', SIDING, layout)
    assert told.because == 'a goes first on the way W - N1'
    # Who stays inside gives way to the first that wants in, by the way to the wide place.
    stays = Intention('c', 'N3')
    told = right_of_way([stays, into, Intention('a', 'W', 'N1', 0.5)], 'c', SIDING, layout)
    assert (told.go, told.place, told.other) == (True, 'N2', 'a')
    assert told.because == 'a wants to N1, and N3 is narrow'
    assert right_of_way([stays, Intention('b', 'N2', 'N1', 1.0)], 'c', SIDING, layout).place == 'N3'
    # Where there is no wide place nobody can give way.
    told = right_of_way([stays, into], 'c', SIDING, Layout())
    assert (told.place, told.because) == ('N3', '')


def test_what_may_be_contested_is_a_narrow_way_or_block_that_another_robot_is_beside() -> None:
    def contested(me: Intention, other: Intention, layout: Layout) -> bool:
        return may_be_contested([me, other], me.robot, STAR, layout)

    wide = Layout.of(['C1', 'C2', 'R3'], ['C1 R1', 'C1 C2'])
    me = Intention('a', 'C1', 'R1')
    assert contested(me, Intention('b', 'C1'), wide)
    assert contested(me, Intention('b', 'R1'), wide)
    assert contested(me, Intention('b', 'C2', 'C1'), wide)
    assert not contested(me, Intention('b', 'C2'), wide)
    assert not contested(me, Intention('b', 'R2'), wide)
    through = Intention('a', 'C1', 'C2')
    assert not contested(through, Intention('b', 'C2'), wide)
    narrow = Layout.of(['C1', 'C2', 'R3'], ())
    assert contested(through, Intention('b', 'C2'), narrow)
    assert contested(through, Intention('b', 'R3', 'C2'), narrow)
    assert not contested(through, Intention('b', 'R3'), narrow)
    assert not contested(Intention('a', 'C1'), Intention('b', 'C1'), narrow)
    assert not may_be_contested([Intention('b', 'C1')], 'a', STAR, narrow)


def tree(rng: random.Random, count: int) -> dict[str, list[str]]:
    neighbours: dict[str, list[str]] = {'p0': []}
    for number in range(1, count):
        other = f'p{rng.randrange(number)}'
        neighbours[f'p{number}'] = [other]
        neighbours[other].append(f'p{number}')
    return neighbours


def way(neighbours: dict[str, list[str]], start: str, goal: str) -> str:
    """Return the first step of the only way in a tree."""
    seen, queue = {start}, [(start, '')]
    for at, first in queue:
        if at == goal:
            return first
        for other in neighbours[at]:
            if other not in seen:
                seen.add(other)
                queue.append((other, first or other))
    raise AssertionError(goal)


@pytest.mark.parametrize('seed', range(30))
def test_on_random_trees_everybody_reaches_every_goal(seed: int) -> None:
    rng = random.Random(seed)
    neighbours = tree(rng, rng.randrange(4, 12))
    places = sorted(neighbours)
    wide = {place for place in places if rng.random() < 0.4} | {'p0'}
    layout = Layout.of(wide, ())
    names = ['a', 'b', 'c', 'd'][: rng.randrange(2, 5)]
    at = {name: rng.choice(sorted(wide)) for name in names}
    goal = {name: at[name] for name in names}
    since = dict.fromkeys(names, 0.0)
    moving: dict[str, tuple[str, float]] = {}
    reached = dict.fromkeys(names, 0)
    stays = dict.fromkeys(names, 0.0)
    for step in range(3000):
        now = float(step)
        for name, (to, until) in list(moving.items()):
            if until <= now:
                at[name] = to
                del moving[name]
        for name in rng.sample(names, len(names)):
            if name in moving:
                continue
            if at[name] == goal[name]:
                if now < stays[name]:
                    pass
                else:
                    reached[name] += 1
                    goal[name], since[name] = rng.choice(places), now
                    stays[name] = now + rng.randrange(20)

            def intention(each: str) -> Intention:
                if each in moving:
                    return Intention(each, at[each], moving[each][0], since[each], is_moving=True)
                heading = '' if at[each] == goal[each] else way(neighbours, at[each], goal[each])
                return Intention(each, at[each], heading, since[each])

            told = right_of_way([intention(each) for each in names], name, neighbours, layout)
            if told.go and told.place != at[name]:
                moving[name] = (told.place, now + rng.randrange(1, 6))
        passages = [frozenset((at[name], to)) for name, (to, _) in moving.items()]
        assert len(passages) == len(set(passages)), 'two on one narrow way'
        narrow = [at[name] for name in names if at[name] not in wide]
        assert len(narrow) == len(set(narrow)), 'two in one narrow place'
    assert min(reached.values()) > 20


def test_where_nobody_may_object_nobody_does_whatever_the_others_want() -> None:
    rng = random.Random(5)
    free = 0
    for _ in range(300):
        neighbours = tree(rng, 9)
        places = sorted(neighbours)
        layout = Layout.of(rng.sample(places, 5), ())
        starts = rng.sample(places, 3)
        me = Intention('a', starts[0], rng.choice(neighbours[starts[0]]), 5.0)
        known = [Intention(name, at) for name, at in zip('bc', starts[1:], strict=True)]
        told = right_of_way([me, *known], 'a', neighbours, layout)
        if may_be_contested([me, *known], 'a', neighbours, layout) or not told.go:
            continue
        free += 1
        for wanted in [(x, y) for x in neighbours[starts[1]] for y in neighbours[starts[2]]]:
            others = [
                Intention(each.robot, each.place, to, 1.0)
                for each, to in zip(known, wanted, strict=True)
            ]
            assert right_of_way([me, *others], 'a', neighbours, layout).go
    assert free > 30
