"""Giving an entity another IRI in an axiom."""

from __future__ import annotations

from dataclasses import replace

from surveillance_ontology.owl.axioms import Axiom, Declaration
from surveillance_ontology.owl.entities import roles_of


def renamed(axiom: Axiom, kind: str, old: str, new: str) -> Axiom:
    """The axiom with an entity's IRI replaced wherever it stands for an entity of that kind."""
    rewritten = _renamed(axiom, kind, old, new)
    assert isinstance(rewritten, Axiom)
    return rewritten


def _renamed(record: object, kind: str, old: str, new: str) -> object:
    if isinstance(record, Declaration):
        return Declaration(kind, new) if (record.kind, record.iri) == (kind, old) else record
    fields: dict[str, object] = {}
    for name, role in roles_of(type(record)):
        value = getattr(record, name)
        accepted = role in (kind, 'annotated')
        if isinstance(value, str):
            changed: object = new if value == old and accepted else value
        elif isinstance(value, frozenset):
            changed = frozenset(new if part == old and accepted else part for part in value)
        elif isinstance(value, tuple) and name not in ('annotations', 'facets'):
            changed = tuple(_renamed_part(part, accepted, kind, old, new) for part in value)
        else:
            changed = _renamed_part(value, False, kind, old, new)
        if changed is not value:
            fields[name] = changed
    return replace(record, **fields) if fields else record  # type: ignore[type-var]


def _renamed_part(part: object, accepted: bool, kind: str, old: str, new: str) -> object:
    if isinstance(part, str):
        return new if part == old and accepted else part
    if hasattr(type(part), '__dataclass_fields__') and type(part).__name__ not in (
        'Literal',
        'Variable',
    ):
        return _renamed(part, kind, old, new)
    return part
