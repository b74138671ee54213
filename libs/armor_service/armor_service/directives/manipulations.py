"""The directives that change an ontology, each as a list of changes.

They do not apply anything: buffering, the journal and reasoning are the service's business. Missing
entities come into being by being named.
"""

from __future__ import annotations

from functools import partial

from armor_service.changes import (
    AddAxiom,
    Change,
    RemoveAxiom,
    RemoveEntity,
    RenameEntity,
    SetAssertion,
)
from armor_service.directives.table import (
    CLS,
    DAT,
    ENTITY_KINDS,
    GONE,
    IND,
    NEW,
    OBJ,
    OLD,
    TYPE,
    VALUE,
    Argument,
    Read,
    manipulation,
)
from armor_service.reference import Reference
from owl_reasoner.owl.axioms import (
    ClassAssertion,
    DataPropertyAssertion,
    DifferentIndividuals,
    DisjointClasses,
    EquivalentClasses,
    ObjectPropertyAssertion,
    SubClassOf,
)
from owl_reasoner.owl.expressions import (
    ClassExpression,
    Literal,
    ObjectIntersectionOf,
    ObjectMinCardinality,
)
from owl_reasoner.owl.vocabulary import NOTHING, THING
from owl_reasoner.reasoner.datatypes import value_of

MOST_CLASSES = 500
"""Classes in one statement of disjointness; what it costs grows with their square."""
_OTHER = Argument('value individual', Read.INDIVIDUAL)
_NEW_IND = Argument('new individual', Read.INDIVIDUAL)
_OLD_IND = Argument('old individual', Read.INDIVIDUAL)
_SUPER = Argument('superclass', Read.CLASS)
_COUNT = Argument('cardinality', Read.NUMBER)
_FILLER = Argument('value class', Read.CLASS)


@manipulation('ADD IND', IND, summary='Makes an individual known, as an instance of owl:Thing.')
def _add_ind(_: Reference, ind: str) -> list[Change]:
    return [AddAxiom(ClassAssertion(THING, ind))]


@manipulation('ADD IND CLASS', IND, CLS, summary='Asserts that an individual is of a class.')
def _add_ind_class(_: Reference, ind: str, cls: str) -> list[Change]:
    return [AddAxiom(ClassAssertion(cls, ind))]


@manipulation(
    'ADD CLASS', CLS, summary='Makes a class known, as a subclass of owl:Thing.', schema=True
)
def _add_class(_: Reference, cls: str) -> list[Change]:
    return [AddAxiom(SubClassOf(cls, THING))]


@manipulation(
    'ADD CLASS CLASS', CLS, _SUPER, summary='Makes a class a subclass of another.', schema=True
)
def _add_class_class(_: Reference, cls: str, above: str) -> list[Change]:
    return [AddAxiom(SubClassOf(cls, above))]


@manipulation(
    'ADD DATAPROP IND',
    *(DAT, IND, TYPE, VALUE),
    summary='Adds a value to a data property of an individual; what it has already stays.',
    verb='added to',
)
def _add_dataprop(_: Reference, prop: str, ind: str, value: Literal) -> list[Change]:
    return [AddAxiom(DataPropertyAssertion(prop, ind, value))]


@manipulation(
    'ADD OBJECTPROP IND',
    *(OBJ, IND, _OTHER),
    summary='Relates an individual to another; what it is related to already stays.',
)
def _add_objectprop(_: Reference, prop: str, ind: str, other: str) -> list[Change]:
    return [AddAxiom(ObjectPropertyAssertion(prop, ind, other))]


@manipulation(
    'ADD CARDINALITY MIN|ADD MIN CARDINALITY',
    *(CLS, OBJ, _COUNT, _FILLER),
    summary='States that each instance of a class is related to so many of another class at least.',
    differs='Both orders of the specifications are accepted: the manual has the one, the code the '
    'other.',
    schema=True,
)
def _add_min(_: Reference, cls: str, prop: str, count: int, filler: str) -> list[Change]:
    return [AddAxiom(SubClassOf(cls, ObjectMinCardinality(count, prop, filler)))]


