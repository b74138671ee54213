"""The directives that ask: each a function from the reference to a response.

Answers are sorted, since ARMOR leaves their order open. What is asked about and not known to the
ontology is named in the description of an otherwise empty answer.
"""

from __future__ import annotations

import difflib
import json
import re
from collections.abc import Callable, Iterable, Iterator
from functools import partial
from typing import Any

from armor_service.directives.table import (
    CLS,
    DAT,
    IND,
    OBJ,
    Run,
    flag,
    query,
    text,
)
from armor_service.facts import (
    ANY,
    SAME_AS,
    ShortFact,
    parse_fact,
    parse_names,
    short_name,
)
from armor_service.protocol import DirectiveError, DirectiveResponse, QueryItem
from armor_service.reference import Reference
from armor_service.rendering import (
    parse_entity,
    parse_rendered,
    render_entity,
    short_facts,
    shown,
)
from armor_service.rendering import render_literal as _literal
from armor_service.workspace import Workspace
from owl_reasoner.knowledge_base import Fact
from owl_reasoner.open_world import open_definition
from owl_reasoner.owl.axioms import (
    Axiom,
    ClassAssertion,
    DataPropertyAssertion,
    ObjectPropertyAssertion,
    SameIndividual,
)
from owl_reasoner.owl.entities import entities_of
from owl_reasoner.owl.expressions import (
    ClassExpression,
    DataHasValue,
    DataRange,
    Literal,
    ObjectComplementOf,
    ObjectHasValue,
    ObjectIntersectionOf,
    ObjectInverseOf,
    ObjectUnionOf,
    PropertyExpression,
)
from owl_reasoner.owl.vocabulary import NOTHING, OWL, THING, local_name
from owl_reasoner.reasoner.non_entailment import Absence


def _entities(iris: Iterable[str]) -> list[str]:
    return sorted(map(render_entity, iris))


def _answer(objects: list[str], ref: Reference, *asked: tuple[str, str]) -> DirectiveResponse:
    """Answer with objects; when there are none, say which entity asked about is unknown."""
    note = _unknown(ref, *asked) if not objects else ''
    return DirectiveResponse(queried_objects=objects, error_description=note)


def _unknown(ref: Reference, *asked: tuple[str, str]) -> str:
    """Return which entities are unknown, with the nearest known class or property; or nothing."""
    unknown: list[str] = []
    for kind, iri in asked:
        if not iri.startswith(OWL) and not ref.kb.is_known(kind, iri):
            known = {local_name(name): name for name in ref.kb.schema_names(kind)}
            alike = difflib.get_close_matches(local_name(iri), known, n=1)
            instead = f' (there is {render_entity(known[alike[0]])})' if alike else ''
            unknown.append(f'{kind.replace("_", " ")} {render_entity(iri)}{instead}')
    return f'{ref.name} has no {" and no ".join(unknown)}' if unknown else ''


def named_individuals(iris: Iterable[str]) -> DirectiveResponse:
    """Answer with individuals; those without a name, of whom no client can speak, are told."""
    iris = list(iris)
    named = [iri for iri in iris if not iri.startswith('_:')]
    count = len(iris) - len(named)
    more = f'{count} without a name left out; QUERY FACT shows them' if count else ''
    return DirectiveResponse(queried_objects=_entities(named), error_description=more)


def _individuals(iris: Iterable[str], ref: Reference, *asked: tuple[str, str]) -> DirectiveResponse:
    response = named_individuals(iris)
    if not response.queried_objects and not response.error_description:
        response.error_description = _unknown(ref, *asked)
    return response


@query(
    'QUERY IND',
    IND,
    summary='All types of an individual except owl:Thing; without any, success is false and the '
    'exit code 0.',
)
def _types(ref: Reference, ind: str) -> DirectiveResponse:
    response = _answer(_entities(ref.kb.types(ind)), ref, ('individual', ind))
    response.success = bool(response.queried_objects)
    if not response.success and not response.error_description:
        response.error_description = f'{render_entity(ind)} is of no class but owl:Thing'
    return response


