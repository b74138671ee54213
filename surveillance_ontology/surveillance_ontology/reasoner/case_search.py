"""Searches a model by cases: the hypertableau calculus.

A model grows from named individuals: rules add concepts, related individuals and values; where a
rule has several heads, one is tried after the other. Every fact carries the choices it depends on,
a bit for each, so that a contradiction goes back to the last choice that took part in it. Unnamed
individuals that look like an earlier one need no successors of their own (anywhere blocking), which
ends the search. Source: Motik, Shearer and Horrocks, "Hypertableau reasoning for description
logics", Journal of Artificial Intelligence Research 36 (2009). Facts without choices are entailed.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from itertools import combinations, count
from typing import Any, TypeAlias

from surveillance_ontology.reasoner.case_rules import (
    FRESH,
    CaseRules,
    Count,
    EdgeRule,
    Heads,
    ValueCount,
)
from surveillance_ontology.reasoner.clauses import StoppedError
from surveillance_ontology.reasoner.datatypes import Value
from surveillance_ontology.reasoner.value_sets import ValueSet, point

Choices: TypeAlias = int
"""The choices that a fact depends on: bit n for the choice of level n."""
Alternative: TypeAlias = tuple[Any, ...]
"""('concept', x, concept), ('same', x, y), ('root', y, key), ('narrow', v, values) or
('same value', v, w)."""
_MISSING = object()


class _ClashError(Exception):
    """A contradiction; `choices` are those it depends on."""

    def __init__(self, choices: Choices) -> None:
        self.choices = choices


class _Choice:
    """A disjunction that is being tried."""

    __slots__ = ('alternatives', 'choices', 'mark', 'place', 'stated')

    def __init__(self, mark: int, alternatives: tuple[Alternative, ...], choices: Choices) -> None:
        self.mark, self.alternatives, self.place = mark, alternatives, 0
        self.stated = self.choices = choices


class CaseSearch:
    """A model in the making.

    Args:
        rules: What must hold.
        most_steps: After so many added facts the search ends.

    Attributes:
        labels: The concepts of each individual, with the choices they depend on.
        out: For each individual the related ones, and by which roles.
        names: The IRIs of named individuals.
        values: The values of each individual.
        gaps: What was not decided.
        depends: Whether the last contradiction rests on choices that are held.
    """

    def __init__(self, rules: CaseRules, most_steps: int) -> None:
        self.rules, self._most_steps, self.steps = rules, most_steps, 0
        self.labels: dict[int, dict[int, Choices]] = {}
        self.out: dict[int, dict[int, dict[int, Choices]]] = {}
        self.names: dict[int, tuple[str, ...]] = {}
        self._parent: dict[int, int | None] = {}
        self._children: dict[int, dict[int, None]] = {}
        self._groups: dict[int, dict[int, Choices]] = {}
        self._limits: dict[int, dict[int, Choices]] = {}
        self._needs: dict[int, dict[int, Choices]] = {}
        self._gone: dict[int, tuple[int | None, Choices]] = {}
        self._introduced: dict[Any, int] = {}
        self.values: dict[int, dict[int, None]] = {}
        self.value_props: dict[int, dict[str, Choices]] = {}
        self.value_sets: dict[int, tuple[ValueSet, Choices]] = {}
        self._value_groups: dict[int, dict[int, Choices]] = {}
        self._value_gone: dict[int, tuple[int, Choices]] = {}
        self._value_owner: dict[int, int] = {}
        self._made: dict[tuple[int, int], bool] = {}
        self._pending: dict[int, tuple[tuple[Alternative, ...], Choices]] = {}
        self._pending_ends = {'first': 0, 'end': 0}
        self._stated: dict[tuple[Alternative, ...], bool] = {}
        self._individuals: dict[str, int] = {}
        self._numbers = count(1)
        self._trail: list[tuple[dict[Any, Any], Any, Any]] = []
        self._stack: list[_Choice] = []
        self._held = 0
        self.depends = False
        self._queue: list[tuple[int, ...]] = []
        self._recount: dict[int, None] = {}
        self._revalue: dict[int, None] = {}
        self.gaps: dict[str, None] = {}
        self._functional: dict[int, list[Count]] = {}
        for limit in rules.functional:
            self._functional.setdefault(limit.role, []).append(limit)
        self._failures: dict[int, int] = {}
        self._index_size = -1
        self._fillers: dict[int, list[int]] = {}
        self._pairwise = True
        self.blocked: dict[int, int] = {}

    # --- changes that can be taken back ---

    def _put(self, table: dict[Any, Any], key: Any, value: Any) -> None:
        self._trail.append((table, key, table.get(key, _MISSING)))
        table[key] = value

    def _drop(self, table: dict[Any, Any], key: Any) -> None:
        if key in table:
            self._trail.append((table, key, table.pop(key)))

    def mark(self) -> int:
        """Return a state to come back to."""
        return len(self._trail)

    def undo(self, mark: int) -> None:
        """Go back to a state."""
        self._undo(mark)
        while self._stack and self._stack[-1].mark >= mark:
            self._stack.pop()
        self._held = min(self._held, len(self._stack))
        self._forget()

    def hold(self) -> None:
        """Keep to the choices of the model that was found, until `undo` takes them back."""
        self._held = len(self._stack)

    def _undo(self, mark: int) -> None:
        trail = self._trail
        while len(trail) > mark:
            table, key, value = trail.pop()
            if value is _MISSING:
                del table[key]
            else:
                table[key] = value

    def _forget(self) -> None:
        self._queue.clear()
        self._recount.clear()
        self._revalue.clear()

    # --- individuals ---

    def individual(self, iri: str) -> int:
        """Return the individual of a name."""
        known = self._individuals.get(iri)
        if known is None:
            known = self._new(None)
            self._put(self._individuals, iri, known)
            if not iri.startswith(FRESH):
                self._put(self.names, known, (iri,))
            self.concept(known, self.rules.nominal(iri), 0)
        return self.find(known)[0] or known

    def choices_of(self, iri: str) -> Choices:
        """Return what it depends on that `individual` stands for the name."""
        known = self._individuals[iri]
        return self.find(known)[1]

    def somebody(self) -> int:
        """Return an individual of which nothing is known."""
        return self._new(None)

    def _new(self, parent: int | None) -> int:
        self._step()
        x = next(self._numbers)
        tables: tuple[dict[int, Any], ...] = (
            self.labels,
            self.out,
            self._groups,
            self._limits,
            self._needs,
            self.values,
            self._children,
        )
        for table in tables:
            self._put(table, x, {})
        self._put(self._parent, x, parent)
        self._put(self.names, x, ())
        if parent is not None:
            self._put(self._children[parent], x, None)
        for heads in self.rules.always:
            self._one_of(heads, x, x, 0)
        return x

    def _step(self) -> None:
        self.steps += 1
        if self.steps > self._most_steps:
            raise StoppedError

    def find(self, x: int) -> tuple[int | None, Choices]:
        """Return who stands for an individual now (None: nobody), and by which choices."""
        choices = 0
        current: int | None = x
        while current is not None and current in self._gone:
            current, more = self._gone[current]
            choices |= more
        return current, choices

    def alive(self) -> Iterator[int]:
        """Return every individual that is there, in the order they came."""
        return (x for x in self.labels if x not in self._gone)

    # --- facts ---

    def concept(self, x: int, concept: int, choices: Choices) -> None:
        """State that an individual has a concept."""
        labels = self.labels[x]
        if concept and concept not in labels:
            self._step()
            self._put(labels, concept, choices)
            self._queue.append((x, concept))

    def relate(self, x: int, role: int, y: int, choices: Choices) -> None:
        """State that an individual is related to another one."""
        there = self.out[x].get(y)
        if there is None:
            there = {}
            self._put(self.out[x], y, there)
            back = there
            if x != y:
                back = {}
                self._put(self.out[y], x, back)
        else:
            back = self.out[y][x]
        for one in self.rules.roles_above(role):
            if one not in there:
                self._put(there, one, choices)
                self._put(back, -one, choices)
                self._queue.append((x, one, y))

    def value(self, x: int, prop: str, values: ValueSet, choices: Choices) -> int:
        """State that an individual has some value of a set by a data property."""
        v = next(self._numbers)
        self._put(self.values[x], v, None)
        self._put(self.value_props, v, dict.fromkeys(self.rules.data_above(prop), choices))
        self._put(self.value_sets, v, (values, choices))
        self._put(self._value_groups, v, {})
        self._put(self._value_owner, v, x)
        self._revalue[x] = None
        return v

    def state_value(self, x: int, prop: str, value: Value) -> None:
        """State that an individual has a value."""
        self.value(x, prop, point(value), 0)

    def differ(self, individuals: Iterable[int], choices: Choices = 0) -> None:
        """State that no two of the individuals are the same."""
        group = next(self._numbers)
        for x in individuals:
            if group in self._groups[x]:
                raise _ClashError(choices)
            self._put(self._groups[x], group, choices)

    def same(self, x: int, y: int, choices: Choices = 0) -> None:
        """State that two individuals are the same."""
        found, more = self.find(x)
        other, others = self.find(y)
        if found is None or other is None or found == other:
            return
        self._merge(found, other, choices | more | others)

    def _different(self, x: int, y: int) -> Choices | None:
        """Return the choices by which two individuals differ; None where they are not known to."""
        mine, theirs = self._groups[x], self._groups[y]
        found: Choices | None = None
        for group, choices in mine.items():
            if group in theirs:
                both = choices | theirs[group]
                if not both:
                    return 0
                found = both if found is None else min(found, both)
        return found

    # --- the search ---

    def solve(self) -> bool:
        """Tell whether there is a model; the tables then hold it."""
        self._prepare()
        while True:
            try:
                self._saturate()
                if self._branch() or self._keys() or self._expand():
                    continue
                return True
            except _ClashError as clash:
                if not self._go_back(clash.choices):
                    return False

    def attempt(self, state: Callable[[], None]) -> bool:
        """State something; False where that is a contradiction at once."""
        try:
            state()
        except _ClashError as clash:
            self.depends = bool(clash.choices)
            return False
        return True

    def settle(self) -> bool:
        """Derive what needs no cases; False on a contradiction."""
        self._prepare()
        try:
            self._saturate()
        except _ClashError:
            return False
        return True

    def _prepare(self) -> None:
        rules = self.rules
        if len(rules.names) != self._index_size:
            self._index_size = len(rules.names)
            self._fillers = {}
            for concept, limit in rules.at_most.items():
                self._fillers.setdefault(limit.concept, []).append(concept)
            self._pairwise = rules.has_inverse and bool(rules.at_most or rules.functional)

    def _saturate(self) -> None:
        queue = self._queue
        while queue or self._recount or self._revalue:
            while queue:
                event = queue.pop()
                if event[0] in self._gone:
                    continue
                if len(event) == 2:
                    self._on_concept(*event)
                elif event[2] not in self._gone:
                    self._on_relation(*event)
            if self._recount:
                x, _ = self._recount.popitem()
                if x not in self._gone:
                    self._count_all(x)
            elif self._revalue:
                x, _ = self._revalue.popitem()
                if x not in self._gone:
                    self._check_values(x)

    def _branch(self) -> bool:
        """Try the first open disjunction; whether something was added."""
        ends = self._pending_ends
        while ends['first'] < ends['end']:
            key, choices = self._pending[ends['first']]
            found = self._open(key, choices)
            self._put(ends, 'first', ends['first'] + 1)
            if found is None:
                continue
            alternatives, stated = found
            if not alternatives:
                raise _ClashError(stated)
            if len(alternatives) == 1:
                self._apply(alternatives[0], stated)
                return True
            # What failed often is tried late, as HermiT does.
            ordered = tuple(sorted(alternatives, key=self._failures_of))
            choice = _Choice(len(self._trail), ordered, stated)
            self._stack.append(choice)
            self._apply(ordered[0], stated | 1 << len(self._stack) - 1)
            return True
        return False

    def _failures_of(self, alternative: Alternative) -> int:
        return self._failures.get(alternative[2], 0) if alternative[0] == 'concept' else 0

    def _go_back(self, choices: Choices) -> bool:
        """Take the next alternative of the last choice that took part; False: there is none."""
        while len(self._stack) > self._held:
            self._forget()
            choice = self._stack[-1]
            bit = 1 << len(self._stack) - 1
            self._undo(choice.mark)
            if not choices & bit:
                self._stack.pop()
                continue
            choice.choices |= choices & ~bit
            failed = choice.alternatives[choice.place]
            if failed[0] == 'concept':
                self._failures[failed[2]] = self._failures.get(failed[2], 0) + 1
            choice.place += 1
            alternative = choice.alternatives[choice.place]
            stated = choice.stated | bit
            if choice.place == len(choice.alternatives) - 1:
                self._stack.pop()
                stated = choice.choices
            try:
                self._apply(alternative, stated)
            except _ClashError as clash:
                choices = clash.choices
                continue
            return True
        self.depends = bool(choices)
        return False

    def _open(
        self, key: tuple[Alternative, ...], choices: Choices
    ) -> tuple[tuple[Alternative, ...], Choices] | None:
        """Return the alternatives that are left; None where one holds, or none is about anybody."""
        left: list[Alternative] = []
        for alternative in key:
            kind = alternative[0]
            if kind == 'concept':
                x, more = self.find(alternative[1])
                if x is None or alternative[2] in self.labels[x]:
                    return None
                choices |= more
                left.append(('concept', x, alternative[2]))
            elif kind == 'same':
                x, more = self.find(alternative[1])
                y, others = self.find(alternative[2])
                if x is None or y is None or x == y:
                    return None
                apart = self._different(x, y)
                choices |= more | others
                if apart is None:
                    left.append(('same', x, y))
                else:
                    choices |= apart
            elif kind == 'root':
                y, more = self.find(alternative[1])
                if y is None or self._parent[y] is None:
                    return None
                choices |= more
                left.append(('root', y, alternative[2]))
            elif kind == 'narrow':
                v, more = self._find_value(alternative[1])
                if v is None or self.value_sets[v][0].within(alternative[2]):
                    return None
                choices |= more
                if (self.value_sets[v][0] & alternative[2]).is_empty:
                    choices |= self.value_sets[v][1]
                else:
                    left.append(('narrow', v, alternative[2]))
            else:
                v, more = self._find_value(alternative[1])
                w, others = self._find_value(alternative[2])
                if v is None or w is None or v == w:
                    return None
                choices |= more | others
                left.append(('same value', v, w))
        return tuple(left), choices

    def _apply(self, alternative: Alternative, choices: Choices) -> None:
        kind = alternative[0]
        if kind == 'concept':
            self.concept(alternative[1], alternative[2], choices)
        elif kind == 'same':
            self.same(alternative[1], alternative[2], choices)
        elif kind == 'root':
            self._make_root(alternative[1], alternative[2], choices)
        elif kind == 'narrow':
            self._narrow(alternative[1], alternative[2], choices)
        else:
            self._merge_values(alternative[1], alternative[2], choices)

    def _one_of(self, heads: Heads, x: int, y: int, choices: Choices) -> None:
        """State that one of the heads holds of x (place 0) or y."""
        alternatives: list[Alternative] = []
        for place, concept in heads:
            one = y if place else x
            if concept in self.labels[one]:
                return
            alternatives.append(('concept', one, concept))
        self._alternatives(alternatives, choices)

    def _alternatives(self, alternatives: list[Alternative], choices: Choices) -> None:
        if not alternatives:
            raise _ClashError(choices)
        if len(alternatives) == 1:
            self._apply(alternatives[0], choices)
        else:
            key = tuple(dict.fromkeys(alternatives))
            if key not in self._stated:
                self._put(self._stated, key, True)
                end = self._pending_ends['end']
                self._put(self._pending, end, (key, choices))
                self._put(self._pending_ends, 'end', end + 1)

    # --- rules ---

    def _on_concept(self, x: int, concept: int) -> None:
        rules, labels = self.rules, self.labels[x]
        if concept in rules.nominals:
            named = self.individual(rules.nominals[concept])
            if named != x:
                more = self.choices_of(rules.nominals[concept])
                self._merge(named, x, labels[concept] | more)
                if x in self._gone:
                    return
        for rule in rules.of_node.get(concept, ()):
            choices = _sum(rule.body, labels)
            if choices is not None:
                self._one_of(rule.heads, x, x, choices)
                if x in self._gone:
                    return
        if concept in rules.by_source:
            for edge_rule in rules.by_source[concept]:
                for y, roles in tuple(self.out[x].items()):
                    if edge_rule.role in roles:
                        self._fire(edge_rule, x, y)
        if concept in rules.by_target:
            for edge_rule in rules.by_target[concept]:
                for y, roles in tuple(self.out[x].items()):
                    if -edge_rule.role in roles:
                        self._fire(edge_rule, y, x)
        if concept in rules.loops:
            self.relate(x, rules.loops[concept], x, labels[concept])
        if concept in rules.at_least:
            self._put(self._needs[x], concept, labels[concept])
        if concept in rules.at_most:
            self._put(self._limits[x], concept, labels[concept])
            self._recount[x] = None
        if concept in self._fillers:
            for y in self.out[x]:
                if not self._limits[y].keys().isdisjoint(self._fillers[concept]):
                    self._recount[y] = None
        if (
            concept in rules.values_at_least
            or concept in rules.values_at_most
            or concept in rules.of_values
        ):
            self._revalue[x] = None

    def _on_relation(self, x: int, role: int, y: int) -> None:
        rules = self.rules
        roles = self.out[x].get(y)
        if roles is None or role not in roles:
            return
        for other in rules.disjoint.get(role, ()):
            if other in roles:
                raise _ClashError(roles[role] | roles[other])
        if x == y:
            for concept in rules.marks.get(abs(role), ()):
                self.concept(x, concept, roles[role])
        for rule in rules.by_role.get(role, ()):
            self._fire(rule, x, y)
        for rule in rules.by_role.get(-role, ()):
            self._fire(rule, y, x)
        if self._limits[x] or role in self._functional:
            self._recount[x] = None
        if self._limits[y] or -role in self._functional:
            self._recount[y] = None

    def _fire(self, rule: EdgeRule, x: int, y: int) -> None:
        if x in self._gone or y in self._gone:
            return
        roles = self.out[x].get(y)
        if roles is None or rule.role not in roles:
            return
        mine = _sum(rule.xs, self.labels[x])
        if mine is None:
            return
        theirs = _sum(rule.ys, self.labels[y])
        if theirs is not None:
            self._one_of(rule.heads, x, y, mine | theirs | roles[rule.role])

    # --- who is the same ---

    def _merge(self, kept: int, gone: int, choices: Choices) -> None:
        roots = self._parent[kept] is None, self._parent[gone] is None
        if roots[0] != roots[1]:
            if roots[1]:
                kept, gone = gone, kept
        elif gone < kept:
            kept, gone = gone, kept
        apart = self._different(kept, gone)
        if apart is not None:
            raise _ClashError(choices | apart)
        self._put(self._gone, gone, (kept, choices))
        for child in tuple(self._children[gone]):
            self._prune(child, gone, choices)
        if self.names[gone]:
            self._put(self.names, kept, (*self.names[kept], *self.names[gone]))
        for group, more in self._groups[gone].items():
            if group not in self._groups[kept]:
                self._put(self._groups[kept], group, more | choices)
        for concept, more in tuple(self.labels[gone].items()):
            self.concept(kept, concept, more | choices)
        for other, roles in tuple(self.out[gone].items()):
            if other != gone:
                self._drop(self.out[other], gone)
                self._recount[other] = None
            target = kept if other == gone else other
            for role, more in roles.items():
                self.relate(kept, role, target, more | choices)
        for v in self.values[gone]:
            self._put(self.values[kept], v, None)
            self._put(self._value_owner, v, kept)
            for prop, more in tuple(self.value_props[v].items()):
                self._put(self.value_props[v], prop, more | choices)
            found, more = self.value_sets[v]
            self._put(self.value_sets, v, (found, more | choices))
        self._recount[kept] = None
        self._revalue[kept] = None

    def _prune(self, x: int, parent: int, choices: Choices) -> None:
        """Take away an unnamed individual and those that hang on it."""
        if self._parent[x] != parent or x in self._gone:
            return
        self._put(self._gone, x, (None, choices))
        for child in tuple(self._children[x]):
            self._prune(child, x, choices)
        for other in self.out[x]:
            if other != x:
                self._drop(self.out[other], x)

    def _make_root(self, y: int, key: Any, choices: Choices) -> None:
        known = self._introduced.get(key)
        found = None if known is None else self.find(known)[0]
        if found is not None:
            self.same(found, y, choices)
            return
        parent = self._parent[y]
        if parent is not None:
            self._drop(self._children[parent], y)
        self._put(self._parent, y, None)
        self._put(self._introduced, key, y)

    # --- counting ---

    def _count_all(self, x: int) -> None:
        for limits in self._functional.values():
            for limit in limits:
                self._limit(x, limit, 0)
                if x in self._gone:
                    return
        for concept, choices in tuple(self._limits[x].items()):
            self._limit(x, self.rules.at_most[concept], choices)
            if x in self._gone:
                return

    def _limit(self, x: int, limit: Count, choices: Choices) -> None:
        counted: list[int] = []
        for y, roles in self.out[x].items():
            if limit.role in roles and (not limit.concept or limit.concept in self.labels[y]):
                counted.append(y)
        if self._parent[x] is None:
            for y in counted:
                parent = self._parent[y]
                if parent is not None and parent != x:
                    self._introduce(x, limit, y, choices)
            if x in self._gone or not self._gone.keys().isdisjoint(counted):
                self._recount[x] = None
                return
        if len(counted) <= limit.n:
            return
        counted.sort(key=lambda y: (-len(self._groups[y]), y))
        chosen = counted[: limit.n + 1]
        for y in chosen:
            choices |= self.out[x][y][limit.role]
            if limit.concept:
                choices |= self.labels[y][limit.concept]
        pairs: list[Alternative] = []
        for one, other in combinations(chosen, 2):
            apart = self._different(one, other)
            if apart is None:
                pairs.append(('same', one, other))
            else:
                choices |= apart
        self._alternatives(pairs, choices)

    def _introduce(self, x: int, limit: Count, y: int, choices: Choices) -> None:
        """Make an unnamed individual that a named one counts one of so many."""
        choices |= self.out[x][y][limit.role]
        if limit.concept:
            choices |= self.labels[y][limit.concept]
        options: list[Alternative] = []
        for number in range(limit.n):
            key = (x, limit, number)
            options.append(('root', y, key))
            if key not in self._introduced:
                break
        self._alternatives(options, choices)

    def _counted(self, x: int, needed: Count) -> list[int]:
        return [
            y
            for y, roles in self.out[x].items()
            if needed.role in roles and (not needed.concept or needed.concept in self.labels[y])
        ]

    def _is_met(self, x: int, needed: Count) -> bool:
        found = self._counted(x, needed)
        if needed.n == 1:
            return bool(found)
        return len(found) >= needed.n and self._pairwise_different(found, needed.n)

    def _pairwise_different(self, found: list[int], n: int) -> bool:
        def extend(chosen: list[int], place: int) -> bool:
            if len(chosen) == n:
                return True
            for next_place in range(place, len(found) - (n - len(chosen)) + 1):
                y = found[next_place]
                fits = all(self._different(one, y) is not None for one in chosen)
                if fits and extend([*chosen, y], next_place + 1):
                    return True
            return False

        return extend([], 0)

    # --- individuals that must exist ---

    def _expand(self) -> bool:
        """Add the individuals that are still needed; whether there were any."""
        self.blocked = self._blocked()
        progress = False
        for x in tuple(self.alive()):
            if x in self.blocked or x in self._gone:
                continue
            for concept, choices in tuple(self._needs[x].items()):
                if x in self._gone:
                    break
                needed = self.rules.at_least[concept]
                if not self._is_met(x, needed):
                    self._create(x, needed, choices)
                    progress = True
        return progress

    def _create(self, x: int, needed: Count, choices: Choices) -> None:
        iri = self.rules.nominals.get(needed.concept)
        if iri is not None and needed.n == 1:
            y = self.individual(iri)
            self.relate(x, needed.role, y, choices | self.choices_of(iri))
            return
        made = [self._new(x) for _ in range(needed.n)]
        if len(made) > 1:
            self.differ(made, choices)
        for y in made:
            self.relate(x, needed.role, y, choices)
            self.concept(y, needed.concept, choices)

    def _blocked(self) -> dict[int, int]:
        """Unnamed individuals that need no successors, and in whose place they are."""
        found: dict[int, int] = {}
        seen: dict[Any, int] = {}
        labels = self.labels
        for x in self.alive():
            parent = self._parent[x]
            if parent is None:
                continue
            if parent in found:
                found[x] = found[parent]
                continue
            sign: Any = frozenset(labels[x])
            if self._pairwise:
                if self._parent[parent] is None:
                    continue
                roles = self.out[parent].get(x, {})
                sign = sign, frozenset(labels[parent]), frozenset(roles)
            first = seen.setdefault(sign, x)
            if first != x:
                found[x] = first
        return found

    # --- values ---

    def _find_value(self, v: int) -> tuple[int | None, Choices]:
        choices = 0
        while v in self._value_gone:
            v, more = self._value_gone[v]
            choices |= more
        return (None if self._value_owner[v] in self._gone else v), choices

    def _narrow(self, v: int, values: ValueSet, choices: Choices) -> None:
        found, more = self.value_sets[v]
        narrowed = found & values
        self._put(self.value_sets, v, (narrowed, more | choices))
        if narrowed.is_empty:
            raise _ClashError(more | choices)
        self._revalue[self._value_owner[v]] = None

    def _merge_values(self, v: int, w: int, choices: Choices) -> None:
        apart = self._values_apart(v, w)
        if apart is not None:
            raise _ClashError(choices | apart)
        self._put(self._value_gone, w, (v, choices))
        x = self._value_owner[v]
        self._drop(self.values[x], w)
        for prop, more in self.value_props[w].items():
            if prop not in self.value_props[v]:
                self._put(self.value_props[v], prop, more | choices)
        for group, more in self._value_groups[w].items():
            if group not in self._value_groups[v]:
                self._put(self._value_groups[v], group, more | choices)
        values, more = self.value_sets[w]
        self._narrow(v, values, choices | more)

    def _values_apart(self, v: int, w: int) -> Choices | None:
        for group, choices in self._value_groups[v].items():
            if group in self._value_groups[w]:
                return choices | self._value_groups[w][group]
        for prop, choices in self.value_props[v].items():
            for other in self.rules.disjoint_props.get(prop, ()):
                if other in self.value_props[w]:
                    return choices | self.value_props[w][other]
        return None

    def _check_values(self, x: int) -> None:
        rules, labels = self.rules, self.labels[x]
        for concept in tuple(labels):
            needed = rules.values_at_least.get(concept)
            if needed is not None:
                self._need_values(x, concept, needed)
        for v in tuple(self.values[x]):
            self._apply_value_rules(x, v)
        self._join_known(x)
        if self._queue:
            self._revalue[x] = None
            return
        for limit in rules.functional_values:
            self._limit_values(x, limit, 0)
        for concept in tuple(labels):
            found = rules.values_at_most.get(concept)
            if found is not None:
                self._limit_values(x, found, labels[concept])
        self._assign(x)

    def _need_values(self, x: int, concept: int, needed: ValueCount) -> None:
        choices = self.labels[x][concept]
        if needed.n == 1:
            for v in self.values[x]:
                known = needed.prop in self.value_props[v]
                if known and self.value_sets[v][0].within(needed.values):
                    return
        elif (x, concept) in self._made:
            return
        self._put(self._made, (x, concept), True)
        if needed.values.size < needed.n:
            raise _ClashError(choices)
        group = next(self._numbers)
        for _ in range(needed.n):
            v = self.value(x, needed.prop, needed.values, choices)
            if needed.n > 1:
                self._put(self._value_groups[v], group, choices)

    def _apply_value_rules(self, x: int, v: int) -> None:
        self._step()
        labels, props = self.labels[x], self.value_props[v]
        for prop, choices in tuple(props.items()):
            for other in self.rules.disjoint_props.get(prop, ()):
                if other in props:
                    raise _ClashError(choices | props[other])
            for rule in self.rules.by_prop.get(prop, ()):
                more = _sum(rule.xs, labels)
                if more is None or any(concept in labels for _, concept in rule.heads):
                    continue
                values, others = self.value_sets[v]
                if values.is_empty:
                    raise _ClashError(others)
                if (values & rule.values).is_empty:
                    continue
                if (values & rule.rest).is_empty:
                    self._one_of(rule.heads, x, x, choices | more | others)
                elif not rule.heads:
                    self._narrow(v, rule.rest, choices | more)
                else:
                    heads: list[Alternative] = [('concept', x, head) for _, head in rule.heads]
                    narrow: Alternative = ('narrow', v, rule.rest)
                    self._alternatives([narrow, *heads], choices | more)

    def _join_known(self, x: int) -> None:
        """Make one of the values that are the same."""
        known: dict[Value, int] = {}
        for v in tuple(self.values[x]):
            values, choices = self.value_sets[v]
            if values.is_empty:
                raise _ClashError(choices)
            if not values.decided:
                self.gaps['whether values suit a pattern, a length or a moment'] = None
            only = values.only
            if only is None:
                continue
            first = known.setdefault(only, v)
            if first != v:
                self._merge_values(first, v, choices | self.value_sets[first][1])

    def _limit_values(self, x: int, limit: ValueCount, choices: Choices) -> None:
        counted: list[int] = []
        unsure: list[int] = []
        for v in self.values[x]:
            if limit.prop in self.value_props[v]:
                values = self.value_sets[v][0]
                if values.within(limit.values):
                    counted.append(v)
                elif not (values & limit.values).is_empty:
                    unsure.append(v)
        if len(counted) + len(unsure) <= limit.n:
            return
        for v in unsure:
            both: list[Alternative] = [
                ('narrow', v, ~limit.values),
                ('narrow', v, limit.values),
            ]
            self._alternatives(both, 0)
        if len(counted) <= limit.n:
            return
        counted.sort(key=lambda v: (self.value_sets[v][0].size, v))
        chosen = counted[: limit.n + 1]
        pairs: list[Alternative] = []
        for v in chosen:
            choices |= self.value_props[v][limit.prop] | self.value_sets[v][1]
        for v, w in combinations(chosen, 2):
            apart = self._values_apart(v, w)
            if apart is not None:
                choices |= apart
            elif not (self.value_sets[v][0] & self.value_sets[w][0]).is_empty:
                pairs.append(('same value', v, w))
        self._alternatives(pairs, choices)

    def _assign(self, x: int) -> None:
        """Tell whether values that differ can be chosen from small sets."""
        others: dict[int, list[int]] = {}
        for v, w in combinations(self.values[x], 2):
            if self._values_apart(v, w) is not None:
                others.setdefault(v, []).append(w)
                others.setdefault(w, []).append(v)
        small = [v for v, found in others.items() if self.value_sets[v][0].size <= len(found)]
        if not small:
            return
        chosen: dict[int, Value] = {}

        def extend(place: int) -> bool:
            if place == len(small):
                return True
            v = small[place]
            taken = {chosen[w] for w in others[v] if w in chosen}
            for value in self.value_sets[v][0].members():
                if value not in taken:
                    chosen[v] = value
                    if extend(place + 1):
                        return True
                    del chosen[v]
            return False

        if not extend(0):
            choices = 0
            for v in small:
                choices |= self.value_sets[v][1]
                for prop_choices in self.value_props[v].values():
                    choices |= prop_choices
                for group_choices in self._value_groups[v].values():
                    choices |= group_choices
            raise _ClashError(choices)

    # --- keys ---

    def _keys(self) -> bool:
        """Make one of named individuals that share a key; whether something was added."""
        for key in self.rules.keys:
            members = [
                x
                for x in self.alive()
                if self.names[x] and (not key.concept or key.concept in self.labels[x])
            ]
            for x, y in combinations(members, 2):
                choices = self._shared(x, y, key.roles, key.props)
                if choices is None:
                    continue
                if key.concept:
                    choices |= self.labels[x][key.concept] | self.labels[y][key.concept]
                self._merge(x, y, choices)
                return True
        return False

    def _shared(
        self, x: int, y: int, roles: tuple[int, ...], props: tuple[str, ...]
    ) -> Choices | None:
        total = 0
        for role in roles:
            for z, found in self.out[x].items():
                theirs = self.out[y].get(z, {})
                if self.names[z] and role in found and role in theirs:
                    total |= found[role] | theirs[role]
                    break
            else:
                return None
        for prop in props:
            mine, others = self._known_values(x, prop), self._known_values(y, prop)
            shared = next((value for value in mine if value in others), None)
            if shared is None:
                return None
            total |= mine[shared] | others[shared]
        return total

    def _known_values(self, x: int, prop: str) -> dict[Value, Choices]:
        found: dict[Value, Choices] = {}
        for v in self.values[x]:
            if prop in self.value_props[v]:
                values, choices = self.value_sets[v]
                only = values.only
                if only is None:
                    self.gaps['whether unknown values are those of a key'] = None
                else:
                    found[only] = choices | self.value_props[v][prop]
        return found


def _sum(concepts: frozenset[int], labels: dict[int, Choices]) -> Choices | None:
    """Return the choices that concepts depend on; None where one is missing."""
    total = 0
    for concept in concepts:
        found = labels.get(concept)
        if found is None:
            return None
        total |= found
    return total
