"""What axioms become: predicates that hold facts, and Horn clauses over them.

A fact is a tuple that begins with its predicate: `(C, x)`, `(R, x, y)`, `(D, x, value)`.
Individuals are IRIs (`str`), each standing for all individuals known to be the same; values are
those of `datatypes`.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass, field, replace
from typing import Any, TypeAlias, TypeVar

from owl_reasoner.owl.axioms import Axiom
from owl_reasoner.owl.expressions import ClassExpression, PropertyExpression
from owl_reasoner.reasoner.datatypes import Value
from owl_reasoner.reasoner.value_sets import ValueSet

T = TypeVar('T')


class UnsupportedError(Exception):
    """The reasoner does not take something into account; the text says what, or why not."""


class StoppedError(Exception):
    """A search ended early: at its first find, or after as many steps as it may take."""


Fact: TypeAlias = 'tuple[Any, ...]'
Premises: TypeAlias = 'tuple[Fact, ...]'
Support: TypeAlias = Callable[..., Iterable[Premises]]


class Predicate:
    """The extension of one class, property or internal label, and what to do when it changes.

    Attributes:
        kind: 'class', 'object', 'data' or 'different'.
        name: IRI, or for an internal label a text that shows the expression.
        expression: The class expression or property the predicate stands for.
        members: Individuals (kind 'class'), in the order they came.
        succ, pred: Values by subject and subjects by value (the other kinds), in this order.
        on_insert, on_delete: Called with a fact's arguments after it came, before it goes.
        supports: Pairs of a generator of premise tuples for given arguments and the origin to name.
        disjoint: Predicates that share no member with this one (kind 'class').
        touching: Positions (1, 2) whose individuals may become different from others by a fact of
            this predicate.
    """

    __slots__ = (
        'disjoint',
        'early',
        'expression',
        'kind',
        'members',
        'name',
        'on_delete',
        'on_insert',
        'pred',
        'succ',
        'supports',
        'touching',
    )

    def __init__(self, kind: str, name: str, expression: Any = None) -> None:
        self.kind = kind
        self.name = name
        self.expression = expression
        self.members: dict[str, None] = {}
        self.succ: dict[str, dict[Any, None]] = {}
        self.pred: dict[Any, dict[str, None]] = {}
        self.on_insert: list[Callable[..., None]] = []
        self.on_delete: list[Callable[..., None]] = []
        self.early: list[Callable[..., None]] = []
        self.supports: list[tuple[Support, object]] = []
        self.disjoint: set[Predicate] = set()
        self.touching: tuple[int, ...] = ()

    def __repr__(self) -> str:
        return f'<{self.kind} {self.name}>'

    def holds(self, fact: Fact) -> bool:
        """Tell whether a fact of this predicate is in its extension."""
        if len(fact) == 2:
            return fact[1] in self.members
        values = self.succ.get(fact[1])
        return values is not None and fact[2] in values

    def insert(self, fact: Fact) -> None:
        """Add a fact that is not there."""
        if len(fact) == 2:
            self.members[fact[1]] = None
            return
        _, x, y = fact
        values = self.succ.get(x)
        if values is None:
            self.succ[x] = {y: None}
        else:
            values[y] = None
        subjects = self.pred.get(y)
        if subjects is None:
            self.pred[y] = {x: None}
        else:
            subjects[x] = None

    def discard(self, fact: Fact) -> None:
        """Take away a fact that is there."""
        if len(fact) == 2:
            self.members.pop(fact[1], None)
            return
        _, x, y = fact
        values = self.succ[x]
        values.pop(y, None)
        if not values:
            del self.succ[x]
        subjects = self.pred[y]
        subjects.pop(x, None)
        if not subjects:
            del self.pred[y]

    def facts(self) -> Iterator[Fact]:
        """Yield the whole extension."""
        if self.kind == 'class':
            for x in self.members:
                yield self, x
        else:
            for x, values in self.succ.items():
                for y in values:
                    yield self, x, y


@dataclass(frozen=True, slots=True)
class Constant:
    """A fixed individual, or a fixed value, in a clause; a variable is an `int`."""

    value: Value
    is_value: bool = False


Term: TypeAlias = int | Constant


@dataclass(frozen=True, slots=True)
class PredicateAtom:
    predicate: Predicate
    terms: tuple[Term, ...]


@dataclass(frozen=True, slots=True)
class DifferentAtom:
    terms: tuple[Term, Term]


@dataclass(frozen=True, slots=True)
class SameAtom:
    terms: tuple[Term, Term]


@dataclass(frozen=True, slots=True)
class RangeAtom:
    values: ValueSet
    terms: tuple[Term]


@dataclass(frozen=True, slots=True)
class ComputedAtom:
    """A built-in.

    Attributes:
        builtin: Its local name.
        holds: Tells whether it holds for values of its terms.
        solve: Gives the values of the first term, which nothing else in the body binds; None for a
            built-in that only tests.
        terms: Its arguments.
    """

    builtin: str
    holds: Callable[..., bool]
    solve: Callable[..., Iterable[Value]] | None
    terms: tuple[Term, ...]


BodyAtom: TypeAlias = PredicateAtom | DifferentAtom | SameAtom | RangeAtom | ComputedAtom
HeadAtom: TypeAlias = PredicateAtom | SameAtom


@dataclass(frozen=True, slots=True)
class Clause:
    """If the whole body holds, the head does.

    `origin` is the axiom to name in an explanation. `named_only`: a SWRL rule, whose variables
    stand for named individuals.
    """

    body: tuple[BodyAtom, ...]
    head: HeadAtom
    origin: Axiom | None = field(default=None, compare=False)
    named_only: bool = False


@dataclass(frozen=True, slots=True)
class AtLeast:
    """`head` holds of what has `n` pairwise different related individuals (values) in the filler.

    `inverse` counts along the property backwards; `filler` None admits everything.
    """

    head: Predicate
    n: int
    prop: Predicate
    inverse: bool
    filler: Predicate | ValueSet | None
    origin: Axiom | None = field(default=None, compare=False)


@dataclass(frozen=True, slots=True)
class AtMost:
    """What `label` holds of (None: everything) has at most `n` related individuals (values) in the
    filler.
    """

    label: Predicate | None
    n: int
    prop: Predicate
    inverse: bool
    filler: Predicate | ValueSet | None
    origin: Axiom | None = field(default=None, compare=False)


@dataclass(frozen=True, slots=True)
class Key:
    """Members of `cls` that share a value of every property are the same individual."""

    cls: Predicate | None
    props: tuple[tuple[Predicate, bool], ...]
    origin: Axiom | None = field(default=None, compare=False)


@dataclass(frozen=True, slots=True)
class Existential:
    """What `label` holds of has at least `n` related individuals (values) in the filler, known or
    not.
    """

    label: Predicate
    n: int
    prop: Predicate
    inverse: bool
    filler: Predicate | ValueSet | None
    origin: Axiom | None = field(default=None, compare=False)


@dataclass(frozen=True, slots=True)
class Partial:
    """A label whose members are not all recognised.

    Attributes:
        label: The label.
        sentence: Reports it.
        decided_by: A property and the place in it of an individual: whoever stands there is
            recognised, or is no member.
    """

    label: Predicate
    sentence: str
    decided_by: tuple[Predicate, int] | None = None


@dataclass
class Program:
    """Everything the engine runs.

    Many attributes because it is a record: one table for each kind of clause.

    Attributes:
        classes, objects, datas: Predicates by IRI.
        labels: Predicates of complex class expressions.
        required: Those of them that individuals may be asserted to belong to: what that implies is
            there.
        thing, nothing, apart: The predicates with fixed meaning; `apart` holds of individuals that
            clauses make different.
        different, same: What premises alone are named with.
        partial: Labels whose members are not all recognised.
        meetings: Existentials whose individuals or values a lower bound counts.
        uses_thing: Whether the extension of owl:Thing must be kept.
        interacting: Whether several classes of one individual together imply more than each of
            them does alone.
    """

    classes: dict[str, Predicate] = field(default_factory=dict)
    objects: dict[str, Predicate] = field(default_factory=dict)
    datas: dict[str, Predicate] = field(default_factory=dict)
    labels: dict[ClassExpression, Predicate] = field(default_factory=dict)
    required: set[ClassExpression] = field(default_factory=set)
    clauses: list[Clause] = field(default_factory=list)
    at_least: list[AtLeast] = field(default_factory=list)
    at_most: list[AtMost] = field(default_factory=list)
    keys: list[Key] = field(default_factory=list)
    existentials: list[Existential] = field(default_factory=list)
    irreflexive: list[Predicate] = field(default_factory=list)
    asymmetric: list[Predicate] = field(default_factory=list)
    disjoint_properties: list[tuple[Predicate, bool, Predicate, bool]] = field(default_factory=list)
    negatives: dict[Predicate, Predicate] = field(default_factory=dict)
    unsupported: list[str] = field(default_factory=list)
    partial: list[Partial] = field(default_factory=list)
    meetings: list[tuple[Existential, AtLeast]] = field(default_factory=list)
    uses_thing: bool = False
    interacting: bool = False
    thing: Predicate = field(default_factory=lambda: Predicate('class', 'owl:Thing'))
    nothing: Predicate = field(default_factory=lambda: Predicate('class', 'owl:Nothing'))
    apart: Predicate = field(default_factory=lambda: Predicate('different', 'kept apart from'))
    different: Predicate = field(default_factory=lambda: Predicate('different', 'different from'))
    same: Predicate = field(default_factory=lambda: Predicate('different', 'same as'))

    def cls(self, iri: str) -> Predicate:
        """Return the predicate of a named class."""
        found = self.classes.get(iri)
        if found is None:
            found = self.classes[iri] = Predicate('class', iri, iri)
        return found

    def object(self, iri: str) -> Predicate:
        """Return the predicate of an object property."""
        found = self.objects.get(iri)
        if found is None:
            found = self.objects[iri] = Predicate('object', iri, iri)
        return found

    def data(self, iri: str) -> Predicate:
        """Return the predicate of a data property."""
        found = self.datas.get(iri)
        if found is None:
            found = self.datas[iri] = Predicate('data', iri, iri)
        return found

    def predicates(self) -> Iterator[Predicate]:
        """Yield every predicate with an extension."""
        yield from (self.thing, self.nothing, self.apart)
        yield from self.classes.values()
        yield from self.objects.values()
        yield from self.datas.values()
        yield from self.labels.values()
        yield from self.negatives.values()


def with_predicates(record: T, predicate: Callable[[Predicate], Predicate]) -> T:
    """Return a clause, an atom or a condition with what `predicate` gives for its predicates."""
    changed: dict[str, Any] = {}
    for name in record.__slots__:  # type: ignore[attr-defined]
        value = getattr(record, name)
        if isinstance(value, Predicate):
            other: Any = predicate(value)
        elif name == 'body':
            other = tuple([with_predicates(atom, predicate) for atom in value])
        elif name == 'head':
            other = with_predicates(value, predicate)
        else:
            continue
        if other is not value and other != value:
            changed[name] = other
    return replace(record, **changed) if changed else record  # type: ignore[type-var]


def closure(start: T, following: Callable[[T], Iterable[T]]) -> dict[T, None]:
    """Return what is reached from `start` by following again and again, itself included."""
    found = {start: None}
    pending = [start]
    while pending:
        for other in following(pending.pop()):
            if other not in found:
                found[other] = None
                pending.append(other)
    return found


def turned(role: tuple[T, bool]) -> tuple[T, bool]:
    """Return a property, and whether it is inverted, in the other direction."""
    return role[0], not role[1]


def property_atom(program: Program, prop: PropertyExpression, x: Term, y: Term) -> PredicateAtom:
    """Return the atom `prop(x, y)`, an inverse turned round."""
    if isinstance(prop, str):
        return PredicateAtom(program.object(prop), (x, y))
    return PredicateAtom(program.object(prop.prop), (y, x))