@query(
    'QUERY IND CLASS',
    CLS,
    gathers=True,
    summary='All individuals of a class, asserted and derived; those without a name are counted '
    'in the description.',
)
def _instances(ref: Reference, cls: str) -> DirectiveResponse:
    return _individuals(ref.kb.instances(cls), ref, ('class', cls))


@query('QUERY DATAPROP IND', DAT, IND, summary='The values of a data property of an individual.')
def _data_values(ref: Reference, prop: str, ind: str) -> DirectiveResponse:
    values = sorted(map(_literal, ref.kb.data_values(prop, ind)))
    return _answer(values, ref, ('data_property', prop), ('individual', ind))


@query(
    'QUERY OBJECTPROP IND',
    *(OBJ, IND),
    summary='What an individual is related to by a property; individuals without a name are '
    'counted in the description.',
)
def _object_values(ref: Reference, prop: str, ind: str) -> DirectiveResponse:
    values = ref.kb.object_values(prop, ind)
    return _individuals(values, ref, ('object_property', prop), ('individual', ind))


@query(
    'QUERY CLASS IND',
    IND,
    flag('bottom', 'false'),
    summary='The types of an individual. With bottom the short name of one type that has no '
    'subclass.',
    differs='The second argument may be left out. Of several bottom types the first by name is '
    'given; ARMOR picks any.',
)
def _classes(ref: Reference, ind: str, bottom: bool) -> DirectiveResponse:
    types = ref.kb.types(ind)
    if not bottom:
        return _answer(_entities(types), ref, ('individual', ind))
    ends = {NOTHING, THING}
    lowest = sorted(local_name(cls) for cls in types if not ref.kb.subclasses(cls) - ends)
    return _answer(lowest[:1], ref, ('individual', ind))


@query(
    'QUERY CLASS CLASS',
    CLS,
    summary='All classes below a class, direct and indirect, owl:Nothing among them.',
)
def _subclasses(ref: Reference, cls: str) -> DirectiveResponse:
    classes = ref.kb.subclasses(cls) | {NOTHING}
    below = _entities(classes)
    return DirectiveResponse(queried_objects=below, error_description=_unknown(ref, ('class', cls)))


@query(
    'QUERY CLASS RESTRICTIONS',
    CLS,
    summary='What a class is defined by, one text for each definition.',
)
def _restrictions(ref: Reference, cls: str) -> DirectiveResponse:
    described = [_described(cls, definition) for definition in ref.kb.equivalents(cls)]
    return _answer(sorted(filter(None, described)), ref, ('class', cls))


@query('QUERY IND DATAPROP', IND, summary='The data properties of which an individual has a value.')
def _data_properties(ref: Reference, ind: str) -> DirectiveResponse:
    return _answer(_entities(ref.kb.data_properties_of(ind)), ref, ('individual', ind))


@query(
    'QUERY IND OBJECTPROP', IND, summary='The object properties of which an individual has a value.'
)
def _object_properties(ref: Reference, ind: str) -> DirectiveResponse:
    return _answer(_entities(ref.kb.object_properties_of(ind)), ref, ('individual', ind))


@query(
    'QUERY EXPLAIN',
    text('fact'),
    native=False,
    slow=True,
    summary='Why a fact holds, written as `URGENT(R3)`, `connectedTo(R1, C1)` or '
    '`owl:sameAs(a, b)`: first an English sentence, then the derivation as a tree.',
)
def _explain(_: Workspace, ref: Reference, fact: str) -> DirectiveResponse:
    with ref.held():
        asked = _full_fact('QUERY EXPLAIN', ref, fact)
        explanation = ref.explain(asked)
        unknown = _unknown(ref, *entities_of(asked)) if explanation is None else ''
    if explanation is None:
        reason = f': {unknown}' if unknown else ''
        return DirectiveResponse(
            success=False,
            error_description=f'{fact} is neither asserted nor derived in {ref.name}{reason}',
        )
    return DirectiveResponse(queried_objects=[explanation.sentence(), explanation.tree()])


