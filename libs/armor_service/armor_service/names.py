"""Names that a change makes up: mistyped ones, and properties that are taken for another kind.

ARMOR takes any name, and a class or property comes into being by being named. So a mistyped one
does as well; it is named in the answer with the one that was meant, or refused.
"""

from __future__ import annotations

import difflib
from collections.abc import Iterable, Iterator

from armor_service.changes import AddAxiom, Change, SetAssertion
from armor_service.reference import Reference
from armor_service.rendering import render_entity
from owl_reasoner.owl.axioms import Axiom, ClassAssertion
from owl_reasoner.owl.entities import entities_of
from owl_reasoner.owl.vocabulary import OWL, local_name

ALIKE = 0.75
"""How alike two names are at least, of 1, for one to be taken for the other mistyped."""
_KINDS = ('class', 'object_property', 'data_property')
_OTHER = {'object_property': 'data_property', 'data_property': 'object_property'}


def doubtful_names(ref: Reference, changes: Iterable[Change]) -> Iterator[str]:
    """Yield one sentence for each name that changes add and that was probably not meant.

    Args:
        ref: What is to change.
        changes: The changes, not applied yet.
    """
    for kind, iri in dict.fromkeys(_added(changes)):
        if iri.startswith(OWL) or _is_known(ref, kind, iri):
            continue
        name, words = render_entity(iri), kind.replace('_', ' ')
        other = _OTHER.get(kind)
        if other is not None and _is_known(ref, other, iri):
            yield (
                f'{name} is used as {_article(words)} and is {_article(other.replace("_", " "))}, '
                'which OWL 2 DL forbids'
            )
            continue
        known = {local_name(one): one for one in ref.kb.schema_names(kind)}
        alike = difflib.get_close_matches(local_name(iri), known, 1, ALIKE)
        if alike:
            yield f'{words} {name} is new; there is {render_entity(known[alike[0]])}'


def unknown_names(ref: Reference, changes: Iterable[Change]) -> Iterator[str]:
    """Yield one sentence for each class or property of a fact that the ontology does not know."""
    for kind, iri in dict.fromkeys(_added(changes, facts=True)):
        if not iri.startswith(OWL) and not _is_known(ref, kind, iri):
            known = {local_name(one): one for one in ref.kb.schema_names(kind)}
            alike = difflib.get_close_matches(local_name(iri), known, 1)
            instead = f'; there is {render_entity(known[alike[0]])}' if alike else ''
            yield f'{ref.name} has no {kind.replace("_", " ")} {render_entity(iri)}{instead}'


def _added(changes: Iterable[Change], *, facts: bool = False) -> Iterator[tuple[str, str]]:
    for change in changes:
        if isinstance(change, AddAxiom | SetAssertion):
            axiom: Axiom = change.axiom
            if facts and not (isinstance(axiom, ClassAssertion) or hasattr(axiom, 'subject')):
                continue
            for kind, iri in entities_of(axiom):
                if kind in _KINDS:
                    yield kind, iri


def _is_known(ref: Reference, kind: str, iri: str) -> bool:
    if ref.kb.is_known(kind, iri):
        return True
    return any((kind, iri) in set(_added(told.changes)) for told in ref.buffering.waiting)


def _article(words: str) -> str:
    return f'{"an" if words[0] in "aeiou" else "a"} {words}'
