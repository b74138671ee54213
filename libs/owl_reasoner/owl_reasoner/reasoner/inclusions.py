"""Which class or property an axiom includes in which: read once for both calculi, and for
refutation.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from itertools import permutations

from owl_reasoner.owl import axioms as ax
from owl_reasoner.owl import expressions as ex
from owl_reasoner.owl.axioms import Axiom
from owl_reasoner.owl.expressions import ClassExpression, PropertyExpression
from owl_reasoner.owl.vocabulary import NOTHING, THING, TOP_LITERAL
from owl_reasoner.reasoner.clauses import closure, turned

_Directed = tuple[str, bool]


def directed(prop: PropertyExpression) -> _Directed:
    """Return a property as (IRI, whether inverted)."""
    return (prop, False) if isinstance(prop, str) else (prop.prop, True)


def property_inclusions(axiom: Axiom) -> Iterator[tuple[_Directed, _Directed]]:
    """Yield the pairs of properties, one included in the other, that an axiom states."""
    if isinstance(axiom, (ax.SubObjectPropertyOf, ax.SubDataPropertyOf)):
        yield directed(axiom.sub), directed(axiom.sup)
    elif isinstance(axiom, (ax.EquivalentObjectProperties, ax.EquivalentDataProperties)):
        yield from permutations(dict.fromkeys(map(directed, axiom.props)), 2)
    elif isinstance(axiom, ax.InverseObjectProperties):
        yield from permutations((directed(axiom.first), turned(directed(axiom.second))))
    elif isinstance(axiom, ax.SymmetricObjectProperty):
        yield directed(axiom.prop), turned(directed(axiom.prop))


def class_inclusions(axiom: Axiom) -> Iterator[tuple[ClassExpression, ClassExpression]]:
    """Yield the pairs of classes, one included in the other, that an axiom stands for.

    These are the general concept inclusions of description logic; an axiom that is no set of them
    (about a chain, say, or an asymmetric property) has none here.
    """
    if isinstance(axiom, ax.SubClassOf):
        yield axiom.sub, axiom.sup
    elif isinstance(axiom, ax.EquivalentClasses):
        yield from permutations(dict.fromkeys(axiom.classes), 2)
    elif isinstance(axiom, ax.DisjointClasses):
        yield from ((ex.ObjectIntersectionOf(pair), NOTHING) for pair in ax.pairs_of(axiom.classes))
    elif isinstance(axiom, ax.DisjointUnion):
        yield from class_inclusions(ax.DisjointClasses(axiom.classes))
        yield from ((part, axiom.cls) for part in axiom.classes)
        yield axiom.cls, ex.ObjectUnionOf(axiom.classes)
    elif isinstance(axiom, ax.ObjectPropertyDomain):
        yield ex.ObjectSomeValuesFrom(axiom.prop, THING), axiom.domain
    elif isinstance(axiom, ax.ObjectPropertyRange):
        yield THING, ex.ObjectAllValuesFrom(axiom.prop, axiom.range)
    elif isinstance(axiom, ax.DataPropertyDomain):
        yield ex.DataSomeValuesFrom(axiom.prop, TOP_LITERAL), axiom.domain
    elif isinstance(axiom, ax.DataPropertyRange):
        yield THING, ex.DataAllValuesFrom(axiom.prop, axiom.range)
    elif isinstance(axiom, ax.FunctionalObjectProperty):
        yield THING, ex.ObjectMaxCardinality(1, axiom.prop)
    elif isinstance(axiom, ax.InverseFunctionalObjectProperty):
        prop = axiom.prop
        back = ex.ObjectInverseOf(prop) if isinstance(prop, str) else prop.prop
        yield THING, ex.ObjectMaxCardinality(1, back)
    elif isinstance(axiom, ax.FunctionalDataProperty):
        yield THING, ex.DataMaxCardinality(1, axiom.prop)
    elif isinstance(axiom, ax.ReflexiveObjectProperty):
        yield THING, ex.ObjectHasSelf(axiom.prop)
    elif isinstance(axiom, ax.IrreflexiveObjectProperty):
        yield ex.ObjectHasSelf(axiom.prop), NOTHING


class PropertyHierarchy:
    """The reflexive and transitive closure of the stated property inclusions."""

    def __init__(self, axioms: Iterable[Axiom]) -> None:
        self._above: dict[_Directed, set[_Directed]] = {}
        self._functional: set[_Directed] = set()
        for axiom in axioms:
            for sub, sup in property_inclusions(axiom):
                self._above.setdefault(sub, set()).add(sup)
                self._above.setdefault(turned(sub), set()).add(turned(sup))
            if isinstance(axiom, (ax.FunctionalObjectProperty, ax.FunctionalDataProperty)):
                self._functional.add(directed(axiom.prop))
            elif isinstance(axiom, ax.InverseFunctionalObjectProperty):
                self._functional.add(turned(directed(axiom.prop)))

    def above(self, prop: PropertyExpression) -> set[_Directed]:
        """Return the property and everything it is included in."""
        return set(closure(directed(prop), lambda one: self._above.get(one, ())))

    def above_role(self, iri: str, inverted: bool) -> set[_Directed]:
        """Return a directed property and everything it is included in."""
        return self.above(ex.ObjectInverseOf(iri) if inverted else iri)

    def is_functional(self, prop: PropertyExpression) -> bool:
        """Tell whether an individual has at most one value, by this property or one above it."""
        return not self._functional.isdisjoint(self.above(prop))
