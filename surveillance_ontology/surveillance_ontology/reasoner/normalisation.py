"""Axioms to Horn clauses and counting conditions.

A class expression that cannot be spelt out in a clause's body (a cardinality, `only`, a complement)
becomes a label: a predicate that holds of what is known to belong to the expression. What no Horn
clause can express is reported, with the axiom, in `Program.unsupported`.
"""

from __future__ import annotations

from collections.abc import Iterable

from surveillance_ontology.owl import axioms as ax
from surveillance_ontology.owl import expressions as ex
from surveillance_ontology.owl.axiom_text import expression_text
from surveillance_ontology.owl.axioms import Axiom
from surveillance_ontology.owl.expressions import ClassExpression
from surveillance_ontology.owl.vocabulary import local_name
from surveillance_ontology.reasoner.clauses import (
    Clause,
    Key,
    Predicate,
    PredicateAtom,
    Term,
)
from surveillance_ontology.reasoner.left_sides import Unsupported
from surveillance_ontology.reasoner.normal_forms import normal
from surveillance_ontology.reasoner.property_axioms import normalise_property_axiom
from surveillance_ontology.reasoner.right_sides import RightSides
from surveillance_ontology.reasoner.swrl_rules import normalise_rule

_X, _Y = 0, 1


class Normaliser(RightSides):
    """Builds a `Program` from axioms that are not assertions.

    Args:
        axioms: The ontology's axioms; assertions and annotations among them are passed over.
        asserted: Complex class expressions that individuals are asserted to belong to.
        negated: Properties with negative assertions, as pairs (kind, IRI), kind 'object' or 'data'.
        abstract: Whether values may be stand-ins ('some', range) for an unknown value in a range.
    """

    def __init__(
        self,
        axioms: Iterable[Axiom],
        asserted: Iterable[ClassExpression] = (),
        negated: Iterable[tuple[str, str]] = (),
        abstract: bool = False,
    ) -> None:
        tbox = [axiom for axiom in axioms if not isinstance(axiom, (ax.Assertion, ax.Annotation))]
        super().__init__(tbox, abstract)
        for axiom in tbox:
            self._origin = axiom
            self._attempt(self._axiom, axiom)
        self._origin = None
        for expression in asserted:
            self._context = f'assertions of {expression_text(expression)}'
            self._attempt(self.label_asserted, expression)
        for kind, iri in negated:
            self._negate(kind, iri)
        self._complement_labels()
        if any(
            isinstance(clause.head, PredicateAtom)
            and clause.head.predicate is self.program.different
            for clause in self.program.clauses
        ):
            self.contradict((self._differs(_X, _X),), _X)

    def _differs(self, x: Term, y: Term) -> PredicateAtom:
        return PredicateAtom(self.program.different, (x, y))

    def _negate(self, kind: str, iri: str) -> None:
        """A predicate for negative assertions, which contradict the positive."""
        program = self.program
        prop = program.object(iri) if kind == 'object' else program.data(iri)
        negative = program.negatives[prop] = Predicate(kind, f'not {local_name(iri)}')
        body = (PredicateAtom(prop, (_X, _Y)), PredicateAtom(negative, (_X, _Y)))
        self.contradict(body, _X)

    def label_asserted(self, expression: ClassExpression) -> Predicate:
        """The label of an expression that individuals are asserted to belong to, with what it
        implies.
        """
        label = self._label(expression)
        self.imply((PredicateAtom(label, (_X,)),), expression, _X)
        return label

    def _complement_labels(self) -> None:
        """What is disjoint from a class belongs to its complement, where the complement is asked
        for.
        """
        for iri, label in self._complements.items():
            for other in self.program.cls(iri).disjoint:
                if other is not label:
                    head = PredicateAtom(label, (_X,))
                    self.program.clauses.append(Clause((PredicateAtom(other, (_X,)),), head))

    # --- axioms ---

    def _axiom(self, axiom: Axiom) -> None:
        if isinstance(axiom, ax.SubClassOf):
            self._sub_class(axiom.sub, axiom.sup)
        elif isinstance(axiom, ax.EquivalentClasses):
            for sub in axiom.classes:
                for sup in axiom.classes:
                    if sub is not sup:
                        self._attempt(self._sub_class, sub, sup)
        elif isinstance(axiom, ax.DisjointClasses):
            self._all_disjoint(axiom.classes)
        elif isinstance(axiom, ax.DisjointUnion):
            self._all_disjoint(axiom.classes)
            for part in axiom.classes:
                self._attempt(self._sub_class, part, axiom.cls)
            self._attempt(self._sub_class, axiom.cls, ex.ObjectUnionOf(axiom.classes))
        elif isinstance(axiom, ax.Rule):
            normalise_rule(self, axiom)
        elif isinstance(axiom, ax.Import):
            raise Unsupported('imports are not followed')
        elif isinstance(axiom, ax.HasKey):
            self._key(axiom)
        elif not isinstance(axiom, (ax.Declaration, ax.DatatypeDefinition)):
            normalise_property_axiom(self, axiom)

    def _sub_class(self, sub: ClassExpression, sup: ClassExpression) -> None:
        sub, sup = normal(sub), normal(sup)
        if isinstance(sub, ex.ObjectUnionOf):
            for operand in sub.operands:
                self._attempt(self._sub_class, operand, sup)
            return
        opposite = sup.operand if isinstance(sup, ex.ObjectComplementOf) else None
        if isinstance(sub, str) and isinstance(opposite, str):
            self._disjoint(self._label(sub), self._label(opposite))
        for body in self.bodies(sub, _X):
            self.imply(body, sup, _X)

    def _all_disjoint(self, classes: tuple[ClassExpression, ...]) -> None:
        labels = [self._recognise(normal(expression)) for expression in classes]
        for position, first in enumerate(labels):
            for second in labels[position + 1 :]:
                self._disjoint(first, second)

    def _key(self, axiom: ax.HasKey) -> None:
        props = [self._direction(prop) for prop in axiom.object_props]
        props += [(self.program.data(prop), False) for prop in axiom.data_props]
        if props:
            cls = self._filler(axiom.cls)
            self.program.keys.append(Key(cls, tuple(props), axiom))