@query(
    'QUERY EXPLAIN ABSENCE',
    text('fact'),
    native=False,
    summary='What a fact that does not hold lacks, of the rule or definition nearest to it: first '
    'an English sentence, then each missing condition; nothing where it holds. Where a definition '
    'asks for what nothing says, the directive that states it is named.',
)
def _explain_absence(ref: Reference, fact: str) -> DirectiveResponse:
    asked = _full_fact('QUERY EXPLAIN ABSENCE', ref, fact)
    absence = ref.kb.explain_absence(asked)
    unknown = _unknown(ref, *entities_of(asked))
    if absence is not None:
        found = _closable(ref, asked, absence) or [absence.sentence(), *absence.missing]
        return DirectiveResponse(queried_objects=found, error_description=unknown)
    if ref.kb.holds(asked):
        return DirectiveResponse(error_description=f'{fact} holds in {ref.name}')
    problem = f'{fact} does not hold in {ref.name}{": " if unknown else ""}{unknown}'
    if not ref.kb.consistent:
        problem = f'{ref.name} is inconsistent'
    return DirectiveResponse(success=False, error_description=problem)


def _closable(ref: Reference, fact: Fact, absence: Absence) -> list[str]:
    """Return what the open world withholds of a fact, with the directives that close it."""
    found = open_definition(ref.kb, fact)
    if found is None or (absence.because and not found.can_be_closed):
        return []
    lines = [found.sentence(absence.fact_text)]
    who = local_name(found.individual)
    for gap in found.gaps:
        offer = ''
        if gap.closing is not None:
            kind, iri = gap.closing
            word = 'OBJECTPROP' if kind == 'property' else 'CLASS'
            offer = f' (CLOSE {word} IND {local_name(iri)} {who})'
        lines.append(gap.text + offer)
    return lines


@query(
    'QUERY EXPLAIN INCONSISTENCY',
    native=False,
    slow=True,
    summary='Why the ontology contradicts itself, in the form of QUERY EXPLAIN; else nothing.',
)
def _explain_inconsistency(_: Workspace, ref: Reference) -> DirectiveResponse:
    with ref.held():
        explanation = ref.explain(None)
    if explanation is None:
        return DirectiveResponse(error_description=f'{ref.name} is consistent')
    return DirectiveResponse(queried_objects=[explanation.sentence(), explanation.tree()])


@query(
    'QUERY UNSUPPORTED',
    native=False,
    gathers=True,
    summary='What the ontology holds that the reasoner does not use, one sentence each.',
)
def _unsupported(ref: Reference) -> DirectiveResponse:
    return DirectiveResponse(queried_objects=list(ref.kb.unsupported))


@query(
    'QUERY TAKEN BACK',
    native=False,
    summary='The changes that were taken back because reasoning over them took too long or ended '
    'the process: what, whose, when and why, one line each.',
)
def _rolled_back(ref: Reference) -> DirectiveResponse:
    return DirectiveResponse(
        queried_objects=list(ref.quarantine.lines), error_description=ref.too_hard
    )


@query(
    'QUERY FACT',
    text('pattern'),
    flag('asserted', 'false'),
    native=False,
    gathers=True,
    summary='Facts that match a pattern, `URGENT(?)`, `connectedTo(R1, ?)`, `hasDoor(?, ?)`: '
    'asserted and derived ones, or with the second argument the asserted ones only.',
)
def _facts(ref: Reference, pattern: str, asserted: bool) -> DirectiveResponse:
    return _matching('QUERY FACT', ref, pattern, asserted)


def _matching(words: str, ref: Reference, pattern: str, asserted: bool) -> DirectiveResponse:
    try:
        wanted, written = parse_fact(pattern), parse_names(pattern)
        candidates = _asserted(ref, written) if asserted else _candidates(ref, written)
    except ValueError as error:
        raise DirectiveError(f'{words}: argument pattern {error}') from None
    found = {str(fact) for fact in candidates if wanted.matches(fact)}
    return DirectiveResponse(queried_objects=sorted(found))


def _asserted(ref: Reference, wanted: ShortFact) -> Iterable[ShortFact]:
    """Return asserted facts among which those that match a pattern are."""
    kb = ref.kb
    axioms: Iterable[Axiom] = kb.facts(derived=False)
    if wanted.predicate not in (ANY, SAME_AS):
        axioms = kb.axioms_about(_entity(ref, wanted.predicate))
    return (short for axiom in axioms for short in short_facts(axiom))


