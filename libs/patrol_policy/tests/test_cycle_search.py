"""Each part of the search for a round, against a plain reference that looks at everything."""

from __future__ import annotations

import itertools
import math
import random
from collections import Counter
from dataclasses import replace

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from patrol_policy.battery import (
    WORTH_CHARGING,
    BatteryLimits,
    ChargeCurve,
    Charger,
    Draw,
    Energy,
)
from patrol_policy.cycle_search import (
    Breach,
    Cycle,
    CycleChanges,
    CycleSearch,
    filled,
    with_charges,
)
from patrol_policy.graph import PatrolGraph
from patrol_policy.rule_graph import RuleGraph

from .test_plan import grid
from .worlds import default_ranks, graphs, rule_graph_of


@st.composite
def rule_maps(
    draw: st.DrawFn, *, charging: bool = False, uneven: bool = False, most: int = 7
) -> RuleGraph:
    """Draw a map with rules, with stations that suffice or not, with thresholds that differ."""
    graph = draw(graphs(most=most))
    count = len(graph.places)
    ranks = draw(st.lists(st.integers(1, 3), min_size=count, max_size=count))
    threshold = graph.tour.length * draw(st.floats(0.05, 2.0))
    own: dict[int, float] = {}
    if uneven:
        own = draw(
            st.dictionaries(
                st.integers(0, count - 1), st.sampled_from([5.0, 50.0, 400.0, math.inf]), min_size=1
            )
        )
    energy = None
    if charging:
        stations = draw(st.sets(st.sampled_from(graph.places), min_size=1, max_size=2))
        energy = Energy(
            graph,
            [Charger(place, ChargeCurve.even(3.0), 1.5) for place in sorted(stations)],
            Draw(draw(st.floats(5.0, 90.0)) / graph.tour.length),
            0.0,
            BatteryLimits(0.0, 90.0, 5.0),
        )
    urgent = draw(st.sampled_from([0, 0, 2, 9]))
    return rule_graph_of(graph, threshold, ranks, urgent, own, energy)


def search_of(rules: RuleGraph, targets: tuple[int, ...]) -> CycleSearch:
    return CycleSearch(rules, [[targets]], rules.graph.tour.length)


def judged_by_walking(
    rules: RuleGraph, targets: tuple[int, ...], resting: set[int]
) -> tuple[float, float, list[tuple[int, int]], float]:
    """Walk a round again and again and return what the third lap comes to."""
    energy, count = rules.energy, rules.count
    stops = [
        (stop, number)
        for number, (before, target) in enumerate(
            zip((targets[-1], *targets[:-1]), targets, strict=True)
        )
        if target != before
        for stop in rules.path(before, target)
    ]
    charges = sum(stop >= count for stop, _ in stops)
    level = energy.full if energy else 100.0
    now, place = 0.0, rules.places[targets[-1]]
    seen = dict.fromkeys(range(count), -math.inf)
    longest, breaches, short, begun = 0.0, list[tuple[int, int]](), 0.0, 0.0
    for lap in range(3):
        longest, breaches, short, begun = 0.0, [], 0.0, now

        def rank(other: int) -> float:
            overdue = now - seen[other] > rules.table.limits[other] + 5e-4  # noqa: B023
            return (rules.table.urgent if overdue else rules.table.base)[other]

        for stop, number in stops:
            at = rules.places[stop]
            if stop >= count:
                assert energy is not None
                drive = energy.drive[stop - count][place]
                level -= energy.draw * drive
                short += max(0.0, -level)
                if charges > 1 and level > energy.full - WORTH_CHARGING:
                    short += level - (energy.full - WORTH_CHARGING)
                now += drive + energy.charge_seconds(stop - count, max(level, 0.0))
                level = energy.full
            else:
                own = min(rank(at), rules.table.urgent[at] if at in resting else math.inf)
                for other in rules.leg_seconds[place]:
                    if energy and not energy.within_range[other]:
                        continue
                    if rank(other) < own and lap:
                        breaches.append((number, other))
                        break
                now += rules.leg_seconds[place][at]
                if energy:
                    level -= energy.draw * rules.leg_seconds[place][at]
                    if charges:
                        short += max(0.0, energy.least[at] - level)
            longest = max(longest, now - seen[at] - rules.slack[at])
            seen[at] = now
            place = at
    return now - begun, longest, breaches, short / energy.draw if energy else 0.0


