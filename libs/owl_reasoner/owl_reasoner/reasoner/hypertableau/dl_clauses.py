"""Axioms as rules with alternatives, for reasoning by cases.

A rule says: whoever has all these concepts (and is related to somebody, or has a value, with those)
has one of these concepts, or one of them belongs to the other. Complex classes get concepts of
their own (Motik, Shearer and Horrocks, "Hypertableau reasoning for description logics", JAIR 2009,
section 4.1): `positive` ones imply the class, `recognised` ones are implied by it. Concepts and
roles are numbers; everybody has concept 0, and a negative role is the inverse. Chains become
automata (`property_chains`).
"""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import dataclass
from itertools import count
from typing import Any, NamedTuple, TypeAlias, TypeVar

from owl_reasoner.owl import axioms as ax
from owl_reasoner.owl import expressions as ex
from owl_reasoner.owl.axiom_text import axiom_text, expression_text
from owl_reasoner.owl.axioms import Axiom
from owl_reasoner.owl.entities import entities_of
from owl_reasoner.owl.expressions import ClassExpression, PropertyExpression
from owl_reasoner.owl.vocabulary import (
    BOTTOM,
    BOTTOM_DATA,
    NOTHING,
    THING,
    TOP,
    TOP_DATA,
)
from owl_reasoner.reasoner.budget import Budget
from owl_reasoner.reasoner.clauses import (
    ComputedAtom,
    Constant,
    DifferentAtom,
    RangeAtom,
    SameAtom,
    Term,
    UnsupportedError,
    closure,
    turned,
)
from owl_reasoner.reasoner.hypertableau.roles import Roles
from owl_reasoner.reasoner.inclusions import class_inclusions, directed
from owl_reasoner.reasoner.normal_form import normal_form
from owl_reasoner.reasoner.rules import RuleTerms, computed_atom, safe_body
from owl_reasoner.reasoner.value_sets import EVERY, ValueSet, values_of

_X, _Y = 0, 1
Heads = tuple[tuple[int, int], ...]
"""Alternatives: pairs of place (0: the individual, 1: the related one) and concept."""
FRESH = 'urn:case:'
"""Names that begin so are no ontology's; an individual with one is unnamed."""
_MOST = 300
ANYBODY = 0
"""The concept of owl:Thing."""
_ALL = frozenset((ANYBODY,))


@dataclass(frozen=True, slots=True)
class NodeClause:
    """Whoever has the concepts has one of the heads."""

    body: frozenset[int]
    heads: Heads


@dataclass(frozen=True, slots=True)
class EdgeClause:
    """For x related to y by the role, with concepts of both: one of the heads."""

    xs: frozenset[int]
    role: int
    ys: frozenset[int]
    heads: Heads


@dataclass(frozen=True, slots=True)
class ValueClause:
    """For x with a value in `values`: one of the heads; `rest` is what is not in `values`."""

    xs: frozenset[int]
    values: ValueSet
    rest: ValueSet
    heads: Heads


@dataclass(frozen=True, slots=True)
class Count:
    """At least, or at most, `n` by the role with the concept."""

    n: int
    role: int
    concept: int


@dataclass(frozen=True, slots=True)
class ValueCount:
    """At least, or at most, `n` values in a set by a data property."""

    n: int
    prop: str
    values: ValueSet


_Counted = TypeVar('_Counted', Count, ValueCount)


class OfConcept(NamedTuple):
    """An individual has a concept."""

    concept: int
    terms: tuple[Term]


class OfRole(NamedTuple):
    """An individual is related to another one."""

    role: int
    terms: tuple[Term, Term]


class OfChain(NamedTuple):
    """An individual has the concept of whoever is related, along a chain, to another one."""

    concepts: dict[str, int]
    terms: tuple[Term, Term]


class OfProp(NamedTuple):
    """An individual has a value by a data property."""

    prop: str
    terms: tuple[Term, Term]


FactAtom: TypeAlias = OfConcept | OfRole | OfChain | OfProp
Asked: TypeAlias = 'int | str | tuple[str, int]'
"""A concept, a data property, or with 'role' before it a role."""
NamedAtom: TypeAlias = FactAtom | RangeAtom | SameAtom | DifferentAtom | ComputedAtom


