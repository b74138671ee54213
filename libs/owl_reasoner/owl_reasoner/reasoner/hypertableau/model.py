"""A model in the making: its individuals, the facts about them, and the choices each rests on.

Individuals and values are nodes of one numbering. Every fact carries the choices it depends on, a
bit for each; facts without choices are entailed. Every change can be taken back. No rule is applied
here: new facts wait in `queue`, individuals whose relations or values are to be counted again in
`recount` and `revalue`.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager
from itertools import count
from typing import Any, NamedTuple, TypeAlias

from owl_reasoner.reasoner.clauses import StoppedError
from owl_reasoner.reasoner.datatypes import Value
from owl_reasoner.reasoner.hypertableau.dl_clauses import ANYBODY, FRESH, Asked, DLClauses
from owl_reasoner.reasoner.value_sets import ValueSet

Choices: TypeAlias = int
"""The choices that a fact depends on: bit n for the choice of level n."""
_MISSING = object()


class ClashError(Exception):
    """A contradiction; `choices` are those it depends on."""

    def __init__(self, choices: Choices) -> None:
        self.choices = choices


class CaseModel:
    """Individuals and values with their facts.

    Many attributes because each is one index of the same graph, and backtracking undoes them all.

    Args:
        rules: Give the roles above a role, and the concept of each named individual.
        most_steps: After so many added facts `step` raises `StoppedError`.

    Attributes:
        labels: The concepts of each individual.
        out: For each individual the related ones, and by which roles.
        names: The IRIs of named individuals.
        parent, children: Whom an unnamed individual was made for; None for the others.
        values: The values of each individual.
        props, sets, owner: Each value's properties, the set it is in, and whose it is.
        holding: The values that are known, by what they are; those that are not, by None.
        gone: Nodes that are taken away, with who stands for them now and by which choices.
        roots: Unnamed individuals that a named one counts, by what they are counted as.
        having: Whoever has a concept, a value by a data property or somebody by a role, for those
            that rules about named individuals ask for; some are gone, or have it no more.
    """

    def __init__(self, rules: DLClauses, most_steps: int) -> None:
        self.rules, self._most_steps, self.steps = rules, most_steps, 0
        self.budget, self._roles = rules.budget, rules.roles
        self.labels: dict[int, dict[int, Choices]] = {}
        self.out: dict[int, dict[int, dict[int, Choices]]] = {}
        self.names: dict[int, tuple[str, ...]] = {}
        self.parent: dict[int, int | None] = {}
        self.children: dict[int, dict[int, None]] = {}
        self.values: dict[int, dict[int, None]] = {}
        self.props: dict[int, dict[str, Choices]] = {}
        self.sets: dict[int, tuple[ValueSet, Choices]] = {}
        self.owner: dict[int, int] = {}
        self.holding: dict[Value | None, dict[int, None]] = {None: {}}
        self.roots: dict[Any, int] = {}
        self._groups: dict[int, dict[int, Choices]] = {}
        self.gone: dict[int, tuple[int | None, Choices]] = {}
        self.having: dict[Asked, dict[int, None]] = {one: {} for one in rules.asked}
        self._individuals: dict[str, int] = {}
        self._numbers = count(1)
        self._trail: list[tuple[dict[Any, Any], Any, Any]] = []
        self.queue: list[tuple[int, ...]] = []
        self.recount: dict[int, None] = {}
        self.revalue: dict[int, None] = {}
        self.rejoin: dict[int, None] = {}

    # --- changes that can be taken back ---

    def put(self, table: dict[Any, Any], key: Any, value: Any) -> None:
        """Set an entry of a table."""
        self._trail.append((table, key, table.get(key, _MISSING)))
        table[key] = value

    def drop(self, table: dict[Any, Any], key: Any) -> None:
        """Take an entry out of a table, where it is there."""
        if key in table:
            self._trail.append((table, key, table.pop(key)))

    def mark(self) -> int:
        """Return a state to come back to."""
        return len(self._trail)

    def undo(self, mark: int) -> None:
        """Go back to a state."""
        trail = self._trail
        while len(trail) > mark:
            # A trail as in constraint solvers: going back costs as much as going forward did, and
            # no table is copied for a choice.
            table, key, value = trail.pop()
            if value is _MISSING:
                del table[key]
            else:
                table[key] = value
        # What is still in them was put there after the mark: a choice is made with all queues
        # empty.
        self.queue.clear()
        self.recount.clear()
        self.revalue.clear()
        self.rejoin.clear()

    def changed_since(self, mark: int) -> Iterator[tuple[dict[Any, Any], Any]]:
        """Yield the entries, as pairs of table and key, that changed since a state."""
        return ((table, key) for table, key, _ in self._trail[mark:])

    @contextmanager
    def at_most(self, steps: int) -> Iterator[None]:
        """Take no more than so many steps until the context is left."""
        most = self._most_steps
        self._most_steps = min(most, self.steps + steps)
        try:
            yield
        finally:
            self._most_steps = most

    def step(self) -> None:
        """Count one step of the search.

        Raises:
            StoppedError: So many steps were taken.
            ReasoningBudgetError: A limit of the whole reasoning is passed.
        """
        self.steps += 1
        self.budget.tick()
        if self.steps > self._most_steps:
            raise StoppedError

    # --- who is there ---

    def individual(self, iri: str) -> tuple[int, Choices]:
        """Return who stands for a name, made where there is nobody yet, and by which choices."""
        known = self._individuals.get(iri)
        if known is None:
            known = self.somebody()
            self.put(self._individuals, iri, known)
            if not iri.startswith(FRESH):
                self.put(self.names, known, (iri,))
            self.concept(known, self.rules.nominal(iri), 0)
        found, choices = self.find(known)
        assert found is not None, 'a named individual is never taken away'
        return found, choices

    def somebody(self, parent: int | None = None) -> int:
        """Return a new individual, unnamed so far; `parent`: for whom it is made."""
        # Numbers are not taken back: an individual made again is another one, and who came earlier
        # (`blocking`) stays decided.
        x = next(self._numbers)
        tables: tuple[dict[int, Any], ...] = (
            *(self.labels, self.out, self._groups, self.values, self.children),
        )
        for table in tables:
            self.put(table, x, {})
        self.put(self.parent, x, parent)
        self.put(self.names, x, ())
        if parent is not None:
            self.put(self.children[parent], x, None)
        self.concept(x, ANYBODY, 0)
        return x

    def value(self, x: int, prop: str, values: ValueSet, choices: Choices) -> int:
        """State that an individual has some value of a set by a data property."""
        v = next(self._numbers)
        self.put(self.values[x], v, None)
        self.put(self.props, v, dict.fromkeys(self._roles.data_above(prop), choices))
        self._note_holder(x, v)
        self.put(self.sets, v, (values, choices))
        self.put(self._groups, v, {})
        self.put(self.owner, v, x)
        self.put(self.holding[None], v, None)
        self._learn(v, values)
        self.revalue[x] = None
        return v

    def _note_holder(self, x: int, v: int) -> None:
        """Note that an individual has a value by each of its properties."""
        for prop in self.props[v]:
            if prop in self.having:
                self.put(self.having[prop], x, None)

    def _learn(self, v: int, values: ValueSet) -> None:
        """Note which value it is, where one alone is left."""
        only = values.only
        if only is not None and v in self.holding[None]:
            self.drop(self.holding[None], v)
            if only not in self.holding:
                self.put(self.holding, only, {})
            self.put(self.holding[only], v, None)

    def extend(self, v: int, prop: str, choices: Choices) -> None:
        """State that a value is one by a further data property."""
        for above in self._roles.data_above(prop):
            if above not in self.props[v]:
                self.put(self.props[v], above, choices)
        self._note_holder(self.owner[v], v)
        self.revalue[self.owner[v]] = None

    def find(self, node: int) -> tuple[int | None, Choices]:
        """Return who stands for a node now (None: nobody), and by which choices."""
        choices, current, gone = 0, node, self.gone
        # No path compression: the steps carry the choices of each merge, and go one by one when
        # these are taken back.
        while current in gone:
            following, more = gone[current]
            choices |= more
            if following is None:
                return None, choices
            current = following
        if current in self.owner and self.owner[current] in gone:
            return None, choices
        return current, choices

    def is_gone(self, node: int) -> bool:
        """Tell whether an individual or value is taken away, or another one stands for it."""
        return node in self.gone

    def alive(self) -> Iterator[int]:
        """Return every individual that is there, in the order they came."""
        return (x for x in self.labels if x not in self.gone)

    # --- facts ---

    def concept(self, x: int, concept: int, choices: Choices) -> None:
        """State that an individual has a concept."""
        labels = self.labels[x]
        if concept not in labels:
            self.step()
            self.put(labels, concept, choices)
            self.queue.append((x, concept))
            if concept in self.having:
                self.put(self.having[concept], x, None)

    def relate(self, x: int, role: int, y: int, choices: Choices) -> None:
        """State that an individual is related to another one."""
        there = self.out[x].get(y)
        if there is None:
            there = {}
            self.put(self.out[x], y, there)
            if x != y:
                self.put(self.out[y], x, {})
        back, having = self.out[y][x], self.having
        for one in self._roles.above(role):
            if one not in there:
                self.put(there, one, choices)
                self.put(back, -one, choices)
                self.queue.append((x, one, y))
                for role, source in ((one, x), (-one, y)):
                    if ('role', role) in having:
                        self.put(having['role', role], source, None)

    def narrow(self, v: int, values: ValueSet, choices: Choices) -> None:
        """State that a value is in a set."""
        found, more = self.sets[v]
        narrowed = found & values
        self.put(self.sets, v, (narrowed, more | choices))
        if narrowed.is_empty:
            raise ClashError(more | choices)
        self._learn(v, narrowed)
        self.revalue[self.owner[v]] = None

    def differ(self, nodes: Iterable[int], choices: Choices = 0) -> None:
        """State that no two of the nodes are the same."""
        group = next(self._numbers)
        for node in nodes:
            if group in self._groups[node]:
                raise ClashError(choices)
            self.put(self._groups[node], group, choices)

    def different(self, x: int, y: int) -> Choices | None:
        """Return the choices by which two nodes differ; None where they are not known to."""
        mine, theirs = self._groups[x], self._groups[y]
        found: Choices | None = None
        for group, choices in mine.items():
            if group in theirs:
                both = choices | theirs[group]
                found = both if found is None else min(found, both)
        if found is None and x in self.props:
            for prop, choices in self.props[x].items():
                for other in self.rules.disjoint_props.get(prop, ()):
                    if other in self.props[y]:
                        return choices | self.props[y][other]
        return found

    def excluded(self, x: int, concept: int) -> Choices | None:
        """Return the choices by which an individual cannot have a concept; None where it may."""
        labels = self.labels[x]
        for others in self.rules.excluded.get(concept, ()):
            choices = total(others, labels)
            if choices is not None:
                return choices
        known = self._individuals.get(self.rules.nominals.get(concept, ''))
        if known is not None:
            y, more = self.find(known)
            apart = None if y is None else self.different(x, y)
            if apart is not None:
                return apart | more
        return None

    def differences(self, node: int) -> Choices:
        """Return the choices of all by which a node may differ from another one."""
        total = 0
        for choices in (*self._groups[node].values(), *self.props.get(node, {}).values()):
            total |= choices
        return total

    def groups_of(self, node: int) -> dict[int, Choices]:
        """Return the sets of different nodes that a node is in."""
        return self._groups[node]

    def count_of_differences(self, node: int) -> int:
        """Return in how many sets of different nodes a node is."""
        return len(self._groups[node])

    # --- who is the same ---

    def same(self, x: int, y: int, choices: Choices) -> None:
        """State that two nodes are the same."""
        kept, more = self.find(x)
        gone, others = self.find(y)
        choices |= more | others
        if kept is None or gone is None or kept == gone:
            return
        is_value = kept in self.sets
        if not is_value:
            # An unnamed individual goes before one that is nobody's child, a later one before.
            kept, gone = sorted((kept, gone), key=lambda one: (self.parent[one] is not None, one))
        apart = self.different(kept, gone)
        if apart is not None:
            raise ClashError(choices | apart)
        self.put(self.gone, gone, (kept, choices))
        for group, more in self._groups[gone].items():
            if group not in self._groups[kept]:
                self.put(self._groups[kept], group, more | choices)
        if is_value:
            self._move_set(gone, kept, choices)
        else:
            self._move_facts(gone, kept, choices)

    def _move_set(self, gone: int, kept: int, choices: Choices) -> None:
        self.drop(self.values[self.owner[kept]], gone)
        for prop, more in self.props[gone].items():
            if prop not in self.props[kept]:
                self.put(self.props[kept], prop, more | choices)
        self._note_holder(self.owner[kept], kept)
        values, more = self.sets[gone]
        self.narrow(kept, values, choices | more)

    def _move_facts(self, gone: int, kept: int, choices: Choices) -> None:
        for child in tuple(self.children[gone]):
            self._prune(child, gone, choices)
        if self.names[gone]:
            self.put(self.names, kept, (*self.names[kept], *self.names[gone]))
        for concept, more in tuple(self.labels[gone].items()):
            self.concept(kept, concept, more | choices)
        for other, roles in tuple(self.out[gone].items()):
            if other != gone:
                self.drop(self.out[other], gone)
                self.recount[other] = None
            target = kept if other == gone else other
            for role, more in roles.items():
                self.relate(kept, role, target, more | choices)
        for v in self.values[gone]:
            self.put(self.values[kept], v, None)
            self.put(self.owner, v, kept)
            self._note_holder(kept, v)
            for prop, more in tuple(self.props[v].items()):
                self.put(self.props[v], prop, more | choices)
            values, more = self.sets[v]
            self.put(self.sets, v, (values, more | choices))
        self.recount[kept] = None
        self.revalue[kept] = None

    def _prune(self, x: int, parent: int, choices: Choices) -> None:
        """Take away an unnamed individual and those that were made for it."""
        if self.parent[x] != parent or x in self.gone:
            return
        self.put(self.gone, x, (None, choices))
        for child in tuple(self.children[x]):
            self._prune(child, x, choices)
        for other in self.out[x]:
            if other != x:
                # Who loses somebody may need another one.
                self.drop(self.out[other], x)
                self.queue.extend((other, concept) for concept in self.labels[other])

    def make_root(self, y: int, key: Any, choices: Choices) -> None:
        """Make an unnamed individual one of those that a named one counts."""
        known = self.roots.get(key)
        found = None if known is None else self.find(known)[0]
        if found is not None:
            self.same(found, y, choices)
            return
        parent = self.parent[y]
        if parent is not None:
            self.drop(self.children[parent], y)
        self.put(self.parent, y, None)
        self.put(self.roots, key, y)


def total(concepts: frozenset[int], labels: dict[int, Choices]) -> Choices | None:
    """Return the choices that concepts depend on; None where one is missing."""
    found = 0
    for concept in concepts:
        choices = labels.get(concept)
        if choices is None:
            return None
        found |= choices
    return found


# --- what a choice is between ---

Left: TypeAlias = 'tuple[Alternative | None, Choices] | None'
"""An alternative as it is now (None: it is impossible), with the choices that make it so; None
where it holds, or is about nobody that is there."""


class Has(NamedTuple):
    """An individual has a concept."""

    x: int
    concept: int

    def look(self, model: CaseModel) -> Left:
        x, choices = model.find(self.x)
        if x is None or self.concept in model.labels[x]:
            return None
        against = model.excluded(x, self.concept)
        return (Has(x, self.concept), choices) if against is None else (None, choices | against)

    def apply(self, model: CaseModel, choices: Choices) -> None:
        model.concept(self.x, self.concept, choices)


class Same(NamedTuple):
    """Two nodes are the same."""

    x: int
    y: int

    def look(self, model: CaseModel) -> Left:
        x, choices = model.find(self.x)
        y, others = model.find(self.y)
        if x is None or y is None or x == y:
            return None
        apart = model.different(x, y)
        choices |= others
        return (Same(x, y), choices) if apart is None else (None, choices | apart)

    def apply(self, model: CaseModel, choices: Choices) -> None:
        model.same(self.x, self.y, choices)


class Root(NamedTuple):
    """An unnamed individual is a certain one of those that a named one counts."""

    y: int
    key: Any

    def look(self, model: CaseModel) -> Left:
        y, choices = model.find(self.y)
        if y is None or model.parent[y] is None:
            return None
        return Root(y, self.key), choices

    def apply(self, model: CaseModel, choices: Choices) -> None:
        model.make_root(self.y, self.key, choices)


class In(NamedTuple):
    """A value is in a set."""

    v: int
    values: ValueSet

    def look(self, model: CaseModel) -> Left:
        v, choices = model.find(self.v)
        if v is None or model.sets[v][0].within(self.values):
            return None
        values, others = model.sets[v]
        if (values & self.values).is_empty:
            return None, choices | others
        return In(v, self.values), choices

    def apply(self, model: CaseModel, choices: Choices) -> None:
        model.narrow(self.v, self.values, choices)


class Related(NamedTuple):
    """An individual is related to another one."""

    x: int
    role: int
    y: int

    def look(self, model: CaseModel) -> Left:
        x, choices = model.find(self.x)
        y, others = model.find(self.y)
        if x is None or y is None or self.role in model.out[x].get(y, ()):
            return None
        return Related(x, self.role, y), choices | others

    def apply(self, model: CaseModel, choices: Choices) -> None:
        model.relate(self.x, self.role, self.y, choices)


class Valued(NamedTuple):
    """An individual has a value in a set."""

    x: int
    prop: str
    values: ValueSet

    def look(self, model: CaseModel) -> Left:
        x, choices = model.find(self.x)
        if x is None or any(
            self.prop in model.props[v] and model.sets[v][0].within(self.values)
            for v in model.values[x]
        ):
            return None
        return Valued(x, self.prop, self.values), choices

    def apply(self, model: CaseModel, choices: Choices) -> None:
        model.value(self.x, self.prop, self.values, choices)


class Gains(NamedTuple):
    """An individual has a value by one more data property."""

    v: int
    prop: str

    def look(self, model: CaseModel) -> Left:
        v, choices = model.find(self.v)
        if v is None or self.prop in model.props[v]:
            return None
        return Gains(v, self.prop), choices

    def apply(self, model: CaseModel, choices: Choices) -> None:
        model.extend(self.v, self.prop, choices)


class Apart(NamedTuple):
    """Two individuals are different."""

    x: int
    y: int

    def look(self, model: CaseModel) -> Left:
        x, choices = model.find(self.x)
        y, others = model.find(self.y)
        choices |= others
        if x == y:
            return None, choices
        if x is None or y is None or model.different(x, y) is not None:
            return None
        return Apart(x, y), choices

    def apply(self, model: CaseModel, choices: Choices) -> None:
        model.differ((self.x, self.y), choices)


Alternative: TypeAlias = Has | Same | Root | In | Related | Valued | Gains | Apart
Either: TypeAlias = Callable[[list[Alternative], Choices], None]
"""States that one of some alternatives holds, by these choices."""


def still_open(
    model: CaseModel, alternatives: Iterable[Alternative], choices: Choices
) -> tuple[list[Alternative], Choices] | None:
    """Return the alternatives that are possible now, and by which choices no other one is.

    None where one of them holds, or is about nobody that is there.
    """
    left: list[Alternative] = []
    for alternative in alternatives:
        found = alternative.look(model)
        if found is None:
            return None
        now, more = found
        choices |= more
        if now is not None:
            left.append(now)
    return left, choices