def check_judged(rules: RuleGraph, targets: tuple[int, ...]) -> None:
    search = search_of(rules, targets)
    found = search.judged(targets)
    lap = rules.graph.tour.length
    resting = {place for place, period in rules.held_periods.items() if period > 6.0 * lap}
    length, longest, breaches, short = judged_by_walking(rules, targets, resting)
    assert found.length == pytest.approx(length)
    assert found.short == pytest.approx(short, abs=1e-6)
    assert found.wait == pytest.approx(length if rules.is_even else longest, abs=1e-6)
    assert [(each.position, each.instead) for each in found.breaches] == breaches


def some_round(rules: RuleGraph, seed: int, more: int, charges: int) -> tuple[int, ...]:
    """Return all wanted places in some order, with some twice, and charges among them."""
    draw = random.Random(seed)
    targets = [*rules.wanted, *draw.choices(rules.wanted, k=more)]
    stations = range(rules.count, len(rules.places))
    targets += draw.choices(stations, k=charges) if stations else []
    draw.shuffle(targets)
    return tuple(targets)


@settings(max_examples=60)
@given(rule_maps(), st.integers(0, 10**6), st.integers(0, 3))
def test_a_round_is_judged_as_by_walking_it(rules: RuleGraph, seed: int, more: int) -> None:
    check_judged(rules, some_round(rules, seed, more, 0))


@settings(max_examples=60)
@given(rule_maps(uneven=True), st.integers(0, 10**6), st.integers(0, 3))
def test_a_round_of_places_with_own_thresholds_is_judged_as_by_walking_it(
    rules: RuleGraph, seed: int, more: int
) -> None:
    check_judged(rules, some_round(rules, seed, more, 0))


@settings(max_examples=80)
@given(rule_maps(charging=True), st.integers(0, 10**6), st.integers(0, 2), st.integers(1, 3))
def test_a_round_with_charges_is_judged_as_by_driving_it(
    rules: RuleGraph, seed: int, more: int, charges: int
) -> None:
    if rules.wanted:
        check_judged(rules, some_round(rules, seed, more, charges))


def test_a_round_costs_its_wait_and_more_for_what_is_forbidden_and_for_no_charge() -> None:
    graph = grid(3, 3)
    rules = rule_graph_of(graph, 10.0, default_ranks(graph), 0)
    search = search_of(rules, graph.tour.order)
    plain = Cycle(graph.tour.order, 70.0, 70.0)
    leg = rules.mean_leg
    assert search.cost(plain) == 70.0
    breach = search.judged(tuple(range(9))).breaches[0]
    assert search.cost(Cycle((), 70.0, 70.0, (breach, breach))) == pytest.approx(70.0 + 8.0 * leg)
    assert search.cost(Cycle((), 70.0, 70.0, (), leg)) == pytest.approx(70.0 + 24.0 * leg)
    # Nobody can visit a held place sooner than it is due: a shorter round is no better.
    ends = rule_graph_of(graph, 200.0, [*[2] * 4, 1, *[2] * 4], 0)
    assert search_of(ends, graph.tour.order).cost(plain) == ends.least_wait > 200.0


def lengths_known_beforehand(
    rules: RuleGraph, found: Cycle, change: str, seeds: range
) -> tuple[Counter[str], list[tuple[int, ...]]]:
    """Make the same changes with no limit, one just above and one just below the new length.

    What is longer than the limit is not made; a change whose length is not compared is counted.
    """
    kinds, made = Counter[str](), []
    for seed in seeds:

        def changed(limit: float) -> tuple[int, ...] | None:
            each = CycleChanges(rules, found, random.Random(seed))  # noqa: B023
            targets: tuple[int, ...] | None = getattr(each, change)(limit)
            return targets

        targets = changed(math.inf)
        if targets is None:
            kinds['none'] += 1
            assert changed(0.0) is None
            continue
        made.append(targets)
        length = rules.length(targets)
        assert changed(length + 1e-6) == targets
        below = changed(length - 1e-6)
        assert below in (None, targets)
        kinds['limited' if below is None else 'free'] += 1
    return kinds, made