def _candidates(ref: Reference, wanted: ShortFact) -> Iterable[ShortFact]:
    """Return facts among which those that match a pattern are, without going through all if
    possible.
    """
    name, arguments, kb = wanted.predicate, wanted.arguments, ref.kb
    if ANY not in (name, arguments[0]) and name != SAME_AS:
        predicate, ind = _entity(ref, name), _entity(ref, arguments[0])
        short, who = short_name(name), short_name(arguments[0])
        if len(arguments) == 1:
            anything = predicate == THING and kb.is_known('individual', ind)
            holds = anything or predicate in kb.types(ind)
            return (ShortFact(short, (who,)),) if holds else ()
        values = [local_name(other) for other in kb.object_values(predicate, ind)]
        values += map(_literal, kb.data_values(predicate, ind))
        return (ShortFact(short, (who, value)) for value in values)
    if name != ANY and len(arguments) == 1:
        members = kb.instances(_entity(ref, name))
        return (ShortFact(short_name(name), (local_name(ind),)) for ind in members)
    return (short for fact in kb.facts() for short in short_facts(fact))


def _entity(ref: Reference, name: str) -> str:
    """Return the entity of a name in a fact; ``<A,B>`` is the local name A,B."""
    bracketed = name[0] == '<' and ':' not in name
    return f'{ref.kb.iri}#{name[1:-1]}' if bracketed else parse_entity(name, ref.kb.iri)


def _full_fact(words: str, ref: Reference, text: str) -> Fact:
    try:
        short = parse_names(text)
        read: Callable[[str], str] = partial(_entity, ref)
        if len(short.arguments) == 1:
            return ClassAssertion(read(short.predicate), read(short.arguments[0]))
        subject, value = short.arguments
        if short.predicate in (SAME_AS, 'sameAs'):
            return SameIndividual(frozenset((read(subject), read(value))))
        prop = read(short.predicate)
        if value.startswith('"'):
            return DataPropertyAssertion(prop, read(subject), parse_rendered(value))
        if ref.kb.is_known('data_property', prop):
            values = sorted(ref.kb.data_values(prop, read(subject)), key=_literal)
            same = next((one for one in values if one.lexical == value), None)
            if same or not ref.kb.is_known('object_property', prop):
                return DataPropertyAssertion(prop, read(subject), same or Literal(value))
        return ObjectPropertyAssertion(prop, read(subject), read(value))
    except ValueError as error:
        raise DirectiveError(f'{words}: argument fact {error}') from None


_RESTRICTION = re.compile('(Object|Data)(Some|All|Min|Max|Exact)(?:ValuesFrom|Cardinality)')


def _described(cls: str, definition: ClassExpression) -> str:
    """Return a class definition in ARMOR's form; empty where ARMOR has no form for any part.

    ``[C-DEFINITION_CLASS : ROOM -> (LOCATION), C-DEFINITION_SOME_OBJECT : ROOM -> hasDoor(DOOR)]``;
    named classes inside a restriction are listed once more by themselves.
    """
    atoms = list(dict.fromkeys(_atoms(local_name(cls), definition)))
    return f'[{", ".join(atoms)}]' if atoms else ''


def _atoms(name: str, part: Any) -> Iterator[str]:
    head = f'C-DEFINITION_{{}} : {name} -> '
    if isinstance(part, str):
        yield f'{head.format("CLASS")}({local_name(part)})'
    elif isinstance(part, ObjectIntersectionOf | ObjectUnionOf):
        for operand in part.operands:
            yield from _atoms(name, operand)
    elif isinstance(part, ObjectComplementOf):
        yield from _atoms(name, part.operand)
    elif isinstance(part, ObjectHasValue):
        yield f'{head.format("SOME_OBJECT")}{_prop(part.prop)}({local_name(part.individual)})'
    elif isinstance(part, DataHasValue):
        yield f'{head.format("SOME_DATA")}{_prop(part.prop)}({part.literal.lexical})'
    elif found := _RESTRICTION.fullmatch(type(part).__name__):
        kind = f'{found[2]}_{found[1]}'.upper()
        number = f' {part.n}' if hasattr(part, 'n') else ''
        filler = part.filler if hasattr(part, 'filler') else part.range
        yield f'{head.format(kind)}{_prop(part.prop)}{number}({_filler_text(filler)})'
        if found[1] == 'Object' and not type(filler).__name__.startswith('Data'):
            yield from _atoms(name, filler)


