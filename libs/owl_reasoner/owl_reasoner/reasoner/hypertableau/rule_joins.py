"""Rules about named individuals in reasoning by cases: those of SWRL, and keys.

A model says of everything whether it holds, so what a body asks for and the model leaves open
becomes one more alternative beside the head: that two individuals are the same, that a value is not
among those asked for. Motik, Sattler and Studer, "Query answering for OWL-DL with rules", Journal
of Web Semantics 3 (2005), show that rules about named individuals keep reasoning decidable.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from fractions import Fraction
from typing import Any, NamedTuple, TypeAlias

from owl_reasoner.owl.axiom_text import axiom_text
from owl_reasoner.owl.axioms import Axiom
from owl_reasoner.owl.expressions import DatatypeRestriction, Literal
from owl_reasoner.owl.vocabulary import OWL, XSD, is_anonymous
from owl_reasoner.reasoner.clauses import (
    ComputedAtom,
    Constant,
    DifferentAtom,
    RangeAtom,
    SameAtom,
    Term,
)
from owl_reasoner.reasoner.datatypes import Value, literal_of
from owl_reasoner.reasoner.hypertableau.dl_clauses import (
    ANYBODY,
    Asked,
    FactAtom,
    NamedAtom,
    NamedRule,
    OfChain,
    OfConcept,
    OfProp,
    OfRole,
)
from owl_reasoner.reasoner.hypertableau.model import (
    Alternative,
    Apart,
    CaseModel,
    Choices,
    Either,
    Gains,
    Has,
    In,
    Related,
    Same,
    Valued,
    still_open,
)
from owl_reasoner.reasoner.joins import join_order
from owl_reasoner.reasoner.value_sets import NONE, ValueSet, point, value_set

MOST_TRIED = 300
"""Where so many values are possible, each of them is tried."""
_FEW = 4
"""So many holders of a property are looked at before a join with its values."""
_MOST_VALUES = 20_000
"""Of more possible values one can be chosen that is no other individual's."""
_COMPARISONS = {
    'lessThan': ('maxExclusive', 'minExclusive'),
    'lessThanOrEqual': ('maxInclusive', 'minInclusive'),
    'greaterThan': ('minExclusive', 'maxExclusive'),
    'greaterThanOrEqual': ('minInclusive', 'maxInclusive'),
}
"""Built-ins, with the facet for a number as second and as first argument."""


class _Known(NamedTuple):
    """A value that a rule computed."""

    value: Value


_Given: TypeAlias = 'dict[Term, Any]'
"""What terms stand for: individuals and values of the model by number, or a `_Known`."""


class _Match(NamedTuple):
    """What a part of a body stands for, by which choices, unless one of the alternatives holds."""

    given: _Given
    choices: Choices
    against: tuple[Alternative, ...]