@dataclass(frozen=True, slots=True)
class NamedRule:
    """For named individuals of whom the body holds, the head does; None: the body never holds."""

    body: tuple[NamedAtom, ...]
    head: OfConcept | OfRole | OfProp | SameAtom | DifferentAtom | None
    origin: Axiom
    is_key: bool = False
    """Whether anonymous individuals take no part (OWL 2 Structural Specification, 9.5)."""


class DLClauses:
    """The rules of an ontology's axioms; assertions are passed over.

    Many attributes because each is one index of the same clauses, which the search reads in its
    innermost loop; a record between them would cost it a look-up each.

    Attributes:
        names: The classes and individuals of concepts: IRI by number, '' for the others.
        always: Heads one of which everybody has.
        of_node: Node rules by each concept of the body.
        excluded: Sets of concepts with all of which a concept has no members.
        by_role, by_source, by_target: Edge rules by role, and by each concept of x and of y.
        by_prop: Value rules by data property; `of_values` by each concept of x.
        at_least, at_most, values_at_least, values_at_most: What a concept counts.
        counted_by: The concepts in `at_most` that count members of a concept.
        functional, functional_values: Counts that hold for everybody.
        loops: Concepts that relate their members to themselves, and the role.
        marks: Concepts of whoever is related to itself by a role.
        nominals: Concepts of one individual; `nominal_of` the other way.
        roles: Its properties, and what each implies.
        disjoint, disjoint_props: Roles (data properties) that exclude each other.
        named: Rules about named individuals: those of SWRL, and keys.
        asked: The concepts, data properties and roles that stand in their bodies.
        gaps: One sentence for each axiom that is not fully covered.
        tested: One for each with a range that single values alone can be tested for.
        budget: What the search may use.
    """

    def __init__(self, axioms: Iterable[Axiom], budget: Budget | None = None) -> None:
        self.budget = budget or Budget()
        self.budget.at_work = self._subject
        axioms = list(axioms)
        tbox = [axiom for axiom in axioms if not isinstance(axiom, (ax.Assertion, ax.Annotation))]
        self.names: list[str] = ['']
        self._numbers: dict[str, int] = {}
        self.roles = Roles()
        self.always: list[Heads] = []
        self.of_node: dict[int, list[NodeClause]] = {}
        self.excluded: dict[int, list[frozenset[int]]] = {}
        self.by_role: dict[int, list[EdgeClause]] = {}
        self.by_source: dict[int, list[EdgeClause]] = {}
        self.by_target: dict[int, list[EdgeClause]] = {}
        self.by_prop: dict[str, list[ValueClause]] = {}
        self._ranges: dict[str, ValueSet] = {}
        self.of_values: set[int] = set()
        self.at_least: dict[int, Count] = {}
        self.at_most: dict[int, Count] = {}
        self.values_at_least: dict[int, ValueCount] = {}
        self.values_at_most: dict[int, ValueCount] = {}
        self.counted_by: dict[int, set[int]] = {}
        self.functional: list[Count] = []
        self.functional_values: list[ValueCount] = []
        self.loops: dict[int, int] = {}
        self.marks: dict[int, list[int]] = {}
        self.nominals: dict[int, str] = {}
        self.nominal_of: dict[str, int] = {}
        self.disjoint: dict[int, set[int]] = {}
        self.disjoint_props: dict[str, dict[str, None]] = {}
        self.named: list[NamedRule] = []
        self.gaps: dict[str, None] = {}
        self.tested: dict[str, None] = {}
        self._origin: Axiom | None = None
        self._positive: dict[ClassExpression, int] = {}
        self._recognised: dict[ClassExpression, int] = {}
        self._counts: dict[object, int] = {}
        self._datatypes = {
            a.datatype: a.range for a in tbox if isinstance(a, ax.DatatypeDefinition)
        }
        entities = [entity for axiom in axioms for entity in entities_of(axiom)]
        individuals = (iri for kind, iri in entities if kind == 'individual')
        self._named_rules = _NamedRules(self, individuals)
        for axiom in tbox:
            self._attempt(axiom, self.roles.take)
        self._top_and_bottom({iri for _, iri in entities})
        for axiom in tbox:
            self._attempt(axiom, self.roles.check)
            self._attempt(axiom, self._axiom)
        self._origin = None
        self._common_consequences()
        self.asked: dict[Asked, None] = {}
        for rule in self.named:
            for atom in rule.body:
                if isinstance(atom, OfConcept) and atom.concept != ANYBODY:
                    self.asked[atom.concept] = None
                elif isinstance(atom, OfProp):
                    self.asked[atom.prop] = None
                elif isinstance(atom, OfRole):
                    self.asked['role', atom.role] = None

    def _attempt(self, axiom: Axiom, take: Callable[[Axiom], None]) -> None:
        self._origin = axiom
        self.budget.tick()
        try:
            take(axiom)
        except UnsupportedError as reason:
            self.gaps[f'{axiom_text(axiom)}: {reason}'] = None

    def _common_consequences(self) -> None:
        """Add what all alternatives of a rule imply: it takes no cases.

        Without it a chain of unions, each alternative of which implies the next union, is searched
        in exponential time when its end is denied: no contradiction rests on a single choice.
        """
        single: dict[int, list[int]] = {}
        wide: list[tuple[frozenset[int], Heads]] = [(_ALL, heads) for heads in self.always]
        for rule in dict.fromkeys(rule for rules in self.of_node.values() for rule in rules):
            if len(rule.heads) > 1:
                wide.append((rule.body, rule.heads))
            elif len(rule.body) == len(rule.heads) == 1:
                (concept,) = rule.body
                single.setdefault(concept, []).append(rule.heads[0][1])
        if not single:
            return
        for body, heads in wide:
            above = [closure(concept, lambda one: single.get(one, ())) for _, concept in heads]
            common = [one for one in above[0] if all(one in others for others in above[1:])]
            for concept in common:
                # What another one of them implies needs no rule of its own.
                if not any(
                    concept in single.get(other, ()) for other in common if other != concept
                ):
                    self.node_rule(body, ((_X, concept),))
                    if len(body) == 1 and body != _ALL:
                        single.setdefault(next(iter(body)), []).append(concept)

    def _subject(self) -> str:
        return '' if self._origin is None else axiom_text(self._origin)

    # --- numbers ---

    def concept(self, iri: str) -> int:
        """Return the number of a named class."""
        number = self._numbers.get(iri)
        if number is None:
            number = self._numbers[iri] = len(self.names)
            self.names.append('' if iri.startswith(FRESH) else iri)
            if iri == NOTHING:
                self.node_rule(frozenset((number,)), ())
        return number

    def fresh(self) -> str:
        """Return a name for a concept of its own."""
        return f'{FRESH}{len(self.names)}'

    def nominal(self, individual: str) -> int:
        """Return the concept of one individual."""
        number = self.nominal_of.get(individual)
        if number is None:
            number = self.concept(self.fresh())
            self.nominal_of[individual] = number
            self.nominals[number] = individual
        return number

    def range_of(self, prop: str) -> ValueSet:
        """Return the values of a data property that its ranges leave to everybody."""
        found = self._ranges.get(prop)
        if found is None:
            found = EVERY
            for one in self.roles.data_above(prop):
                for rule in self.by_prop.get(one, ()):
                    if rule.xs == _ALL and not rule.heads:
                        found &= rule.rest
            self._ranges[prop] = found
        return found

    @property
    def is_pairwise(self) -> bool:
        """Whether an individual is blocked only together with the one that it was made for."""
        return self.roles.has_inverse and bool(self.at_most or self.functional)

    # --- concepts of expressions ---

    def positive(self, expression: ClassExpression) -> int:
        """Return a concept whose members are in the class."""
        return self._named(expression, self._positive, self.include)

    def recognised(self, expression: ClassExpression) -> int:
        """Return a concept that all members of the class have."""
        return self._named(
            expression, self._recognised, lambda name, found: self.include(found, name)
        )

    def _named(
        self,
        expression: ClassExpression,
        known: dict[ClassExpression, int],
        define: Callable[[str, ClassExpression], None],
    ) -> int:
        expression = normal_form(expression)
        if expression == THING:
            return ANYBODY
        if isinstance(expression, str):
            return self.concept(expression)
        if isinstance(expression, ex.ObjectOneOf):
            return self.nominal(expression.individuals[0])
        if isinstance(expression, ex.ObjectHasSelf):
            return (
                self.mark(expression.prop)
                if known is self._recognised
                else self.loop(expression.prop)
            )
        if expression not in known:
            name = self.fresh()
            # A structural transformation that keeps polarity (Plaisted and Greenbaum, 1986): where
            # a class only implies, its concept gets that half of the definition alone, and no
            # search is made for the other.
            known[expression] = self.concept(name)  # first: the class may contain itself
            define(name, expression)
        return known[expression]

    def counted(self, table: dict[int, _Counted], count: _Counted) -> int:
        """Return the concept of whoever has so many."""
        key = (id(table), count)
        known = self._counts.get(key)
        if known is None:
            if count.n > _MOST:
                raise UnsupportedError(f'numbers above {_MOST} are not counted by cases')
            known = self._counts[key] = self.concept(self.fresh())
            table[known] = count
            if isinstance(count, Count):
                self.counted_by.setdefault(count.concept, set()).add(known)
        return known

    def values(self, data_range: ex.DataRange) -> ValueSet:
        """Return the values of a data range."""
        try:
            found = values_of(data_range, self._datatypes)
        except ValueError as error:
            raise UnsupportedError(str(error)) from None
        if not found.decided:
            subject = f'assertions with {expression_text(data_range)}'
            if self._origin is not None:
                subject = axiom_text(self._origin)
            untold = 'a pattern, a type of strings or a bound of dates'
            what = f'whether values suit {untold} is not decided'
            self.tested[f'{subject}: {what}'] = None
        return found

    # --- inclusions ---

    def include(self, sub: ClassExpression, sup: ClassExpression) -> None:
        """Add the rules by which members of one class are members of another."""
        _Clausifier(self).add(normal_form(ex.ObjectUnionOf((ex.ObjectComplementOf(sub), sup))))

    def node_rule(self, body: frozenset[int], heads: Heads) -> None:
        """Add a rule about one individual."""
        body = body - _ALL or _ALL
        # A tautology.
        if any(concept == ANYBODY or concept in body for _, concept in heads):
            return
        # It is a choice for every individual. What absorption (Horrocks and Tobies, KR 2000) can
        # turn into a rule with a body has one by now (`_Clausifier`).
        if body == _ALL and len(heads) > 1:
            self.always.append(heads)
            return
        rule = NodeClause(body, heads)
        for concept in body:
            self.of_node.setdefault(concept, []).append(rule)
            if not heads:
                self.excluded.setdefault(concept, []).append(body - {concept})

    def edge_rule(self, rule: EdgeClause) -> None:
        """Add a rule about related individuals."""
        if any(concept == ANYBODY for _, concept in rule.heads):
            return
        self.by_role.setdefault(rule.role, []).append(rule)
        for concept in rule.xs - _ALL:
            self.by_source.setdefault(concept, []).append(rule)
        for concept in rule.ys - _ALL:
            self.by_target.setdefault(concept, []).append(rule)

    def value_rule(self, prop: str, xs: frozenset[int], values: ValueSet, heads: Heads) -> None:
        """Add a rule about values."""
        if prop == TOP_DATA:
            self.node_rule(xs, heads if self._size(values) else ((_X, ANYBODY),))
        elif not values.is_empty:
            self.by_prop.setdefault(prop, []).append(ValueClause(xs, values, ~values, heads))
            self.of_values |= xs - _ALL

    def value_count(self, table: dict[int, ValueCount], count: ValueCount) -> int:
        """Return the concept of whoever has so many values."""
        if count.prop != TOP_DATA:
            return self.counted(table, count)
        size = self._size(count.values)
        is_met = size <= count.n if table is self.values_at_most else size >= count.n
        return ANYBODY if is_met else self.concept(NOTHING)

    def _size(self, values: ValueSet) -> float:
        """Return how many values owl:topDataProperty has in a set: everybody has every value."""
        if not values.decided:
            raise UnsupportedError('owl:topDataProperty has values of a range that is not counted')
        return values.size

    def universal(self, concept: int, prop: PropertyExpression, target: int) -> None:
        """Add the rules by which whoever a member is related to has another concept."""
        body = frozenset((concept,))
        if not self.roles.is_complex(prop):
            self.edge_rule(EdgeClause(body, self.roles.number(prop), _ALL, ((_Y, target),)))
            return
        # A box over a complex role walks the automaton of its chains (Horrocks and Sattler,
        # "Decidability of SHIQ with complex role inclusion axioms", 2004): a concept for each
        # state, passed on with each step.
        steps = self.roles.automaton(prop)
        states: dict[int, int] = {}
        if concept == ANYBODY:
            # Everybody is in the states that are reached without a step.
            free = [(before, after) for before, step, after in steps if step is None]
            at_once = closure(0, lambda here: [after for before, after in free if before == here])
            states.update(dict.fromkeys(at_once, ANYBODY))
        for before, _, after in steps:
            for number in (before, after):
                if number not in states:
                    states[number] = self.concept(self.fresh())
        # State 0 may be entered again, so it is not the concept itself.
        self.node_rule(body, ((_X, states[0]),))
        self.node_rule(frozenset((states[1],)), ((_X, target),))
        for before, step, after in steps:
            here, there = frozenset((states[before],)), states[after]
            if step is None:
                self.node_rule(here, ((_X, there),))
            else:
                self.edge_rule(EdgeClause(here, step, _ALL, ((_Y, there),)))

    def mark(self, prop: PropertyExpression) -> int:
        """Return a concept of whoever is related to itself by the role."""
        if directed(prop)[0] == TOP:
            return ANYBODY
        if self.roles.is_complex(prop):
            raise UnsupportedError('a property with chains is asked for itself')
        found = self.marks.setdefault(abs(self.roles.number(prop)), [])
        if not found:
            found.append(self.concept(self.fresh()))
        return found[0]

    def loop(self, prop: PropertyExpression) -> int:
        """Return a concept whose members are related to themselves by the role."""
        key = ('loop', directed(prop)[0])
        known = self._counts.get(key)
        if known is None:
            known = self._counts[key] = self.concept(self.fresh())
            self.loops[known] = abs(self.roles.number(prop))
        return known

    # --- axioms ---

    def _top_and_bottom(self, used: set[str]) -> None:
        """Add what the properties mean that OWL itself defines, where they are used.

        Everybody is related to one individual by owl:topObjectProperty, which is symmetric and
        transitive: so everybody is related to everybody.
        """
        if TOP in used:
            role = directed(TOP)
            self.roles.include(role, turned(role))
            self.roles.imply((role, role), role)
            somebody = Count(1, self.roles.number(TOP), self.nominal(self.fresh()))
            self.node_rule(_ALL, ((_X, self.counted(self.at_least, somebody)),))
        if BOTTOM in used:
            self.edge_rule(EdgeClause(_ALL, self.roles.number(BOTTOM), _ALL, ()))
        if BOTTOM_DATA in used:
            self.value_rule(BOTTOM_DATA, _ALL, EVERY, ())

    def _axiom(self, axiom: Axiom) -> None:
        if isinstance(axiom, ax.HasKey):
            self._named_rules.key(axiom)
        elif isinstance(axiom, ax.Rule):
            self._named_rules.rule(axiom)
        else:
            self._property_axiom(axiom)

    def _property_axiom(self, axiom: Axiom) -> None:
        if isinstance(axiom, ax.AsymmetricObjectProperty):
            role = self.roles.number(axiom.prop)
            self._exclude(role, -role)
        elif isinstance(axiom, ax.DisjointObjectProperties):
            if any(map(self.roles.is_complex, axiom.props)):
                raise UnsupportedError('a property with chains is disjoint from another')
            for first, second in ax.pairs_of(axiom.props):
                self._exclude(self.roles.number(first), self.roles.number(second))
        elif isinstance(axiom, (ax.FunctionalObjectProperty, ax.InverseFunctionalObjectProperty)):
            if self.roles.is_complex(axiom.prop):
                raise UnsupportedError('a property with chains is functional')
            role = self.roles.number(axiom.prop)
            if isinstance(axiom, ax.InverseFunctionalObjectProperty):
                role, self.roles.has_inverse = -role, True
            self.functional.append(Count(1, role, ANYBODY))
        elif isinstance(axiom, ax.FunctionalDataProperty):
            if axiom.prop == TOP_DATA:
                self.node_rule(_ALL, ())
            self.functional_values.append(ValueCount(1, axiom.prop, EVERY))
        elif isinstance(axiom, ax.DisjointDataProperties):
            for name, other in ax.pairs_of(axiom.props):
                self.disjoint_props.setdefault(name, {})[other] = None
                self.disjoint_props.setdefault(other, {})[name] = None
        else:
            for inclusion in class_inclusions(axiom):
                self.include(*inclusion)

    def _exclude(self, first: int, second: int) -> None:
        for one, other in ((first, second), (-first, -second)):
            self.disjoint.setdefault(one, set()).add(other)
            self.disjoint.setdefault(other, set()).add(one)


