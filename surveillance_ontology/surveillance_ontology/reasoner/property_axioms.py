"""Axioms about properties as Horn clauses."""

from __future__ import annotations

from surveillance_ontology.owl import axioms as ax
from surveillance_ontology.owl.axioms import Axiom
from surveillance_ontology.reasoner.clauses import AtMost, PredicateAtom
from surveillance_ontology.reasoner.right_sides import RightSides

_X, _Y, _Z = 0, 1, 2


def normalise_property_axiom(normaliser: RightSides, axiom: Axiom) -> None:
    """Adds the clauses of one property axiom to the normaliser's program."""
    program, clause, prop = normaliser.program, normaliser.clause, normaliser.property
    if isinstance(axiom, ax.SubObjectPropertyOf):
        clause((prop(axiom.sub, _X, _Y),), prop(axiom.sup, _X, _Y))
    elif isinstance(axiom, ax.SubPropertyChainOf):
        body = tuple(prop(part, place, place + 1) for place, part in enumerate(axiom.chain))
        clause(body, prop(axiom.sup, 0, len(axiom.chain)))
    elif isinstance(axiom, ax.EquivalentObjectProperties):
        for sub in axiom.props:
            for sup in axiom.props:
                if sub != sup:
                    clause((prop(sub, _X, _Y),), prop(sup, _X, _Y))
    elif isinstance(axiom, ax.InverseObjectProperties):
        clause((prop(axiom.first, _X, _Y),), prop(axiom.second, _Y, _X))
        clause((prop(axiom.second, _X, _Y),), prop(axiom.first, _Y, _X))
    elif isinstance(axiom, ax.SymmetricObjectProperty):
        clause((prop(axiom.prop, _X, _Y),), prop(axiom.prop, _Y, _X))
    elif isinstance(axiom, ax.TransitiveObjectProperty):
        clause((prop(axiom.prop, _X, _Y), prop(axiom.prop, _Y, _Z)), prop(axiom.prop, _X, _Z))
    elif isinstance(axiom, ax.ReflexiveObjectProperty):
        clause((), prop(axiom.prop, _X, _X))
    elif isinstance(axiom, ax.IrreflexiveObjectProperty):
        name = axiom.prop if isinstance(axiom.prop, str) else axiom.prop.prop
        program.irreflexive.append(program.object(name))
        normaliser.contradict((prop(axiom.prop, _X, _X),), _X)
    elif isinstance(axiom, ax.AsymmetricObjectProperty):
        name = axiom.prop if isinstance(axiom.prop, str) else axiom.prop.prop
        program.asymmetric.append(program.object(name))
        normaliser.contradict((prop(axiom.prop, _X, _Y), prop(axiom.prop, _Y, _X)), _X)
    elif isinstance(axiom, ax.DisjointObjectProperties):
        for place, first in enumerate(axiom.props):
            for second in axiom.props[place + 1 :]:
                one, two = prop(first, _X, _Y), prop(second, _X, _Y)
                pair = (one.predicate, one.terms[0] == _Y, two.predicate, two.terms[0] == _Y)
                program.disjoint_properties.append(pair)
                normaliser.contradict((one, two), _X)
    elif isinstance(axiom, (ax.FunctionalObjectProperty, ax.InverseFunctionalObjectProperty)):
        atom = prop(axiom.prop, _X, _Y)
        inverse = (atom.terms[0] == _Y) != isinstance(axiom, ax.InverseFunctionalObjectProperty)
        program.at_most.append(AtMost(None, 1, atom.predicate, inverse, None, axiom))
    elif isinstance(axiom, ax.ObjectPropertyDomain):
        normaliser.imply((prop(axiom.prop, _X, _Y),), axiom.domain, _X)
    elif isinstance(axiom, ax.ObjectPropertyRange):
        normaliser.imply((prop(axiom.prop, _X, _Y),), axiom.range, _Y)
    elif isinstance(axiom, ax.SubDataPropertyOf):
        _imply_data(normaliser, axiom.sub, axiom.sup)
    elif isinstance(axiom, ax.EquivalentDataProperties):
        for data_sub in axiom.props:
            for data_sup in axiom.props:
                if data_sub != data_sup:
                    _imply_data(normaliser, data_sub, data_sup)
    elif isinstance(axiom, ax.DisjointDataProperties):
        for place, name in enumerate(axiom.props):
            for other in axiom.props[place + 1 :]:
                one = PredicateAtom(program.data(name), (_X, _Y))
                two = PredicateAtom(program.data(other), (_X, _Y))
                program.disjoint_properties.append((one.predicate, False, two.predicate, False))
                normaliser.contradict((one, two), _X)
    elif isinstance(axiom, ax.FunctionalDataProperty):
        program.at_most.append(AtMost(None, 1, program.data(axiom.prop), False, None, axiom))
    elif isinstance(axiom, ax.DataPropertyDomain):
        body = (PredicateAtom(program.data(axiom.prop), (_X, _Y)),)
        normaliser.imply(body, axiom.domain, _X)
    elif isinstance(axiom, ax.DataPropertyRange):
        normaliser.only((), axiom.prop, axiom.range)


def _imply_data(normaliser: RightSides, sub: str, sup: str) -> None:
    program = normaliser.program
    body = (PredicateAtom(program.data(sub), (_X, _Y)),)
    normaliser.clause(body, PredicateAtom(program.data(sup), (_X, _Y)))
