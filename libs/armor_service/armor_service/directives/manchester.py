"""The directives whose arguments are in Manchester syntax: axioms, rules and class expressions.

Names are local names as in other directives; ``<iri>`` stands for itself.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import Any

from armor_service.changes import AddAxiom, Change, RemoveAxiom
from armor_service.directives.queries import named_individuals
from armor_service.directives.table import manipulation, query, text
from armor_service.protocol import DirectiveError, DirectiveResponse
from armor_service.reference import Reference, knowledge_base
from armor_service.rendering import parse_entity
from armor_service.workspace import Workspace
from owl_reasoner.documents.manchester import ManchesterParser, ManchesterWriter
from owl_reasoner.documents.structural import PREFIXES
from owl_reasoner.documents.xml_reading import OntologyFileError
from owl_reasoner.owl.axioms import (
    KINDS,
    Axiom,
    AxiomAnnotation,
    Declaration,
    EquivalentClasses,
    Import,
    Rule,
)
from owl_reasoner.owl.entities import entities_of

ASKED = 'urn:asked'
"""The name of a class expression while its individuals are looked for."""
_FRAMES = 'such as `Class: DeadEnd EquivalentTo: LOCATION and (hasDoor exactly 1)`'


def _parser(ref: Reference, written: str) -> ManchesterParser:
    def named(name: str) -> str:
        if name.startswith('_:'):
            raise ValueError('it is an individual without a name')
        prefix, colon, local = name.partition(':')
        if colon and prefix in PREFIXES and not local.startswith('//'):
            return PREFIXES[prefix] + local
        if colon and prefix in ref.origin.prefixes and not local.startswith('//'):
            return ref.origin.prefixes[prefix] + local
        return parse_entity(name, ref.kb.iri)

    kinds = {
        (kind, iri)
        for kind in ('object_property', 'data_property', 'class', 'datatype')
        for iri in _names(ref, kind)
    }
    return ManchesterParser(written, named, kinds)


def _names(ref: Reference, kind: str) -> set[str]:
    found = set(ref.kb.schema_names(kind))
    if not found:
        # A large ontology: what is declared.
        axioms = ref.kb.axioms()
        found = {a.iri for a in axioms if isinstance(a, Declaration) and a.kind == kind}
    return found


def _read(words: str, what: str, read: Callable[[], Any]) -> Any:
    try:
        return read()
    except OntologyFileError as error:
        where = f'{error.line}:{error.column}: {error.message}'
        raise DirectiveError(f'{words}: argument {what}: {where}') from None
    except ValueError as error:
        raise DirectiveError(f'{words}: argument {what}: {error}') from None


def _check_all_kept(words: str, what: str, parser: ManchesterParser) -> None:
    for told in parser.unsupported:
        raise DirectiveError(f'{words}: argument {what}: {told}')


def _axioms(words: str, ref: Reference, written: str) -> list[Axiom]:
    parser = _read(words, 'axiom', lambda: _parser(ref, written))
    axioms: list[Axiom] = _read(words, 'axiom', parser.axioms)
    _check_all_kept(words, 'axiom', parser)
    # What a frame declares comes into being with it; removing says nothing of it.
    stated = [axiom for axiom in axioms if not isinstance(axiom, Declaration)]
    if words.startswith('ADD'):
        return [*axioms] if not stated else [a for a in axioms if _is_new(ref, a)]
    return stated or axioms


def _is_new(ref: Reference, axiom: Axiom) -> bool:
    return not isinstance(axiom, Declaration) or not ref.kb.is_known(axiom.kind, axiom.iri)


@manipulation(
    'ADD AXIOM',
    text('axiom'),
    native=False,
    schema=True,
    summary=f'Asserts the axioms of frames in Manchester syntax, {_FRAMES}.',
)
def _add_axiom(ref: Reference, written: str) -> list[Change]:
    return [AddAxiom(axiom) for axiom in _axioms('ADD AXIOM', ref, written)]


@manipulation(
    'REMOVE AXIOM',
    text('axiom'),
    native=False,
    schema=True,
    summary='Retracts the axioms of frames in Manchester syntax; see ADD AXIOM.',
)
def _remove_axiom(ref: Reference, written: str) -> list[Change]:
    return [RemoveAxiom(axiom) for axiom in _axioms('REMOVE AXIOM', ref, written)]


@manipulation(
    'ADD RULE',
    text('rule'),
    native=False,
    schema=True,
    summary='Asserts a rule, `ROOM(?r), hasDoor(?r, ?d) -> Open(?r)`. Built-ins stand by their '
    'names, `greaterThan(?gap, ?limit)`.',
)
def _add_rule(ref: Reference, written: str) -> list[Change]:
    return [AddAxiom(_rule('ADD RULE', ref, written))]


@manipulation(
    'REMOVE RULE',
    text('rule'),
    native=False,
    schema=True,
    summary='Retracts a rule, written as for ADD RULE or as QUERY RULES has it.',
)
def _remove_rule(ref: Reference, written: str) -> list[Change]:
    return [RemoveAxiom(_rule('REMOVE RULE', ref, written))]


def _rule(words: str, ref: Reference, written: str) -> Axiom:
    shortened = written.strip().removeprefix('Rule:')
    parser = _read(words, 'rule', lambda: _parser(ref, shortened))
    rule: Axiom = _read(words, 'rule', lambda: parser.whole(parser.rule))
    _check_all_kept(words, 'rule', parser)
    return rule


@query(
    'QUERY IND EXPRESSION',
    text('class expression'),
    native=False,
    slow=True,
    summary='The individuals of a class expression in Manchester syntax, `ROOM and (hasDoor some '
    'DOOR)`: all is reasoned over once more, with a name for it.',
)
def _individuals(workspace: Workspace, ref: Reference, written: str) -> DirectiveResponse:
    words = 'QUERY IND EXPRESSION'
    with ref.held() as kb:
        parser = _read(words, 'class expression', lambda: _parser(ref, written))
        expression = _read(words, 'class expression', lambda: parser.whole(parser.class_expression))
        axioms, base = list(kb.axioms()), ref.effort.base
    asked = knowledge_base(kb.iri, [*axioms, EquivalentClasses((ASKED, expression))])
    asked.reason(workspace.limits.of(base, len(axioms)), memory=workspace.limits.memory)
    if not asked.consistent:
        return DirectiveResponse(error_description=f'{ref.name} is inconsistent')
    return named_individuals(asked.instances(ASKED))


@query(
    'QUERY AXIOMS',
    text('name'),
    native=False,
    gathers=True,
    summary='What is asserted of a class, property or individual, one axiom each in Manchester '
    'syntax, as ADD AXIOM and REMOVE AXIOM take them.',
)
def _about(ref: Reference, name: str) -> DirectiveResponse:
    iri = _read('QUERY AXIOMS', 'name', lambda: parse_entity(name, ref.kb.iri))
    found = (axiom for axiom in ref.kb.axioms_about(iri) if iri in _entities(axiom))
    return DirectiveResponse(queried_objects=_written(ref, found))


@query(
    'QUERY RULES',
    native=False,
    gathers=True,
    summary='The rules, one each, as ADD RULE and REMOVE RULE take them.',
)
def _rules(ref: Reference) -> DirectiveResponse:
    rules = (replace(a, annotations=()) for a in ref.kb.axioms() if isinstance(a, Rule))
    texts = [text.removeprefix('Rule: ') for text in _written(ref, rules)]
    return DirectiveResponse(queried_objects=texts)


def _entities(axiom: Axiom) -> set[str]:
    return {name for _, name in entities_of(axiom)}


def _written(ref: Reference, axioms: Any) -> list[str]:
    writer = ManchesterWriter({'': f'{ref.kb.iri}#'}, bare=True)
    notes: dict[Axiom, list[AxiomAnnotation]] = {}
    plain: list[Axiom] = []
    for axiom in axioms:
        if isinstance(axiom, AxiomAnnotation):
            notes.setdefault(axiom.axiom, []).append(axiom)
        elif not isinstance(axiom, Import):
            plain.append(axiom)

    def kind_of(iri: str) -> str:
        return next((kind for kind in KINDS if ref.kb.is_known(kind, iri)), 'individual')

    def said_of(axiom: Axiom) -> list[AxiomAnnotation]:
        # Manchester syntax has no place for what is said of a declaration.
        return [] if isinstance(axiom, Declaration) else notes.get(axiom, [])

    return [writer.axiom(axiom, kind_of, said_of(axiom)) for axiom in plain]