class _NamedRules:
    """Reads the rules about named individuals: those of SWRL, and keys.

    They take no part in the model of those who must exist without a name (DL-safe rules; Motik,
    Sattler, Studer, "Query answering for OWL-DL with rules", 2005): else reasoning would have no
    end.
    """

    def __init__(self, rules: DLClauses, individuals: Iterable[str]) -> None:
        self._rules = rules
        self._individuals = tuple(dict.fromkeys(individuals))

    def key(self, key: ax.HasKey) -> None:
        """Add the rule by which those are the same who share a value of every property."""
        x, y = 0, 1
        body: list[NamedAtom] = [
            OfConcept(self._rules.recognised(key.cls), (one,)) for one in (x, y)
        ]
        for place, prop in enumerate((*key.object_props, *key.data_props), 2):
            is_data = place >= 2 + len(key.object_props)
            for one in (x, y):
                pair = (one, place)
                body.append(OfProp(str(prop), pair) if is_data else self._link(prop, *pair))
        if len(body) > 2:
            self._rules.named.append(NamedRule(tuple(body), SameAtom((x, y)), key, is_key=True))

    def _link(self, prop: PropertyExpression, x: Term, y: Term) -> FactAtom:
        """Return the atom that relates two individuals."""
        if not self._rules.roles.is_complex(prop):
            return OfRole(self._rules.roles.number(prop), (x, y))
        reached = {
            name: self._rules.recognised(ex.ObjectHasValue(prop, name))
            for name in self._individuals
        }
        return OfChain(reached, (x, y))

    def rule(self, rule: ax.Rule) -> None:
        """Add a rule of SWRL, one for each atom of its head."""
        numbers = count()
        terms = RuleTerms(lambda: next(numbers))
        individual, value = terms.individual, terms.value
        body: list[NamedAtom] = []
        for atom in rule.body:
            if isinstance(atom, ex.ClassAtom):
                body.append(
                    OfConcept(self._rules.recognised(atom.cls), (individual(atom.argument),))
                )
            elif isinstance(atom, ex.DataRangeAtom):
                body.append(RangeAtom(self._rules.values(atom.range), (value(atom.argument),)))
            elif isinstance(atom, ex.ObjectPropertyAtom):
                body.append(self._link(atom.prop, individual(atom.first), individual(atom.second)))
            elif isinstance(atom, ex.DataPropertyAtom):
                if atom.prop == TOP_DATA:
                    raise UnsupportedError('owl:topDataProperty stands in a rule')
                body.append(OfProp(atom.prop, (individual(atom.first), value(atom.second))))
            elif isinstance(atom, ex.BuiltinAtom):
                body.append(computed_atom(atom, terms))
            else:
                pair = individual(atom.first), individual(atom.second)
                is_same = isinstance(atom, ex.SameIndividualAtom)
                body.append(SameAtom(pair) if is_same else DifferentAtom(pair))
        heads = [self._head(atom, terms) for atom in rule.head]
        in_body = dict.fromkeys(term for atom in body for term in atom.terms)
        in_heads = [term for atom in heads for term in atom.terms]
        if any(isinstance(term, int) and term not in in_body for term in in_heads):
            raise UnsupportedError('a variable of the head does not stand in the body')
        named = [t for t in (*in_body, *in_heads) if isinstance(t, Constant) and not t.is_value]
        for term in named:
            self._rules.nominal(str(term.value))
        individuals: list[Term] = [*named, *(t for t in in_body if t in terms.individuals)]
        safe = safe_body(
            body,
            individuals,
            lambda atom: isinstance(atom, FactAtom),
            lambda term: OfConcept(ANYBODY, (term,)),
        )
        if not any(isinstance(atom, FactAtom) for atom in safe):
            raise UnsupportedError('it is about no individual')
        self._rules.named += [NamedRule(safe, head, rule) for head in heads or (None,)]

    def _head(self, atom: ex.Atom, terms: RuleTerms) -> OfConcept | OfRole | OfProp | Any:
        """Return what a rule says of those of whom its body holds."""
        individual = terms.individual
        if isinstance(atom, ex.ClassAtom):
            return OfConcept(self._rules.positive(atom.cls), (individual(atom.argument),))
        if isinstance(atom, ex.DataPropertyAtom):
            return OfProp(atom.prop, (individual(atom.first), terms.value(atom.second)))
        if isinstance(atom, ex.DataRangeAtom | ex.BuiltinAtom):
            raise UnsupportedError('a built-in or data range in the head has no meaning here')
        pair = individual(atom.first), individual(atom.second)
        if isinstance(atom, ex.ObjectPropertyAtom):
            return OfRole(self._rules.roles.number(atom.prop), pair)
        return SameAtom(pair) if isinstance(atom, ex.SameIndividualAtom) else DifferentAtom(pair)