class CaseJoins:
    """Applies the rules about named individuals.

    Args:
        model: Where they apply.
        either: Takes what is open.

    Attributes:
        gaps: What was not decided.
    """

    def __init__(self, model: CaseModel, either: Either) -> None:
        self._model, self._either = model, either
        self.gaps: dict[str, None] = {}
        self._origin: Axiom
        self._of_concept: dict[int, list[_Plan]] = {}
        self._of_role: dict[int, list[_Plan]] = {}
        self._of_prop: dict[str, list[_Plan]] = {}
        for rule in model.rules.named:
            for atom in rule.body:
                # A plan for each atom that facts can make true: whichever comes last begins the
                # join (semi-naive evaluation inside the search).
                if isinstance(atom, FactAtom):
                    order = _ordered(rule.body, atom)
                    props = tuple({one.prop for one in order if isinstance(one, OfProp)})
                    self._index(_Plan(rule, atom, order, props))

    def _index(self, plan: _Plan) -> None:
        atom = plan.atom
        if isinstance(atom, OfConcept):
            self._of_concept.setdefault(atom.concept, []).append(plan)
        elif isinstance(atom, OfProp):
            self._of_prop.setdefault(atom.prop, []).append(plan)
        elif isinstance(atom, OfRole):
            self._of_role.setdefault(atom.role, []).append(plan)
        else:
            for concept in atom.concepts.values():
                self._of_concept.setdefault(concept, []).append(plan)

    # --- what is new ---

    def on_concept(self, x: int, concept: int) -> None:
        """Apply the rules about a concept to an individual that got it."""
        model = self._model
        if concept in model.rules.nominals and model.names[x] and model.rules.named:
            # Who got a name takes part with all that is known of it.
            for other in tuple(model.labels[x]):
                self._concept(x, other)
            for y, roles in tuple(model.out[x].items()):
                for role in tuple(roles):
                    self.on_relation(x, role, y)
            self.on_values(x)
        else:
            self._concept(x, concept)

    def _concept(self, x: int, concept: int) -> None:
        model = self._model
        for plan in self._of_concept.get(concept, ()):
            atom, choices = plan.atom, model.labels[x][concept]
            if isinstance(atom, OfChain):
                iri = next(iri for iri, one in atom.concepts.items() if one == concept)
                y, more = model.individual(iri)
                self._apply(plan, (x, y), choices | more)
            else:
                self._apply(plan, (x,), choices)

    def on_relation(self, x: int, role: int, y: int) -> None:
        """Apply the rules about a role to two individuals that are related by it."""
        for one, way, other in ((x, role, y), (y, -role, x)):
            for plan in self._of_role.get(way, ()):
                choices = self._model.out[one].get(other, {}).get(way)
                if choices is not None:
                    self._apply(plan, (one, other), choices)

    def on_values(self, x: int) -> None:
        """Apply the rules about values to those of an individual."""
        model = self._model
        if not self._of_prop or not model.names[x]:
            return
        for v in tuple(model.values[x]):
            for prop in tuple(model.props[v]):
                for plan in self._of_prop.get(prop, ()):
                    if not model.is_gone(v):
                        self._apply(plan, (x, v), model.props[v][prop])

    # --- joins ---

    def _apply(self, plan: _Plan, nodes: tuple[int, ...], choices: Choices) -> None:
        """Apply a rule wherever the atom that the plan begins with stands for certain nodes."""
        model = self._model
        if any(map(model.is_gone, nodes)) or not all(_may_hold(model, p) for p in plan.props):
            return
        self._origin = plan.rule.origin
        self._model.budget.at_work = self._name_rule
        found = [_Match({}, choices, ())]
        for term, node in zip(plan.atom.terms, nodes, strict=True):
            found = [more for match in found for more in self._bind(match, term, node)]
        # All at once: what a match states may change what the atoms are compared with.
        for match in [match for first in found for match in self._joined(plan.order, 0, first)]:
            self._model.step()
            self._fire(plan.rule, match)

    def _joined(self, order: tuple[NamedAtom, ...], place: int, match: _Match) -> Iterator[_Match]:
        """Return the ways in which all atoms from a place on hold."""
        self._model.budget.tick()
        if place == len(order):
            yield match
            return
        for more in self._ways(order[place], match):
            yield from self._joined(order, place + 1, more)

    def _name_rule(self) -> str:
        return axiom_text(self._origin)

    def _bind(self, match: _Match, term: Term, node: Any) -> Iterator[_Match]:
        """Let a term stand for an individual, where it may; values are compared by `_equal`."""
        is_value = isinstance(node, _Known) or node in self._model.sets
        if isinstance(term, Constant) and term.is_value:
            yield from self._within(match, node, point(term.value))
        elif isinstance(term, Constant):
            x, choices = self._model.individual(str(term.value))
            if x == node:
                yield match._replace(choices=match.choices | choices)
        elif term not in match.given:
            choices = 0
            if not is_value:
                named = self._named(node)
                if named is None:
                    return
                choices = named
            yield _Match({**match.given, term: node}, match.choices | choices, match.against)
        elif is_value:
            yield from self._equal(match, match.given[term], node)
        elif match.given[term] == node:
            yield match

    def _named(self, x: int, is_key: bool = False) -> Choices | None:
        """Return the choices by which an individual has a name, for a key an IRI; None where it
        has none.
        """
        model = self._model
        labels, nominals = model.labels[x], model.rules.nominal_of
        if not is_key and len(model.names[x]) == 1:
            return labels[nominals[model.names[x][0]]]
        names = (name for name in model.names[x] if not (is_key and is_anonymous(name)))
        return min((labels[nominals[name]] for name in names), default=None)

    def _node(self, match: _Match, term: Term) -> tuple[int, Choices] | None:
        """Return the individual that a term stands for; None where that is open."""
        if isinstance(term, Constant):
            return self._model.individual(str(term.value))
        return (match.given[term], 0) if term in match.given else None

    def _holders(self, match: _Match, atom: OfProp) -> list[int]:
        """Return named individuals among whom are all that may have the value of an atom."""
        model, term = self._model, atom.terms[1]
        is_constant = isinstance(term, Constant)
        if not is_constant and term not in match.given:
            return self._having(atom.prop)
        only = term.value if isinstance(term, Constant) else self._set(match.given[term])[0].only
        if only is None:
            return self._having(atom.prop)
        # By the value, not by everybody: beside those that have it only those whose value is open
        # may turn out to.
        values = (*model.holding.get(only, ()), *model.holding[None])
        owners = dict.fromkeys(model.owner[v] for v in values if not model.is_gone(v))
        return [x for x in owners if not model.is_gone(x) and model.names[x]]

    def _having(self, what: Asked) -> list[int]:
        """Return named individuals among whom are all that have something."""
        model = self._model
        if what == ANYBODY:
            return self._everybody()
        return [x for x in model.having[what] if model.names[x] and not model.is_gone(x)]

    def _everybody(self) -> list[int]:
        return [x for x in self._model.alive() if self._model.names[x]]

    def _ways(self, atom: NamedAtom, match: _Match) -> Iterator[_Match]:
        """Return the ways in which an atom holds."""
        if isinstance(atom, RangeAtom):
            yield from self._within(match, match.given[atom.terms[0]], atom.values)
        elif isinstance(atom, ComputedAtom):
            yield from self._computed(atom, match)
        elif isinstance(atom, SameAtom | DifferentAtom):
            yield from self._compared_individuals(atom, match)
        elif isinstance(atom, OfConcept):
            known = self._node(match, atom.terms[0])
            for x in self._having(atom.concept) if known is None else (known[0],):
                choices = self._model.labels[x].get(atom.concept)
                if choices is not None:
                    more = match._replace(choices=match.choices | choices)
                    yield from self._bind(more, atom.terms[0], x)
        else:
            known = self._node(match, atom.terms[0])
            end = None if isinstance(atom, OfProp) else self._node(match, atom.terms[1])
            if known is not None:
                starts: Iterable[int] = (known[0],)
            elif end is not None and isinstance(atom, OfRole):
                starts = self._model.out[end[0]]
            elif isinstance(atom, OfProp):
                starts = self._holders(match, atom)
            elif isinstance(atom, OfRole):
                starts = self._having(('role', atom.role))
            else:
                starts = self._everybody()
            for x in starts:
                for bound in self._bind(match, atom.terms[0], x):
                    for y, choices in self._ends(atom, x, None if end is None else end[0]):
                        more = _Match(bound.given, bound.choices | choices, bound.against)
                        yield from self._bind(more, atom.terms[1], y)

    def _ends(
        self, atom: OfRole | OfChain | OfProp, x: int, end: int | None
    ) -> Iterator[tuple[int, Choices]]:
        """Return what an individual is related to (`end`, where it is known), by which choices."""
        model = self._model
        if isinstance(atom, OfProp):
            if x in model.rejoin:
                return  # Its values are new, and joined with all others when it is their turn.
            for v in model.values[x]:
                if atom.prop in model.props[v]:
                    yield v, model.props[v][atom.prop]
        elif isinstance(atom, OfRole):
            for y in model.out[x] if end is None else (end,):
                choices = model.out[x].get(y, {}).get(atom.role)
                if choices is not None:
                    yield y, choices
        else:
            labels = model.labels[x]
            for iri in atom.concepts if end is None else model.names[end]:
                choices = labels.get(atom.concepts[iri])
                if choices is not None:
                    y, more = model.individual(iri)
                    yield y, choices | more

    def _compared_individuals(
        self, atom: SameAtom | DifferentAtom, match: _Match
    ) -> Iterator[_Match]:
        (x, one), (y, other) = (self._node(match, term) or (0, 0) for term in atom.terms)
        choices = match.choices | one | other
        if isinstance(atom, SameAtom):
            if x == y:
                yield match._replace(choices=choices)
        elif x != y:
            apart = self._model.different(x, y)
            if apart is not None:
                yield match._replace(choices=choices | apart)
            else:
                # Whether they differ is open: the rule becomes an alternative to their being the
                # same.
                against = (*match.against, Same(x, y))
                yield match._replace(choices=choices, against=against)

    # --- values, which need not be known ---

    def _set(self, one: Any) -> tuple[ValueSet, Choices]:
        """Return the set that a value is in."""
        return (point(one.value), 0) if isinstance(one, _Known) else self._model.sets[one]

    def _within(self, match: _Match, one: Any, values: ValueSet) -> Iterator[_Match]:
        """Let a value be in a set, where it may."""
        there, choices = self._set(one)
        if there.within(values):
            yield match._replace(choices=match.choices | choices)
        elif not (there & values).is_empty:
            yield match._replace(against=(*match.against, In(one, ~values)))

    def _equal(self, match: _Match, one: Any, other: Any) -> Iterator[_Match]:
        """Let two values be the same, where they may.

        Of many possible values one can be chosen that is no other: then they are not the same.
        """
        if one == other:
            yield match
            return
        (first, choices), (second, more) = self._set(one), self._set(other)
        if (first & second).is_empty or max(first.size, second.size) > _MOST_VALUES:
            return
        if first.size == 1:
            for found in self._within(match, other, first):
                yield found._replace(choices=found.choices | choices)
        elif second.size == 1:
            for found in self._within(match, one, second):
                yield found._replace(choices=found.choices | more)
        else:
            self._try_values(min(one, other, key=lambda v: self._set(v)[0].size))

    def _try_values(self, v: int) -> None:
        """Try each value of a set; the rule is looked at again then."""
        values, choices = self._model.sets[v]
        if values.size > MOST_TRIED:
            what = 'whether unknown values are those that it asks for is not decided'
            self.gaps[f'{axiom_text(self._origin)}: {what}'] = None
            return
        self._either([In(v, point(value)) for value in values.members()], choices)

    def _computed(self, atom: ComputedAtom, match: _Match) -> Iterator[_Match]:
        """Let a built-in hold, where it may."""
        first = atom.terms[0]
        solving = isinstance(first, int) and first not in match.given
        terms = atom.terms[1:] if solving else atom.terms
        values: dict[Term, Value] = {}
        unknown: list[Term] = []
        choices, given, sets = match.choices, match.given, self._model.sets
        for term in terms:
            if isinstance(term, Constant):
                values[term] = term.value
                continue
            node = given[term]
            if isinstance(node, _Known):
                values[term] = node.value
                continue
            there, more = sets[node]
            if there.only is None:
                unknown.append(term)
            else:
                values[term] = there.only
                choices |= more
        if unknown:
            match = match._replace(choices=choices)
            yield from self._open_computed(atom, match, unknown, values)
        elif solving:
            assert atom.solve is not None
            for value in atom.solve(*[values[term] for term in terms]):
                yield _Match({**given, first: _Known(value)}, choices, match.against)
        elif atom.holds(*[values[term] for term in terms]):
            yield _Match(given, choices, match.against)

    def _open_computed(
        self, atom: ComputedAtom, match: _Match, unknown: list[Term], values: dict[Term, Value]
    ) -> Iterator[_Match]:
        """Let a built-in hold whose arguments are not all known."""
        # What computes may have a first argument that nothing binds yet, and is no comparison.
        if atom.solve is None and len(unknown) == 1:
            terms = tuple(
                term if term in unknown else Constant(values[term], True) for term in atom.terms
            )
            asked = compared(ComputedAtom(atom.builtin, atom.holds, None, terms), unknown[0])
            if asked is not None:
                yield from self._within(match, match.given[unknown[0]], asked)
                return
        self._try_values(
            min((match.given[term] for term in unknown), key=lambda v: self._set(v)[0].size)
        )

    # --- what follows ---

    def _fire(self, rule: NamedRule, match: _Match) -> None:
        self._origin = rule.origin
        head = rule.head
        alternatives = list(match.against)
        choices = match.choices
        if rule.is_key:
            for node in match.given.values():
                if not isinstance(node, _Known) and node not in self._model.sets:
                    named = self._named(node, is_key=True)
                    if named is None:
                        return
                    choices |= named
        if head is not None:
            nodes: list[Any] = []
            for term in head.terms:
                if isinstance(term, Constant) and term.is_value:
                    nodes.append(_Known(term.value))
                elif isinstance(term, Constant):
                    node, more = self._model.individual(str(term.value))
                    nodes.append(node)
                    choices |= more
                else:
                    nodes.append(match.given[term])
            stated = self._stated(head, nodes)
            if stated is None:
                return
            alternatives.append(stated[0])
            choices |= stated[1]
        found = still_open(self._model, alternatives, choices)
        if found is not None:
            self._either(*found)

    def _stated(self, head: Any, nodes: list[Any]) -> tuple[Alternative, Choices] | None:
        """Return what a head states of nodes, by which choices; None where a value is tried
        first.
        """
        if isinstance(head, OfConcept):
            return Has(nodes[0], head.concept), 0
        if isinstance(head, OfRole):
            return Related(nodes[0], head.role, nodes[1]), 0
        if isinstance(head, SameAtom):
            return Same(*nodes), 0
        if isinstance(head, DifferentAtom):
            return Apart(*nodes), 0
        x, v = nodes
        values, choices = self._set(v)
        if values.size == 1:
            return Valued(x, head.prop, values), choices
        if self._model.owner[v] == x:
            return Gains(v, head.prop), 0
        self._try_values(v)
        return None