@manipulation(
    'DISJOINT IND',
    IND,
    rest=1,
    summary='States that the individuals are different, each from each.',
)
def _disjoint_ind(_: Reference, *inds: str) -> list[Change]:
    return _different(inds)


@manipulation(
    'DISJOINT IND CLASS',
    CLS,
    summary='States that the instances of a class, asserted and derived so far, are different. '
    'Reason before it.',
)
def _disjoint_ind_class(ref: Reference, cls: str) -> list[Change]:
    return _different(tuple(ref.kb.instances(cls)))


def _different(inds: tuple[str, ...]) -> list[Change]:
    members = frozenset(inds)
    return [AddAxiom(DifferentIndividuals(members))] if len(members) > 1 else []


@manipulation(
    'DISJOINT CLASS',
    CLS,
    rest=1,
    summary='States that no two of the classes share an instance.',
    schema=True,
    most=MOST_CLASSES,
)
def _disjoint_class(_: Reference, *classes: str) -> list[Change]:
    return _disjoint(classes)


@manipulation(
    'DISJOINT CLASS CLASS',
    CLS,
    summary='States that no two subclasses of a class, direct or not, share an instance.',
    differs='owl:Nothing is left out of the axiom, in which it says nothing.',
    schema=True,
)
def _disjoint_class_class(ref: Reference, cls: str) -> list[Change]:
    return _disjoint(tuple(ref.kb.subclasses(cls) - {NOTHING, THING}))


def _disjoint(classes: tuple[str, ...]) -> list[Change]:
    members = tuple(sorted(set(classes)))
    return [AddAxiom(DisjointClasses(members))] if len(members) > 1 else []


@manipulation(
    'MAKE EQUIVALENT CLASS|MAKE EQUIVALENT',
    CLS,
    summary='Turns all that a class is asserted to be a subclass of into its definition.',
    schema=True,
)
def _make_equivalent(ref: Reference, cls: str) -> list[Change]:
    above = [
        axiom
        for axiom in ref.kb.axioms_about(cls)
        if isinstance(axiom, SubClassOf) and axiom.sub == cls and axiom.sup != THING
    ]
    if not above:
        return []
    parts: tuple[ClassExpression, ...] = tuple(sorted((axiom.sup for axiom in above), key=repr))
    whole = parts[0] if len(parts) == 1 else ObjectIntersectionOf(parts)
    return [
        *(RemoveAxiom(axiom) for axiom in above),
        AddAxiom(EquivalentClasses((cls, whole))),
    ]


@manipulation(
    'REMOVE IND',
    IND,
    summary='Removes an individual with all that is asserted of it.',
    differs='A statement that it and others are different goes on to hold for the others; ARMOR '
    'removes the whole statement.',
)
def _remove_ind(_: Reference, ind: str) -> list[Change]:
    return [RemoveEntity('individual', ind)]


@manipulation('REMOVE IND CLASS', IND, CLS, summary='Retracts that an individual is of a class.')
def _remove_ind_class(_: Reference, ind: str, cls: str) -> list[Change]:
    return [RemoveAxiom(ClassAssertion(cls, ind))]


@manipulation(
    'REMOVE CLASS',
    CLS,
    summary='Removes a class with all that is asserted of it.',
    differs='ARMOR only retracts that it is a subclass of owl:Thing, which changes nothing.',
    schema=True,
)
def _remove_class(_: Reference, cls: str) -> list[Change]:
    return [RemoveEntity('class', cls)]


@manipulation(
    'REMOVE CLASS CLASS', CLS, _SUPER, summary='Retracts a subclass relation.', schema=True
)
def _remove_class_class(_: Reference, cls: str, above: str) -> list[Change]:
    return [RemoveAxiom(SubClassOf(cls, above))]