def one_way(seed: int, count: int) -> PatrolGraph:
    """Return a ring with chords whose legs take other times back."""
    draw = random.Random(seed)
    legs: dict[str, dict[str, float]] = {f'P{number}': {} for number in range(count)}
    pairs = [(number, (number + 1) % count) for number in range(count)]
    pairs += [(number, (number + 3) % count) for number in range(count)]
    for one, other in pairs:
        legs[f'P{one}'][f'P{other}'] = draw.uniform(5.0, 20.0)
        legs[f'P{other}'][f'P{one}'] = draw.uniform(5.0, 20.0)
    return PatrolGraph(legs)


def test_how_long_a_changed_round_will_be_is_known_before_it_is_made() -> None:
    graph = one_way(1, 9)
    rules = rule_graph_of(graph, 100.0, [1] * 9, 0)
    found = search_of(rules, tuple(range(9))).judged((0, 4, 2, 3, 1, 5, 8, 7, 6))
    assert not found.breaches
    kinds, made = lengths_known_beforehand(rules, found, 'one', range(300))
    assert all(sorted(targets) == list(range(9)) for targets in made)
    # Only a stretch that stays where it is, or the whole round, is not compared.
    assert kinds['limited'] > 100
    assert kinds['free'] < 40
    # Each place is moved, and stretches of all lengths are turned round.
    moved = {
        place for targets in made for place in range(9) if targets[place] != found.targets[place]
    }
    assert moved == set(range(9))
    kinds, made = lengths_known_beforehand(rules, found, 'doubled', range(100))
    assert kinds == Counter(limited=100)
    assert all((Counter(targets) - Counter(range(9))).total() == 1 for targets in made)


def test_a_place_that_the_rules_demand_is_taken_along() -> None:
    graph = one_way(2, 9)
    rules = rule_graph_of(graph, 200.0, [1 + number % 3 for number in range(9)], 0)
    found = search_of(rules, tuple(range(9))).judged(tuple(range(9)))
    assert found.breaches
    _, made = lengths_known_beforehand(rules, found, 'one', range(200))
    taken = 0
    for targets in made:
        more = list((Counter(targets) - Counter(range(9))).elements())
        assert len(more) <= 1
        if more:
            # It stands before the target on the way to which it is demanded.
            pairs = {(targets[k], targets[(k + 1) % 10]) for k in range(10)}
            assert any(
                (each.instead, found.targets[each.position]) in pairs
                for each in found.breaches
                if each.instead == more[0]
            )
            taken += 1
    assert 10 < taken < 60


def test_a_visit_that_is_made_twice_is_left_out_again() -> None:
    graph = one_way(3, 6)
    rules = rule_graph_of(graph, 100.0, [1] * 6, 0)
    twice = (0, 1, 2, 0, 3, 4, 2, 5)
    found = search_of(rules, twice).judged(twice)
    fewer = set()
    for seed in range(300):
        targets = CycleChanges(rules, found, random.Random(seed)).one(math.inf)
        if targets is not None and len(targets) < len(twice):
            assert set(targets) == set(range(6))
            fewer.add(targets)
    assert fewer == {twice[:k] + twice[k + 1 :] for k in (0, 2, 3, 6)}


def with_stations(reach: float) -> RuleGraph:
    graph = one_way(4, 7)
    energy = Energy(
        graph,
        [Charger('P1', ChargeCurve.even(2.0)), Charger('P5', ChargeCurve.even(1.0))],
        Draw(90.0 / reach),
        0.0,
        BatteryLimits(0.0, 90.0, 5.0),
    )
    return rule_graph_of(graph, 50.0, [1] * 7, 0, energy=energy)


