"""Which properties lie above which, inverses included, and which are functional."""

from __future__ import annotations

from collections.abc import Iterable

from surveillance_ontology.owl import axioms as ax
from surveillance_ontology.owl.axioms import Axiom
from surveillance_ontology.owl.expressions import PropertyExpression

_Directed = tuple[str, bool]


def directed(prop: PropertyExpression) -> _Directed:
    """A property as (IRI, whether inverted)."""
    return (prop, False) if isinstance(prop, str) else (prop.prop, True)


class PropertyHierarchy:
    """The reflexive and transitive closure of the stated property inclusions."""

    def __init__(self, axioms: Iterable[Axiom]) -> None:
        self._above: dict[_Directed, set[_Directed]] = {}
        self._functional: set[_Directed] = set()
        for axiom in axioms:
            if isinstance(axiom, (ax.SubObjectPropertyOf, ax.SubDataPropertyOf)):
                self._edge(directed(axiom.sub), directed(axiom.sup))
            elif isinstance(axiom, (ax.EquivalentObjectProperties, ax.EquivalentDataProperties)):
                for sub in axiom.props:
                    for sup in axiom.props:
                        self._edge(directed(sub), directed(sup))
            elif isinstance(axiom, ax.InverseObjectProperties):
                first, (name, inverted) = directed(axiom.first), directed(axiom.second)
                self._edge(first, (name, not inverted))
                self._edge((name, not inverted), first)
            elif isinstance(axiom, ax.SymmetricObjectProperty):
                name, inverted = directed(axiom.prop)
                self._edge((name, inverted), (name, not inverted))
            elif isinstance(axiom, (ax.FunctionalObjectProperty, ax.FunctionalDataProperty)):
                self._functional.add(directed(axiom.prop))
            elif isinstance(axiom, ax.InverseFunctionalObjectProperty):
                name, inverted = directed(axiom.prop)
                self._functional.add((name, not inverted))

    def _edge(self, sub: _Directed, sup: _Directed) -> None:
        self._above.setdefault(sub, set()).add(sup)
        self._above.setdefault((sub[0], not sub[1]), set()).add((sup[0], not sup[1]))

    def above(self, prop: PropertyExpression) -> set[_Directed]:
        """The property and everything it is included in."""
        found = {directed(prop)}
        pending = list(found)
        while pending:
            for sup in self._above.get(pending.pop(), ()):
                if sup not in found:
                    found.add(sup)
                    pending.append(sup)
        return found

    def is_functional(self, prop: PropertyExpression) -> bool:
        """Whether an individual has at most one value, by this property or one above it."""
        return not self._functional.isdisjoint(self.above(prop))

    def is_functional_as(self, prop: _Directed) -> bool:
        """Whether this very property, read in this direction, is stated to be functional."""
        return prop in self._functional