@manipulation(
    'REMOVE DATAPROP IND',
    *(DAT, IND, TYPE, GONE),
    summary='Retracts a value of a data property. Value and type must be those asserted, else '
    'nothing happens.',
    verb='removed from',
)
def _remove_dataprop(ref: Reference, prop: str, ind: str, value: Literal) -> list[Change]:
    return _retracted(ref, prop, ind, value)


@manipulation(
    'REMOVE OBJECTPROP IND',
    *(OBJ, IND, _OTHER),
    summary='Retracts a relation; nothing happens when it is not asserted.',
)
def _remove_objectprop(_: Reference, prop: str, ind: str, other: str) -> list[Change]:
    return [RemoveAxiom(ObjectPropertyAssertion(prop, ind, other))]


@manipulation(
    'REPLACE DATAPROP IND',
    *(DAT, IND, TYPE, NEW, OLD),
    summary='Retracts the old value and adds the new one. With a wrong old value both stay.',
    type_error_succeeds=False,
    verb='replaced from',
)
def _replace_dataprop(
    ref: Reference, prop: str, ind: str, new: Literal, old: Literal
) -> list[Change]:
    return [
        *_retracted(ref, prop, ind, old),
        AddAxiom(DataPropertyAssertion(prop, ind, new)),
    ]


def _retracted(ref: Reference, prop: str, ind: str, value: Literal) -> list[Change]:
    """Retract a value, also where it is written differently in the same type."""
    written = [
        other
        for other in ref.kb.asserted_values(prop, ind)
        if other != value
        and other.datatype == value.datatype
        and value_of(other) == value_of(value)
    ]
    return [RemoveAxiom(DataPropertyAssertion(prop, ind, one)) for one in (value, *written)]


@manipulation(
    'REPLACE OBJECTPROP IND',
    *(OBJ, IND, _NEW_IND, _OLD_IND),
    summary='Retracts the relation to the old individual and adds that to the new one.',
)
def _replace_objectprop(_: Reference, prop: str, ind: str, new: str, old: str) -> list[Change]:
    return [
        RemoveAxiom(ObjectPropertyAssertion(prop, ind, old)),
        AddAxiom(ObjectPropertyAssertion(prop, ind, new)),
    ]


@manipulation(
    'SET DATAPROP IND',
    *(DAT, IND, TYPE, VALUE),
    native=False,
    summary='Makes a value the only one asserted for a data property of an individual, whatever '
    'it had.',
    type_error_succeeds=False,
    verb='set for',
)
def _set_dataprop(_: Reference, prop: str, ind: str, value: Literal) -> list[Change]:
    return [SetAssertion(DataPropertyAssertion(prop, ind, value))]


@manipulation(
    'SET OBJECTPROP IND',
    *(OBJ, IND, _OTHER),
    native=False,
    summary='Makes a relation the only one asserted for an object property of an individual, '
    'whatever it had.',
)
def _set_objectprop(_: Reference, prop: str, ind: str, other: str) -> list[Change]:
    return [SetAssertion(ObjectPropertyAssertion(prop, ind, other))]


def _rename(kind: str, _: Reference, old: str, new: str) -> list[Change]:
    return [RenameEntity(kind, old, new)]


for _word, _read in (
    ('IND', Read.INDIVIDUAL),
    ('CLASS', Read.CLASS),
    ('DATAPROP', Read.DATA_PROPERTY),
    ('OBJECTPROP', Read.OBJECT_PROPERTY),
):
    _article = 'an' if _read.value[0] in 'aeiou' else 'a'
    manipulation(
        f'RENAME {_word}',
        *(Argument('old name', _read), Argument('new name', _read)),
        summary=f'Gives {_article} {_read.value} another name everywhere; merges it with one that '
        'has the name.',
        schema=_read is not Read.INDIVIDUAL,
    )(partial(_rename, ENTITY_KINDS[_read]))