def test_charges_are_added_moved_and_left_out_but_for_the_last() -> None:
    rules = with_stations(300.0)
    one, both = (7, 0, 1, 2, 3, 4, 5, 6), (7, 0, 1, 2, 8, 3, 4, 5, 6)
    for targets in (one, both):
        found = search_of(rules, targets).judged(targets)
        places = [t for t in targets if t < 7]
        charges = Counter[int]()
        stops = set[int]()
        for seed in range(200):
            new = CycleChanges(rules, found, random.Random(seed)).charged()
            assert new is not None
            assert [t for t in new if t < 7] == places
            charges[len(new) - 7] += 1
            stops |= {t for t in new if t >= 7}
        before = len(targets) - 7
        # As often one more as one that is put elsewhere.
        assert charges.keys() == {before, before + 1}
        assert min(charges.values()) > 70
        assert stops == {7, 8}
    found = search_of(rules, one).judged(one)
    for seed in range(200):
        left = CycleChanges(rules, found, random.Random(seed)).one(math.inf)
        assert left is None or 7 in left
    found = search_of(rules, both).judged(both)
    fewer = [
        left
        for seed in range(200)
        if (left := CycleChanges(rules, found, random.Random(seed)).one(math.inf)) is not None
        and len(left) < len(both)
    ]
    assert {tuple(t for t in left if t >= 7) for left in fewer} >= {(7,), (8,)}


@settings(max_examples=60)
@given(st.integers(2, 9), st.integers(0, 10**6), st.floats(0.5, 6.0))
def test_a_round_is_filled_by_further_laps_until_it_is_long_enough(
    count: int, seed: int, factor: float
) -> None:
    draw = random.Random(seed)
    graph = one_way(seed, max(count, 4))
    count = len(graph.places)
    rules = rule_graph_of(graph, 100.0, [draw.choice((1, 1, 2)) for _ in range(count)], 0)
    targets = tuple(draw.sample(range(count), count))
    period = factor * rules.length(targets)
    made = filled(rules, targets, period)
    free = [target for target in targets if rules.gates[target] < 0]
    if len(free) < 2:
        assert made == targets
        return
    assert made[:count] == targets
    more = made[count:]
    assert rules.length(made) >= period - 1e-9
    assert not more or rules.length(made[:-1]) < period
    if not more:
        return
    # They keep to the order of the round, and begin with the nearest that is not where it ends.
    away = rules.away[targets[-1]]
    nearest = min(free, key=lambda place: away[place])
    first = free.index(nearest)
    order = itertools.cycle(free[first:] + free[:first])
    at = targets[-1]
    for target in more:
        after = next(order)
        if after == at:
            after = next(order)
        assert target == after
        at = target


@settings(max_examples=60)
@given(graphs(most=8), st.floats(30.0, 250.0), st.integers(0, 10**6))
def test_charges_are_put_only_where_the_charge_would_not_last(
    graph: PatrolGraph, reach: float, seed: int
) -> None:
    station = Charger(graph.places[0], ChargeCurve.even(2.0))
    energy = Energy(graph, [station], Draw(100.0 / reach), 0.0, BatteryLimits(0.0, 90.0, 5.0))
    rules = rule_graph_of(graph, 50.0, default_ranks(graph), 0, energy=energy)
    if len(rules.wanted) < 2:
        return
    targets = tuple(random.Random(seed).sample(rules.wanted, len(rules.wanted)))
    made = with_charges(rules, targets)
    places = [target for target in made if target < rules.count]
    begin = targets.index(places[0])
    assert places == [*targets[begin:], *targets[:begin]]
    home = energy.home_seconds
    assert home[places[0]] == min(home[place] for place in places)
    assert made[-1] >= rules.count

    def lacking(walk: tuple[int, ...]) -> bool:
        used, at = 0.0, walk[-1]
        for target in walk:
            used += rules.away[at][target]
            if target >= rules.count:
                used = 0.0
            # Straight from a charge nothing better can be done: there may be a place that is within
            # reach only by way of another one.
            elif at < rules.count and (
                energy.full - energy.draw * used < energy.least[target] - 1e-9
            ):
                return True
            at = target
        return False

    assert not lacking(made)
    for position, target in enumerate(made[:-1]):
        if target >= rules.count:
            assert lacking(made[:position] + made[position + 1 :])