class _Plan(NamedTuple):
    """A rule, the atom that something new fits, and the other atoms in the order of their joins;
    `props` are the data properties in these.
    """

    rule: NamedRule
    atom: FactAtom
    order: tuple[NamedAtom, ...]
    props: tuple[str, ...]


def _may_hold(model: CaseModel, prop: str) -> bool:
    """Tell whether anybody may have a value by a property that is joined already."""
    having, rejoin = model.having[prop], model.rejoin
    # Where many have one it costs more to look than to join.
    return len(having) > _FEW or any(x not in rejoin for x in having)


def _ordered(body: Iterable[NamedAtom], given: FactAtom) -> tuple[NamedAtom, ...]:
    """Return the other atoms of a body, each after those that bind its terms."""
    bound: set[Term] = {term for term in given.terms if isinstance(term, int)}
    order: list[NamedAtom] = []
    for atom in join_order((atom for atom in body if atom is not given), bound, _kind):
        order.append(atom)
        bound.update(term for term in atom.terms if isinstance(term, int))
    return tuple(order)


def _kind(atom: NamedAtom) -> str | None:
    if isinstance(atom, OfConcept):
        return 'class'
    if isinstance(atom, OfProp):
        return 'data'
    return 'object' if isinstance(atom, FactAtom) else None


def compared(atom: ComputedAtom, value: Term) -> ValueSet | None:
    """Return the values of a term for which a comparison with a number holds; None for others."""
    facets = _COMPARISONS.get(atom.builtin)
    number = atom.terms[atom.terms[0] == value]
    bound = number.value if isinstance(number, Constant) else None
    if facets is None or not isinstance(bound, int | Fraction):
        return None
    facet = XSD + facets[atom.terms[0] != value]
    found = NONE
    for datatype in (OWL + 'real', XSD + 'float', XSD + 'double'):
        limit = literal_of(bound)
        if datatype != OWL + 'real':
            try:
                limit = Literal(repr(float(bound)), datatype)
            except OverflowError:
                return None
        values = value_set(DatatypeRestriction(datatype, ((facet, limit),)))
        if values is None:
            return None
        found |= values
    return found
