"""Changes of an ontology as values: they wait in a buffer, are applied, and go into the journal."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, fields, is_dataclass
from typing import Any

from surveillance_ontology.knowledge_base import KnowledgeBase
from surveillance_ontology.owl import axioms, expressions
from surveillance_ontology.owl.axioms import Axiom
from surveillance_ontology.owl.expressions import Literal


@dataclass(frozen=True, slots=True)
class AddAxiom:
    """Assert an axiom; nothing happens when it is asserted already."""

    axiom: Axiom


@dataclass(frozen=True, slots=True)
class RemoveAxiom:
    """Retract an axiom; nothing happens when it is not asserted."""

    axiom: Axiom


@dataclass(frozen=True, slots=True)
class RenameEntity:
    """Give an entity another IRI everywhere; merges with an entity that has it already."""

    kind: str
    old: str
    new: str


@dataclass(frozen=True, slots=True)
class RemoveEntity:
    """Retract whatever is asserted of an entity."""

    kind: str
    iri: str


Change = AddAxiom | RemoveAxiom | RenameEntity | RemoveEntity

_RECORDS: dict[str, type] = {
    name: member
    for module in (axioms, expressions)
    for name, member in vars(module).items()
    if isinstance(member, type) and is_dataclass(member) and member is not Literal
} | {change.__name__: change for change in (AddAxiom, RemoveAxiom, RenameEntity, RemoveEntity)}
_FIELDS = {name: tuple(f.name for f in fields(record)) for name, record in _RECORDS.items()}


def encode(value: Any) -> Any:
    """Turn an axiom or a change into lists, strings and numbers that JSON holds.

    A record becomes ``[class name, field, ...]``, a tuple ``["t", ...]``, a set ``["s", ...]``, a
    literal ``["l", lexical, datatype, language]``.
    """
    if isinstance(value, str | int):
        return value
    if isinstance(value, Literal):
        return ['l', value.lexical, value.datatype, value.language]
    if isinstance(value, tuple):
        return ['t', *map(encode, value)]
    if isinstance(value, frozenset):
        return ['s', *map(encode, sorted(value))]
    name = type(value).__name__
    return [name, *[encode(getattr(value, field)) for field in _FIELDS[name]]]


def decode(value: Any) -> Any:
    """Undo `encode`.

    Raises:
        ValueError: Not something `encode` wrote.
    """
    if not isinstance(value, list):
        return value
    if not value or not isinstance(value[0], str):
        raise ValueError(f'no record: {value!r:.80}')
    tag, *parts = value
    if tag == 'l':
        return Literal(*parts)
    decoded = [decode(part) for part in parts]
    if tag == 't':
        return tuple(decoded)
    if tag == 's':
        return frozenset(decoded)
    if tag not in _RECORDS:
        raise ValueError(f'unknown record {tag!r}')
    return _RECORDS[tag](*decoded)


def apply_all(kb: KnowledgeBase, changes: Iterable[Change]) -> None:
    """Carry out changes in order; retractions and the assertions behind them are one batch."""
    removed: list[Axiom] = []
    added: list[Axiom] = []
    for change in changes:
        if isinstance(change, AddAxiom):
            added.append(change.axiom)
            continue
        if added or not isinstance(change, RemoveAxiom):
            kb.change(added, removed)
            added, removed = [], []
        if isinstance(change, RemoveAxiom):
            removed.append(change.axiom)
        elif isinstance(change, RenameEntity):
            kb.rename(change.kind, change.old, change.new)
        else:
            kb.remove_entity(change.kind, change.iri)
    kb.change(added, removed)