def test_the_search_begins_with_the_best_of_each_group_and_is_finished_when_none_is_better() -> (
    None
):
    graph = grid(3, 3)
    rules = rule_graph_of(graph, 500.0, [1] * 9, 0)
    tour, worse = graph.tour.order, tuple(range(9))
    search = CycleSearch(rules, [[worse, tour], [worse]], graph.tour.length)
    assert search.begun == search.best
    assert search.best.length == pytest.approx(rules.length(tour))
    assert search.finished or search.best.length > graph.tour.length
    search = CycleSearch(rules, [[worse]], graph.tour.length)
    assert not search.finished
    search.improve(100_000.0)
    assert search.begun.length == pytest.approx(rules.length(worse))
    assert search.best.length <= 1.004 * graph.tour.length
    assert search.finished
    done = search.work
    search.improve(1000.0)
    assert search.work == done
    # Without any start it is a round of one place.
    assert CycleSearch(rules, [], graph.tour.length).best.targets == (0,)


def test_a_round_of_one_place_takes_no_time() -> None:
    rules = rule_graph_of(one_way(1, 5), 50.0, [1] * 5, 0)
    assert search_of(rules, (0, 1, 2, 3, 4)).judged((3,)) == Cycle((3,), 0.0, 0.0, (), 0.0)
    charged = with_stations(300.0)
    alone = search_of(charged, (7, 0, 1, 2, 3, 4, 5, 6)).judged((3,))
    assert (alone.length, alone.wait, alone.breaches, alone.short) == (0.0, 0.0, (), 0.0)
    # A round without any charge lacks all that it takes.
    rounds = search_of(charged, (7, 0, 1, 2, 3, 4, 5, 6))
    without = rounds.judged((0, 1, 2, 3, 4, 5, 6))
    assert without.short == pytest.approx(without.length) == charged.length(without.targets)


@settings(max_examples=30)
@given(rule_maps(uneven=True), st.integers(0, 10**6), st.floats(0.3, 1.5))
def test_a_round_is_judged_in_part_only_where_it_costs_more_than_the_limit(
    rules: RuleGraph, seed: int, part: float
) -> None:
    targets = some_round(rules, seed, 3, 0)
    search = search_of(rules, targets)
    whole = search.judged(targets)
    limit = part * search.cost(whole)
    judged = search.judged(targets, limit)
    if search.cost(whole) <= limit:
        assert judged == whole
    else:
        assert search.cost(judged) > limit - 1e-6
        assert whole.breaches[: len(judged.breaches)] == judged.breaches
        # One more than fits is enough to know.
        most = max(0.0, (limit - whole.wait) / (4.0 * rules.mean_leg))
        assert len(judged.breaches) <= math.floor(most) + 1


def test_work_is_counted_by_steps_and_tries() -> None:
    graph = one_way(3, 6)
    rules = rule_graph_of(graph, 100.0, [1] * 6, 0)
    search = search_of(rules, (0, 3, 1, 4, 2, 5))
    steps = sum(len(rules.path(a, b)) for a, b in itertools.pairwise((5, 0, 3, 1, 4, 2, 5)))
    assert search.work == pytest.approx(0.35 * steps)
    search.judged((0, 1, 2))
    more = sum(len(rules.path(a, b)) for a, b in itertools.pairwise((2, 0, 1, 2)))
    assert search.work == pytest.approx(0.35 * (steps + more))
    before = search.work
    search.improve(1.0)
    assert search.work >= before + 4.0


def test_a_search_ends_where_nothing_can_be_better() -> None:
    graph = one_way(3, 6)
    even = rule_graph_of(graph, 100.0, [1] * 6, 0)
    tour = graph.tour
    search = search_of(even, tour.order)
    assert search.finished, 'the shortest tour'
    best = search.best
    for wait, finished in ((1.0039, True), (1.0041, False)):
        length = wait * tour.length
        search.best = replace(best, length=length, wait=length)
        assert search.finished == finished
    search.best = replace(best, breaches=(Breach(0, 1),))
    assert not search.finished
    search.best = replace(best, short=0.1)
    assert not search.finished
    # Of three targets nothing can be changed, and a very long search finds no more.
    search.best = replace(best, targets=(0, 1, 2), short=0.1)
    assert search.finished
    search.best = replace(best, short=0.1)
    search.work = 10e6
    assert not search.finished
    search.work = 10e6 + 1.0
    assert search.finished
