"""SWRL rules as clauses. Variables stand for named individuals and known values only (DL-safe)."""

from __future__ import annotations

from itertools import product

from surveillance_ontology.owl import axioms as ax
from surveillance_ontology.owl import expressions as ex
from surveillance_ontology.owl.expressions import Literal
from surveillance_ontology.owl.vocabulary import NOTHING, SWRLB, local_name
from surveillance_ontology.reasoner.clauses import (
    BodyAtom,
    ComputedAtom,
    Constant,
    DifferentAtom,
    PredicateAtom,
    RangeAtom,
    SameAtom,
    Term,
)
from surveillance_ontology.reasoner.datatypes import value_of
from surveillance_ontology.reasoner.left_sides import Unsupported
from surveillance_ontology.reasoner.right_sides import RightSides
from surveillance_ontology.reasoner.swrl_builtins import builtin


class _Terms:
    """Numbers a rule's variables; tells individuals from values."""

    def __init__(self, normaliser: RightSides) -> None:
        self._normaliser = normaliser
        self._numbers: dict[ex.Variable, int] = {}
        self.individuals: set[int] = set()
        self.values: set[int] = set()

    def individual(self, argument: ex.IndividualArgument) -> Term:
        if isinstance(argument, ex.Variable):
            number = self._number(argument)
            self.individuals.add(number)
            return number
        return Constant(argument)

    def value(self, argument: ex.DataArgument) -> Term:
        if isinstance(argument, ex.Variable):
            number = self._number(argument)
            self.values.add(number)
            return number
        if not isinstance(argument, Literal):
            raise Unsupported(f'{argument} stands where a literal or a variable is expected')
        return Constant(value_of(argument), True)

    def _number(self, variable: ex.Variable) -> int:
        number = self._numbers.get(variable)
        if number is None:
            number = self._numbers[variable] = self._normaliser.fresh()
        return number


def _computed(atom: ex.BuiltinAtom, terms: _Terms) -> ComputedAtom:
    name = atom.builtin.removeprefix(SWRLB)
    known = builtin(name, len(atom.arguments)) if atom.builtin.startswith(SWRLB) else None
    if known is None:
        count = len(atom.arguments)
        raise Unsupported(
            f'the built-in {local_name(atom.builtin)} with {count} arguments is not supported'
        )
    holds, solve = known
    return ComputedAtom(name, holds, solve, tuple(map(terms.value, atom.arguments)))


def normalise_rule(normaliser: RightSides, rule: ax.Rule) -> None:
    """Adds the clauses of one rule to the normaliser's program."""
    program, terms = normaliser.program, _Terms(normaliser)
    alternatives: list[list[tuple[BodyAtom, ...]]] = []
    for atom in rule.body:
        if isinstance(atom, ex.ClassAtom):
            alternatives.append(normaliser.bodies(atom.cls, terms.individual(atom.argument)))
        elif isinstance(atom, ex.DataRangeAtom):
            term, test = terms.value(atom.argument), normaliser.test(atom.range)
            if test is not None:
                alternatives.append([(RangeAtom(test, (term,)),)])
        elif isinstance(atom, ex.ObjectPropertyAtom):
            pair = terms.individual(atom.first), terms.individual(atom.second)
            alternatives.append([(normaliser.property(atom.prop, *pair),)])
        elif isinstance(atom, ex.DataPropertyAtom):
            data = program.data(atom.prop)
            both = (terms.individual(atom.first), terms.value(atom.second))
            alternatives.append([(PredicateAtom(data, both),)])
        elif isinstance(atom, ex.SameIndividualAtom):
            pair = terms.individual(atom.first), terms.individual(atom.second)
            alternatives.append([(SameAtom(pair),)])
        elif isinstance(atom, ex.DifferentIndividualsAtom):
            pair = terms.individual(atom.first), terms.individual(atom.second)
            alternatives.append([(DifferentAtom(pair),)])
        else:
            alternatives.append([(_computed(atom, terms),)])
    for parts in product(*alternatives):
        body = tuple(atom for part in parts for atom in part)
        _heads(normaliser, rule, _bound(normaliser, body, terms), terms)


def _bound(
    normaliser: RightSides, body: tuple[BodyAtom, ...], terms: _Terms
) -> tuple[BodyAtom, ...]:
    """The body, with owl:Thing for individuals that nothing else binds; refuses unbound values."""
    program = normaliser.program
    bound: set[Term] = set()
    for atom in body:
        if isinstance(atom, PredicateAtom):
            bound.update(atom.terms)
    free = [
        term
        for atom in body
        for term in atom.terms
        if isinstance(term, int) and term in terms.individuals and term not in bound
    ]
    for term in dict.fromkeys(free):
        program.uses_thing = True
        body = (*body, PredicateAtom(program.thing, (term,)))
        bound.add(term)
    waiting = [atom for atom in body if isinstance(atom, (ComputedAtom, RangeAtom))]
    progress = True
    while waiting and progress:
        progress = False
        for atom in tuple(waiting):
            unbound = [term for term in atom.terms if isinstance(term, int) and term not in bound]
            first_only = unbound == [atom.terms[0]] and isinstance(atom, ComputedAtom)
            if not unbound or (first_only and atom.solve is not None):  # type: ignore[union-attr]
                bound.update(atom.terms)
                waiting.remove(atom)
                progress = True
    if waiting:
        name = waiting[0].builtin if isinstance(waiting[0], ComputedAtom) else 'a data range'
        raise Unsupported(f'an argument of {name} is bound by no other atom')
    return body


def _heads(
    normaliser: RightSides, rule: ax.Rule, body: tuple[BodyAtom, ...], terms: _Terms
) -> None:
    program = normaliser.program
    bound = {term for atom in body for term in atom.terms if isinstance(term, int)}

    def known(term: Term) -> Term:
        if isinstance(term, int) and term not in bound:
            raise Unsupported('a variable of the head does not stand in the body')
        return term

    if not rule.head:
        subject = next((term for term in sorted(bound) if term in terms.individuals), None)
        term: Term = Constant(NOTHING) if subject is None else subject
        normaliser.contradict(body, term)
    for atom in rule.head:
        if isinstance(atom, ex.ClassAtom):
            normaliser.imply(body, atom.cls, known(terms.individual(atom.argument)))
        elif isinstance(atom, ex.ObjectPropertyAtom):
            pair = known(terms.individual(atom.first)), known(terms.individual(atom.second))
            normaliser.clause(body, normaliser.property(atom.prop, *pair))
        elif isinstance(atom, ex.DataPropertyAtom):
            both = (known(terms.individual(atom.first)), known(terms.value(atom.second)))
            normaliser.clause(body, PredicateAtom(program.data(atom.prop), both))
        elif isinstance(atom, (ex.SameIndividualAtom, ex.DifferentIndividualsAtom)):
            pair = known(terms.individual(atom.first)), known(terms.individual(atom.second))
            if isinstance(atom, ex.SameIndividualAtom):
                normaliser.clause(body, SameAtom(pair))
            else:
                normaliser.clause(body, PredicateAtom(program.different, pair))
        else:
            raise Unsupported('a built-in or data range in the head has no meaning here')