class _Clausifier:
    """A disjunction of class expressions, which everybody is in, on its way to becoming rules."""

    def __init__(self, rules: DLClauses) -> None:
        self._rules = rules
        self._body: set[int] = set()
        self._heads: list[int] = []
        self._every: list[ex.ObjectAllValuesFrom] = []
        self._never: list[tuple[str, ValueSet]] = []
        self._both: list[ex.ObjectIntersectionOf] = []

    def add(self, disjunction: ClassExpression) -> None:
        """Add the rules of a disjunction, which is in the normal form."""
        if disjunction == THING:
            return
        for disjunct in _disjuncts(disjunction):
            self._take(disjunct)
        if len(self._both) == 1 and not self._every:
            (both,) = self._both
            # Distributed over the rest of the disjunction: without other heads nothing becomes a
            # choice by that.
            if not self._heads or _is_negative(both):
                for operand in both.operands:
                    self._apart(operand)
                return
        for both in self._both:
            if _is_negative(both):
                self._body.add(self._rules.recognised(ex.ObjectComplementOf(both)))
            else:
                self._heads.append(self._rules.positive(both))
        self._related()

    def _apart(self, operand: ClassExpression) -> None:
        """Add the disjunction with one operand instead of an intersection."""
        other = _Clausifier(self._rules)
        other._body |= self._body
        other._heads += self._heads
        other._never += self._never
        other.add(operand)

    def _take(self, one: ClassExpression) -> None:
        """Sort a disjunct in."""
        rules = self._rules
        if isinstance(one, str | ex.ObjectOneOf | ex.ObjectHasSelf):
            self._heads.append(rules.positive(one))
        elif isinstance(one, ex.ObjectComplementOf):
            self._body.add(rules.recognised(one.operand))
        elif isinstance(one, ex.ObjectIntersectionOf):
            self._both.append(one)
        elif isinstance(one, ex.ObjectAllValuesFrom):
            self._every.append(one)
        elif isinstance(one, ex.ObjectMaxCardinality):
            self._count(rules.at_most, one.n, one.prop, rules.recognised(one.filler))
        elif isinstance(one, ex.ObjectMinCardinality):
            self._count(rules.at_least, one.n, one.prop, rules.positive(one.filler))
        elif isinstance(one, ex.ObjectSomeValuesFrom):
            self._count(rules.at_least, 1, one.prop, rules.positive(one.filler))
        elif isinstance(one, ex.ObjectHasValue):
            self._count(rules.at_least, 1, one.prop, rules.nominal(one.individual))
        elif isinstance(one, ex.DataAllValuesFrom):
            self._never.append((one.prop, ~rules.values(one.range)))
        elif isinstance(one, ex.DataMaxCardinality):
            self._count_values(rules.values_at_most, one.n, one.prop, one.range)
        elif isinstance(one, ex.DataMinCardinality):
            self._count_values(rules.values_at_least, one.n, one.prop, one.range)
        elif isinstance(one, ex.DataSomeValuesFrom):
            self._count_values(rules.values_at_least, 1, one.prop, one.range)
        else:
            assert isinstance(one, ex.DataHasValue)
            only = ex.DataOneOf((one.literal,))
            self._count_values(rules.values_at_least, 1, one.prop, only)

    def _count(
        self, table: dict[int, Count], n: int, prop: PropertyExpression, concept: int
    ) -> None:
        rules = self._rules
        if (table is rules.at_most or n > 1) and rules.roles.is_complex(prop):
            raise UnsupportedError('a property with chains is counted')
        self._heads.append(rules.counted(table, Count(n, rules.roles.number(prop), concept)))

    def _count_values(
        self, table: dict[int, ValueCount], n: int, prop: str, data_range: ex.DataRange
    ) -> None:
        count = ValueCount(n, prop, self._rules.values(data_range))
        self._heads.append(self._rules.value_count(table, count))

    # --- relations: at most one is spelt out, the others become concepts ---

    def _related(self) -> None:
        rules = self._rules
        if self._is_chained():
            (every,), concept = self._every, next(iter(self._body), ANYBODY)
            rules.universal(concept, every.prop, rules.positive(every.filler))
            return
        inline: ex.ObjectAllValuesFrom | None = None
        # Absorption into the relation (role absorption; Tsarkov and Horrocks, 2004): one box
        # becomes the rule's edge, so the rule fires where there is such a neighbour, instead of
        # offering the box as a choice.
        for every in sorted(self._every, key=lambda one: _is_negative(one.filler)):
            simple, excludes = not rules.roles.is_complex(every.prop), _is_negative(every.filler)
            if inline is None and simple and not (self._never and excludes):
                inline = every
            elif excludes:
                name = rules.fresh()
                self._body.add(rules.concept(name))
                self._recognise(every.prop, ex.ObjectComplementOf(every.filler), name)
            else:
                concept = rules.concept(rules.fresh())
                self._heads.append(concept)
                rules.universal(concept, every.prop, rules.positive(every.filler))
        at_last = self._never[0] if inline is None and len(self._never) == 1 else None
        for data_prop, values in self._never if at_last is None else ():
            concept = rules.concept(rules.fresh())
            self._body.add(concept)
            rules.value_rule(data_prop, _ALL, values, ((_X, concept),))
        body = frozenset(self._body) or _ALL
        heads = tuple((_X, concept) for concept in dict.fromkeys(self._heads))
        if at_last is not None:
            rules.value_rule(at_last[0], body, at_last[1], heads)
        elif inline is None:
            rules.node_rule(body, heads)
        else:
            self._finish_edge(body, heads, inline)

    def _is_chained(self) -> bool:
        """Tell whether one concept alone, or none, says what a property with chains leads to."""
        few = len(self._every) == 1 and len(self._body) <= 1 and not (self._heads or self._never)
        return few and self._rules.roles.is_complex(self._every[0].prop)

    def _recognise(self, prop: PropertyExpression, filler: ClassExpression, name: str) -> None:
        """Everybody related to a member of the filler gets the named concept."""
        rules = self._rules
        source, target = rules.recognised(filler), rules.concept(name)
        if not rules.roles.is_complex(prop):
            ys = frozenset((source,))
            rules.edge_rule(EdgeClause(_ALL, rules.roles.number(prop), ys, ((_X, target),)))
            return
        iri, inverted = directed(prop)
        rules.roles.has_inverse = True
        rules.universal(source, iri if inverted else ex.ObjectInverseOf(iri), target)

    def _finish_edge(
        self, body: frozenset[int], heads: Heads, every: ex.ObjectAllValuesFrom
    ) -> None:
        rules = self._rules
        role, filler = rules.roles.number(every.prop), every.filler
        parts = filler.operands if isinstance(filler, ex.ObjectIntersectionOf) else (filler,)
        for part in parts:
            ys: set[int] = set()
            ends: list[tuple[int, int]] = []
            for one in _disjuncts(part):
                if _is_negative(one):
                    ys.add(rules.recognised(ex.ObjectComplementOf(one)))
                else:
                    ends.append((_Y, rules.positive(one)))
            rules.edge_rule(EdgeClause(body, role, frozenset(ys) or _ALL, (*heads, *ends)))


def _disjuncts(one: ClassExpression) -> tuple[ClassExpression, ...]:
    """Return the alternatives that an expression in the normal form consists of."""
    if one == NOTHING:
        return ()
    return one.operands if isinstance(one, ex.ObjectUnionOf) else (one,)


def _is_negative(one: ClassExpression) -> bool:
    """Tell whether a class only excludes: its complement can be recognised from what is there."""
    if isinstance(one, (ex.ObjectUnionOf, ex.ObjectIntersectionOf)):
        return all(map(_is_negative, one.operands))
    if isinstance(one, ex.ObjectAllValuesFrom):
        return _is_negative(one.filler)
    return one == NOTHING or isinstance(one, ex.ObjectComplementOf | ex.DataAllValuesFrom)
