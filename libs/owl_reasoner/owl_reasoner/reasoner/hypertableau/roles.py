"""Object and data properties as numbers, what each implies, and the chains that imply them.

An object property has a number and its inverse the negative of it, so that a step from x to y and
the same step from y to x need one entry. Everything is a role or a data property here; complex
classes know them through `dl_clauses.DLClauses`.
"""

from __future__ import annotations

from owl_reasoner.owl import axioms as ax
from owl_reasoner.owl.axioms import Axiom
from owl_reasoner.owl.expressions import PropertyExpression
from owl_reasoner.owl.vocabulary import TOP_DATA
from owl_reasoner.reasoner.clauses import UnsupportedError, closure, turned
from owl_reasoner.reasoner.inclusions import directed, property_inclusions
from owl_reasoner.reasoner.property_chains import AnyRole, Chains


class Roles:
    """The properties of an ontology.

    Attributes:
        names: IRIs by number, from 1.
        has_inverse: Whether any role is used backwards: blocking is pairwise then (`blocking`).
    """

    def __init__(self) -> None:
        self.names: list[str] = ['']
        self.has_inverse = False
        self._numbers: dict[str, int] = {}
        self._above: dict[int, tuple[int, ...]] = {}
        self._data_above: dict[str, tuple[str, ...]] = {}
        self._chains = Chains()
        # No sets of names: their order, and with it the search, would differ from run to run.
        self._inclusions: dict[AnyRole, dict[AnyRole, None]] = {}
        self._data_inclusions: dict[str, dict[str, None]] = {}

    def number(self, prop: PropertyExpression | AnyRole) -> int:
        """Return the number of a role."""
        iri, inverted = prop if isinstance(prop, tuple) else directed(prop)
        number = self._numbers.get(iri)
        if number is None:
            number = self._numbers[iri] = len(self.names)
            self.names.append(iri)
        if inverted:
            self.has_inverse = True
        return -number if inverted else number

    def above(self, role: int) -> tuple[int, ...]:
        """Return the role and every role that it implies by itself."""
        found = self._above.get(role)
        if found is None:
            key = (self.names[abs(role)], role < 0)
            above = closure(key, lambda one: self._inclusions.get(one, ()))
            found = self._above[role] = tuple(self.number(one) for one in above)
        return found

    def data_above(self, prop: str) -> tuple[str, ...]:
        """Return the data property and every one that it implies."""
        found = self._data_above.get(prop)
        if found is None:
            above = closure(prop, lambda one: self._data_inclusions.get(one, ()))
            found = self._data_above[prop] = tuple(above)
        return found

    def complex_props(self) -> list[str]:
        """Return the properties that chains imply."""
        return [prop for prop, inverse in self._chains.complex_roles() if not inverse]

    def automaton(self, prop: PropertyExpression) -> list[tuple[int, int | None, int]]:
        """Return the steps that imply a property, from state 0 to state 1; None: without a step.

        Raises:
            UnsupportedError: The chains are not regular.
        """
        steps = self._chains.steps(directed(prop))
        return [(a, None if step is None else self.number(step), b) for a, step, b in steps]

    def steps(self, prop: PropertyExpression) -> list[tuple[int, int | None, int]]:
        """As `automaton`; of chains that are not regular the property's own step alone."""
        try:
            return self.automaton(prop)
        except UnsupportedError:
            return [(0, self.number(prop), 1)]

    def imply(self, chain: tuple[AnyRole, ...], role: AnyRole) -> None:
        """Take that a chain implies a role."""
        self._chains.imply(chain, role)

    def is_complex(self, prop: PropertyExpression) -> bool:
        """Tell whether a chain implies the role."""
        return self._chains.is_complex(directed(prop))

    def take(self, axiom: Axiom) -> None:
        """Take what an axiom says of which property implies which.

        Raises:
            UnsupportedError: Nobody can decide with it.
        """
        data = isinstance(axiom, (ax.SubDataPropertyOf, ax.EquivalentDataProperties))
        for sub, sup in property_inclusions(axiom):
            if data:
                if sub[0] == TOP_DATA:
                    raise UnsupportedError('owl:topDataProperty is below another property')
                self._data_inclusions.setdefault(sub[0], {})[sup[0]] = None
            else:
                self.include(sub, sup)
        if isinstance(axiom, ax.TransitiveObjectProperty):
            role = directed(axiom.prop)
            self._chains.imply((role, role), role)
        elif isinstance(axiom, ax.SubPropertyChainOf):
            self._chains.imply(tuple(map(directed, axiom.chain)), directed(axiom.sup))

    def include(self, sub: AnyRole, sup: AnyRole) -> None:
        """Take that a role implies another one."""
        for role in (sub, sup):
            self.number(role)
        self._inclusions.setdefault(sub, {})[sup] = None
        self._inclusions.setdefault(turned(sub), {})[turned(sup)] = None
        self._chains.imply((sub,), sup)

    def check(self, axiom: Axiom) -> None:
        """Check that the chains of an axiom, with all others, are a finite automaton.

        Raises:
            UnsupportedError: They are not regular (OWL 2 Structural Specification, 11.2).
        """
        if isinstance(axiom, ax.SubPropertyChainOf):
            self._chains.steps(directed(axiom.sup))
