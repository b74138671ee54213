"""The values of one individual in a model: which there must be, how many, and whether they fit."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from itertools import combinations

from owl_reasoner.reasoner.datatypes import Value
from owl_reasoner.reasoner.hypertableau.dl_clauses import ValueCount
from owl_reasoner.reasoner.hypertableau.model import (
    CaseModel,
    Choices,
    ClashError,
    Either,
    Has,
    In,
    Same,
    total,
)
from owl_reasoner.reasoner.value_sets import point


class CaseValues:
    """Applies the rules about data properties.

    Args:
        model: Where the values are.
        either: Takes what is open.

    Attributes:
        gaps: What was not decided.
        waiting: Individuals for whom no value is made yet that must exist: known ones come first.
    """

    def __init__(self, model: CaseModel, either: Either) -> None:
        self._model, self._rules, self._either = model, model.rules, either
        self._made: dict[tuple[int, int], bool] = {}
        self.gaps: dict[str, None] = {}
        self.waiting: set[int] = set()

    def check(self, x: int) -> None:
        """Apply all rules to an individual's values."""
        model, rules, labels = self._model, self._rules, self._model.labels[x]
        if x not in self.waiting:
            for concept in rules.values_at_least.keys() & labels.keys():
                self._need(x, concept, rules.values_at_least[concept])
        for v in tuple(model.values[x]):
            self._apply_rules(x, v)
        self._join_known(x)
        # What rules made of the values may add concepts, and these further values: counting waits
        # for them.
        if model.queue:
            model.revalue[x] = None
            return
        for limit in rules.functional_values:
            self._limit(x, limit, 0)
        for concept in rules.values_at_most.keys() & labels.keys():
            self._limit(x, rules.values_at_most[concept], labels[concept])
        self._assign(x)

    def _need(self, x: int, concept: int, needed: ValueCount) -> None:
        model = self._model
        choices = model.labels[x][concept]
        if needed.n == 1:
            for v in model.values[x]:
                if needed.prop in model.props[v] and model.sets[v][0].within(needed.values):
                    return
        elif (x, concept) in self._made:
            return
        model.put(self._made, (x, concept), True)
        values = needed.values & self._rules.range_of(needed.prop)
        if values.size < needed.n:
            raise ClashError(choices)
        # The whole set: which values they are is known, and no case is left.
        if values.size == needed.n:
            for value in values.members():
                model.value(x, needed.prop, point(value), choices)
            return
        made = [model.value(x, needed.prop, values, choices) for _ in range(needed.n)]
        if len(made) > 1:
            model.differ(made, choices)

    def _apply_rules(self, x: int, v: int) -> None:
        model = self._model
        model.step()
        labels, props = model.labels[x], model.props[v]
        for prop, choices in tuple(props.items()):
            for other in self._rules.disjoint_props.get(prop, ()):
                if other in props:
                    raise ClashError(choices | props[other])
            for rule in self._rules.by_prop.get(prop, ()):
                more = total(rule.xs, labels)
                if more is None or any(concept in labels for _, concept in rule.heads):
                    continue
                values, others = model.sets[v]
                if values.is_empty:
                    raise ClashError(others)
                if (values & rule.values).is_empty:
                    continue
                heads = [Has(x, head) for _, head in rule.heads]
                if (values & rule.rest).is_empty:
                    self._either([*heads], choices | more | others)
                elif not heads:
                    model.narrow(v, rule.rest, choices | more)
                else:
                    self._either([In(v, rule.rest), *heads], choices | more)

    def _join_known(self, x: int) -> None:
        """Make one of the values that are the same."""
        model = self._model
        known: dict[Value, int] = {}
        for v in tuple(model.values[x]):
            values, choices = model.sets[v]
            if values.is_empty:
                raise ClashError(choices)
            if not values.decided:
                self.gaps.update(self._rules.tested)
            only = values.only
            if only is None:
                continue
            first = known.setdefault(only, v)
            if first != v:
                model.same(first, v, choices | model.sets[first][1])

    def _limit(self, x: int, limit: ValueCount, choices: Choices) -> None:
        model = self._model
        counted: list[int] = []
        unsure: list[int] = []
        for v in model.values[x]:
            if limit.prop in model.props[v]:
                values = model.sets[v][0]
                if values.within(limit.values):
                    counted.append(v)
                elif not (values & limit.values).is_empty:
                    unsure.append(v)
        if len(counted) + len(unsure) <= limit.n:
            return
        # Whether it counts is a case of its own: stated first, the count is then certain in each
        # case.
        for v in unsure:
            self._either([In(v, ~limit.values), In(v, limit.values)], 0)
        if len(counted) <= limit.n:
            return
        # The smallest sets first: known values, of which two are seen to differ without a choice.
        counted.sort(key=lambda v: (model.sets[v][0].size, v))
        chosen = counted[: limit.n + 1]
        for v in chosen:
            choices |= model.props[v][limit.prop] | model.sets[v][1]
        pairs: list[Same] = []
        for v, w in combinations(chosen, 2):
            apart = model.different(v, w)
            if apart is not None:
                choices |= apart
            elif not (model.sets[v][0] & model.sets[w][0]).is_empty:
                pairs.append(Same(v, w))
        self._either([*pairs], choices)

    def _assign(self, x: int) -> None:
        """Tell whether values that differ can be chosen from small sets."""
        model, there = self._model, self._model.values[x]
        others = {
            v: [w for w in there if w != v and model.different(v, w) is not None]
            for v in there
            if model.sets[v][0].size < len(there)
        }
        # Only a set no larger than the values to differ from can run out: strings and numbers
        # without end never do.
        small = [v for v, found in others.items() if model.sets[v][0].size <= len(found)]
        for group in _joined(small, others):
            if not self._have_values(group, others):
                choices = 0
                for v in group:
                    choices |= model.sets[v][1] | model.differences(v)
                raise ClashError(choices)

    def _have_values(self, group: list[int], others: dict[int, list[int]]) -> bool:
        """Tell whether each of a group can have a value that no other it differs from has."""
        sets = self._model.sets
        members = {v: tuple(sets[v][0].members()) for v in group}
        # All different from each other: a matching, in polynomial time. In general it is the
        # colouring of a graph, so it branches, the smallest sets first.
        if all(len(set(others[v]) & members.keys()) == len(group) - 1 for v in group):
            return _all_matched(members)
        group.sort(key=lambda v: len(members[v]))
        chosen: dict[int, Value] = {}

        def extend(place: int) -> bool:
            self._model.step()
            if place == len(group):
                return True
            v = group[place]
            taken = {chosen[w] for w in others[v] if w in chosen}
            for value in members[v]:
                if value not in taken:
                    chosen[v] = value
                    if extend(place + 1):
                        return True
                    del chosen[v]
            return False

        return extend(0)


def _joined(values: list[int], others: dict[int, list[int]]) -> Iterator[list[int]]:
    """Give the groups of values that are linked by differences."""
    left = dict.fromkeys(values)
    while left:
        group = [left.popitem()[0]]
        for v in group:  # Grows on the way.
            for w in others[v]:
                if w in left:
                    del left[w]
                    group.append(w)
        yield group


def _all_matched(members: Mapping[int, Sequence[Value]]) -> bool:
    """Tell whether all can have different values: a bipartite matching by augmenting paths."""
    owner: dict[Value, int] = {}

    def place(v: int, tried: set[Value]) -> bool:
        free = next((value for value in members[v] if value not in owner), None)
        if free is not None:
            owner[free] = v
            return True
        for value in members[v]:
            if value not in tried:
                tried.add(value)
                if place(owner[value], tried):
                    owner[value] = v
                    return True
        return False

    return all(place(v, set()) for v in members)
