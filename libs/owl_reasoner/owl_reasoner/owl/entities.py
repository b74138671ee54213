"""The entities that axioms and expressions mention, and how to rename one."""

from __future__ import annotations

import re
from collections.abc import Iterator
from dataclasses import fields, replace
from typing import Any

from owl_reasoner.owl.axioms import AnnotationAssertion, Axiom, Declaration, Import
from owl_reasoner.owl.expressions import Literal, Variable

_KIND_OF_TYPE = {
    'ClassExpression': 'class',
    'PropertyExpression': 'object_property',
    'DataRange': 'datatype',
    'IndividualArgument': 'individual',
}
"""The kind of entity that a bare string stands for where a field is of such a type."""
_KIND_OF_NAME = {
    'cls': 'class',
    'individual': 'individual',
    'individuals': 'individual',
    'subject': 'individual',
    'object': 'individual',
    'datatype': 'datatype',
    'data_props': 'data_property',
}
"""The same where the type is a string: by the name of the field."""
_SEVERAL = re.compile(r'(?:tuple|frozenset)\[(\w+)')


_ROLES: dict[type, tuple[tuple[str, str], ...]] = {}


def roles_of(record: type) -> tuple[tuple[str, str], ...]:
    """For each field of a record type, the entity kind a bare `str` in it stands for, or ''."""
    roles = _ROLES.get(record)
    if roles is None:
        roles = _ROLES[record] = _roles_of(record)
    return roles


def _roles_of(record: type[Any]) -> tuple[tuple[str, str], ...]:
    if issubclass(record, AnnotationAssertion):
        return (('prop', 'annotation_property'), ('subject', 'annotated'), ('value', 'annotated'))
    pairs = []
    for entry in fields(record):
        several = _SEVERAL.match(str(entry.type))
        role = _KIND_OF_TYPE.get(several[1] if several else str(entry.type), '')
        role = role or _KIND_OF_NAME.get(entry.name, '')
        if not role and entry.name in ('prop', 'props', 'sub', 'sup'):
            role = 'data_property' if 'Data' in record.__name__ else 'object_property'
        pairs.append((entry.name, role))
    return tuple(pairs)


def entities_of(record: object) -> Iterator[tuple[str, str]]:
    """Yield every entity a record mentions, as pairs (kind, IRI), with repeats.

    `kind` is one of `axioms.KINDS`, or 'annotated' for the IRIs of an annotation.
    """
    if isinstance(record, Declaration):
        yield record.kind, record.iri
        return
    if isinstance(record, (Literal, Variable, Import, str)):
        return
    for name, role in roles_of(type(record)):
        value = getattr(record, name)
        if name in ('annotations', 'facets'):
            continue
        parts = value if isinstance(value, (tuple, frozenset)) else (value,)
        for part in parts:
            if isinstance(part, str):
                if role:
                    yield role, part
            elif not isinstance(part, (int, Literal, Variable)):
                yield from entities_of(part)


def names_anonymous(record: object) -> bool:
    """Tell whether a record mentions an individual that has no IRI."""
    return any(name.startswith('_:') for _, name in entities_of(record))


def renamed(axiom: Axiom, kind: str, old: str, new: str) -> Axiom:
    """Return the axiom with an entity's IRI replaced wherever it stands for an entity of that
    kind.
    """
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
