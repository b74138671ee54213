"""The SPARQL directives."""

from __future__ import annotations

import json
from typing import Any

from surveillance_ontology.armor.directives.table import Enter, query, text
from surveillance_ontology.armor.protocol import DirectiveError, DirectiveResponse, QueryItem
from surveillance_ontology.armor.reference import Reference
from surveillance_ontology.armor.rendering import shown
from surveillance_ontology.armor.session import Session
from surveillance_ontology.armor.sparql_engine import Binding
from surveillance_ontology.armor.sparql_graph import GraphUpdate, Version
from surveillance_ontology.owl.vocabulary import XSD

_SUMMARY = (
    'A SELECT query, whole or in three parts that are joined as they are (prefixes, select, '
    'where), then optionally the longest time in milliseconds. '
)
_DIFFERS = (
    'Derived facts are seen too, unless the parameter sparql_derived is off. A query that cannot '
    'be run is no success and says why; one that is stopped has timeout set. Without a time the '
    'parameter sparql_timeout holds, which no query exceeds. Two values of one property of one '
    'individual that are equal and written differently are one row.'
)


def _sparql(words: str, form: str, **properties: Any) -> Enter:
    """Enter a SPARQL query; ``form`` says in what form the rows come."""
    summary = _SUMMARY + form
    return query(words, text('query'), rest=1, slow=True, summary=summary, **properties)


@_sparql('QUERY SPARQL', 'All rows in one text: `{x=iri, v=5^^datatype}, {...}`.', differs=_DIFFERS)
def _rows_as_text(session: Session, ref: Reference, *parts: str) -> DirectiveResponse:
    rows = _select(session, ref, parts)
    texts = [', '.join(f'{b.variable}={_value(b)}' for b in row) for row in rows]
    return DirectiveResponse(queried_objects=[', '.join(f'{{{text}}}' for text in texts)])


@_sparql(
    'QUERY SPARQL FORMATTED',
    'The rows one after the other as pairs of variable and value.',
    differs=_DIFFERS,
)
def _rows_as_pairs(session: Session, ref: Reference, *parts: str) -> DirectiveResponse:
    rows = _select(session, ref, parts)
    pairs = [QueryItem(bound.variable, _value(bound)) for row in rows for bound in row]
    return DirectiveResponse(sparql_queried_objects=pairs)


@_sparql(
    'QUERY SPARQL ROWS',
    'One JSON object for each row, variable to value; a variable that the row leaves unbound is '
    'left out, which the other two forms cannot show.',
    native=False,
)
def _rows_as_json(session: Session, ref: Reference, *parts: str) -> DirectiveResponse:
    rows = _select(session, ref, parts)
    objects = [json.dumps({b.variable: _value(b) for b in row}, ensure_ascii=False) for row in rows]
    return DirectiveResponse(queried_objects=objects)


def _value(bound: Binding) -> str:
    if bound.language:
        return f'{bound.value}@{bound.language}'
    if bound.datatype in ('', XSD + 'string'):
        return bound.value
    return f'{bound.value}^^{bound.datatype}'


def _select(session: Session, ref: Reference, parts: tuple[str, ...]) -> list[list[Binding]]:
    if len(parts) > 4:
        raise DirectiveError(f'QUERY SPARQL: expected 1 to 4 arguments, got {len(parts)}')
    *texts, last = parts if len(parts) in (2, 4) else (*parts, '0')
    limit = session.settings.sparql_timeout
    asked = _milliseconds(last) / 1000
    seconds = min(asked, limit) if asked > 0 else limit
    derived = session.settings.sparql_derived

    def update(known: Version | None) -> GraphUpdate | None:
        with ref.held():
            if known == session.graphs.version(ref, derived):
                return None
            return session.graphs.update(ref, derived, known)

    with ref.held():
        version = session.graphs.version(ref, derived)
    try:
        return session.sparql.select(
            version,
            update,
            ''.join(texts),
            seconds,
            limit,
            session.settings.sparql_rows,
        )
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