def _filler_text(filler: ClassExpression | DataRange) -> str:
    if isinstance(filler, str):
        return local_name(filler)
    if isinstance(filler, ObjectIntersectionOf | ObjectUnionOf):
        word = ' and ' if isinstance(filler, ObjectIntersectionOf) else ' or '
        return word.join(_filler_text(operand) for operand in filler.operands)
    return type(filler).__name__


def _prop(prop: PropertyExpression) -> str:
    if isinstance(prop, ObjectInverseOf):
        return f'inverse({local_name(prop.prop)})'
    return local_name(prop)


_SPARQL_SUMMARY = (
    'A SELECT query, whole or in three parts that are joined as they are (prefixes, select, '
    'where), then optionally the longest time in milliseconds. '
)
_SPARQL_DIFFERS = (
    'Derived facts are seen too, unless the parameter sparql_derived is off. A query that cannot '
    'be run is no success and says why; one that is stopped has timeout set. Without a time the '
    'parameter sparql_timeout holds, which no query exceeds. Two values of one property of one '
    'individual that are equal and written differently are one row.'
)


def _sparql(words: str, form: str, **properties: Any) -> Callable[[Run], Run]:
    """Enter a SPARQL query; ``form`` says in what form the rows come."""
    summary = _SPARQL_SUMMARY + form
    return query(words, text('query'), rest=1, slow=True, summary=summary, **properties)


@_sparql(
    'QUERY SPARQL',
    'All rows in one text: `{x=iri, v=5^^datatype}, {...}`.',
    differs=_SPARQL_DIFFERS,
)
def _rows_as_text(workspace: Workspace, ref: Reference, *parts: str) -> DirectiveResponse:
    rows = _select(workspace, ref, parts)
    texts = [', '.join(f'{name}={value}' for name, value in row) for row in rows]
    return DirectiveResponse(queried_objects=[', '.join(f'{{{text}}}' for text in texts)])


@_sparql(
    'QUERY SPARQL FORMATTED',
    'The rows one after the other as pairs of variable and value.',
    differs=_SPARQL_DIFFERS,
)
def _rows_as_pairs(workspace: Workspace, ref: Reference, *parts: str) -> DirectiveResponse:
    rows = _select(workspace, ref, parts)
    return DirectiveResponse(sparql_queried_objects=[item for row in rows for item in row])


@_sparql(
    'QUERY SPARQL ROWS',
    'One JSON object for each row, variable to value; a variable that the row leaves unbound is '
    'left out, which the other two forms cannot show.',
    native=False,
)
def _rows_as_json(workspace: Workspace, ref: Reference, *parts: str) -> DirectiveResponse:
    rows = _select(workspace, ref, parts)
    objects = [json.dumps(dict(row), ensure_ascii=False) for row in rows]
    return DirectiveResponse(queried_objects=objects)


def _select(workspace: Workspace, ref: Reference, parts: tuple[str, ...]) -> list[list[QueryItem]]:
    if len(parts) > 4:
        raise DirectiveError(f'QUERY SPARQL: expected 1 to 4 arguments, got {len(parts)}')
    *texts, last = parts if len(parts) in (2, 4) else (*parts, '0')
    limit = workspace.settings.sparql_timeout
    asked = _milliseconds(last) / 1000
    seconds = min(asked, limit) if asked > 0 else limit
    try:
        return workspace.sparql.select(ref, ''.join(texts), seconds)
    except TimeoutError:
        raise DirectiveError(
            f'QUERY SPARQL: stopped after {seconds * 1000:g} ms', timeout=True
        ) from None


def _milliseconds(text: str) -> int:
    try:
        return int(text)
    except ValueError:
        raise DirectiveError(
            f'QUERY SPARQL: argument timeout {shown(text)}: expected whole milliseconds'
        ) from None
