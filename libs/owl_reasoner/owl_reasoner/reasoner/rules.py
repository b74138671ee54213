"""What both calculi do with a rule of SWRL: its variables, its built-ins, and what binds them."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import replace
from typing import Any, TypeVar

from owl_reasoner.owl import expressions as ex
from owl_reasoner.owl.expressions import Literal
from owl_reasoner.owl.vocabulary import SWRLB, local_name
from owl_reasoner.reasoner.clauses import (
    ComputedAtom,
    Constant,
    RangeAtom,
    Term,
    UnsupportedError,
)
from owl_reasoner.reasoner.datatypes import value_of
from owl_reasoner.reasoner.swrl_builtins import builtin

T = TypeVar('T', bound=Any)


class RuleTerms:
    """Numbers a rule's variables by `fresh`; tells individuals from values."""

    def __init__(self, fresh: Callable[[], int]) -> None:
        self._fresh = fresh
        self._numbers: dict[ex.Variable, int] = {}
        self.individuals: set[int] = set()
        self.values: set[int] = set()

    def individual(self, argument: ex.IndividualArgument) -> Term:
        """Return the term of an argument that is an individual."""
        if isinstance(argument, ex.Variable):
            number = self._number(argument)
            self.individuals.add(number)
            return number
        return Constant(argument)

    def value(self, argument: ex.DataArgument) -> Term:
        """Return the term of an argument that is a value.

        Raises:
            UnsupportedError: It is neither a literal nor a variable.
        """
        if isinstance(argument, ex.Variable):
            number = self._number(argument)
            self.values.add(number)
            return number
        if not isinstance(argument, Literal):
            raise UnsupportedError(f'{argument} stands where a literal or a variable is expected')
        return Constant(value_of(argument), True)

    def _number(self, variable: ex.Variable) -> int:
        number = self._numbers.get(variable)
        if number is None:
            number = self._numbers[variable] = self._fresh()
        return number


def computed_atom(atom: ex.BuiltinAtom, terms: RuleTerms) -> ComputedAtom:
    """Return a rule's built-in.

    Raises:
        UnsupportedError: It is not known.
    """
    name = atom.builtin.removeprefix(SWRLB)
    known = builtin(name, len(atom.arguments)) if atom.builtin.startswith(SWRLB) else None
    if known is None:
        count = len(atom.arguments)
        raise UnsupportedError(
            f'the built-in {local_name(atom.builtin)} with {count} arguments is not supported'
        )
    holds, solve = known
    return ComputedAtom(name, holds, solve, tuple(map(terms.value, atom.arguments)))


def safe_body(
    body: Iterable[T],
    individuals: Iterable[Term],
    is_fact: Callable[[T], bool],
    anybody: Callable[[Term], T],
) -> tuple[T, ...]:
    """Return a body in which what stands in no fact is found by other means (safety).

    Such individuals are anybody there is, such values are computed by a built-in. All other
    built-ins only test: they take 3 and 3.0 as equal, the lookup of a computed value among the
    facts would not, and the order of the join decides which of the two is done.

    Args:
        body: The atoms.
        individuals: The terms in them that stand for individuals.
        is_fact: Whether facts make an atom true.
        anybody: Gives the atom by which a term is anybody.

    Raises:
        UnsupportedError: A value is bound by nothing.
    """
    body = tuple(body)
    bound = {term for atom in body if is_fact(atom) for term in atom.terms}
    free = tuple(term for term in dict.fromkeys(individuals) if term not in bound)
    body = (*body, *map(anybody, free))
    bound.update(free)
    computing: set[T] = set()
    # By repetition, as one computed value may be what another one needs.
    waiting = [atom for atom in body if isinstance(atom, (ComputedAtom, RangeAtom))]
    progress = True
    while waiting and progress:
        progress = False
        for atom in tuple(waiting):
            unbound = [term for term in atom.terms if isinstance(term, int) and term not in bound]
            if unbound == [atom.terms[0]] and isinstance(atom, ComputedAtom) and atom.solve:
                computing.add(atom)
                unbound = []
            if not unbound:
                bound.update(atom.terms)
                waiting.remove(atom)
                progress = True
    if waiting:
        name = waiting[0].builtin if isinstance(waiting[0], ComputedAtom) else 'a data range'
        raise UnsupportedError(f'an argument of {name} is bound by no other atom')
    return tuple(
        replace(atom, solve=None)
        if isinstance(atom, ComputedAtom) and atom not in computing
        else atom
        for atom in body
    )
