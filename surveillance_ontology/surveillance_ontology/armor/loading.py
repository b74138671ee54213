"""LOAD: from a file or web document to a reference, or to one line that says why not."""

from __future__ import annotations

import urllib.error
import urllib.request

from surveillance_ontology.armor.paths import SafePaths
from surveillance_ontology.armor.protocol import DirectiveError
from surveillance_ontology.armor.reference import Origin, Reference
from surveillance_ontology.armor.rendering import parse_entity, shown
from surveillance_ontology.armor.settings import Settings
from surveillance_ontology.knowledge_base import KnowledgeBase
from surveillance_ontology.owl_reading import OntologyFileError, read_ontology

NATIVE = ('', 'PELLET', 'NATIVE')
"""Names of the reasoner of this package; PELLET is what ARMOR's clients send."""
WEB_TIMEOUT = 20.0
MAX_NAMED = 5
"""How many unsupported statements a description names."""


def load_document(
    name: str,
    source: str,
    iri: str,
    reasoner: str,
    paths: SafePaths,
    settings: Settings,
    *,
    web: bool = False,
) -> tuple[Reference, list[str]]:
    """Read an ontology and reason over it.

    Args:
        name: Reference name to be.
        source: Path or URL.
        iri: What local names are completed with.
        reasoner: ARMOR's word for the reasoner, any case.
        paths: What may be read.
        settings: What is allowed.
        web: ``source`` is a URL.

    Returns:
        The reference, and what the client should know: another reasoner than asked for, statements
        that the reasoner does not support, an inconsistency.

    Raises:
        DirectiveError: It cannot be loaded.
    """
    try:
        base = parse_entity(f'<{iri}>', '').rstrip('#')
    except ValueError as error:
        raise DirectiveError(f'LOAD: argument iri {error}') from None
    notes = []
    if reasoner.upper() not in NATIVE:
        notes.append(f'reasoner {shown(reasoner)} is not available, the native one is used')
    try:
        if web:
            document = read_ontology(
                _fetch(source, settings), base, size_limit=settings.max_file_bytes
            )
            path = source
        else:
            file = paths.to_read(source)
            path = str(file)
            document = read_ontology(file, base, size_limit=settings.max_file_bytes)
    except OntologyFileError as error:
        raise DirectiveError(f'LOAD: {error}') from None
    if document.iri and document.iri.rstrip('#') != base:
        notes.append(f'the document is of {document.iri}, names are completed with {base}')
    kb = KnowledgeBase(base, document.axioms)
    if not kb.reason():
        notes.append('the ontology is inconsistent')
    unsupported = [*document.unsupported, *kb.unsupported]
    if unsupported:
        more = f' and {len(unsupported) - MAX_NAMED} more' if len(unsupported) > MAX_NAMED else ''
        named = '; '.join(unsupported[:MAX_NAMED])
        notes.append(f'{len(unsupported)} statements not supported by the reasoner: {named}{more}')
    return Reference(name, kb, Origin(path, document.format, document.prefixes)), notes


def _fetch(url: str, settings: Settings) -> bytes:
    if not settings.allow_web:
        raise DirectiveError('LOAD WEB is not allowed; the parameter allow_web permits it')
    if not url.lower().startswith(('http://', 'https://')):
        raise DirectiveError(f'LOAD WEB: {shown(url)} is not an http address')
    try:
        with urllib.request.urlopen(url, timeout=WEB_TIMEOUT) as answer:
            data: bytes = answer.read(settings.max_file_bytes + 1)
    except (OSError, ValueError) as error:
        reason = error.reason if isinstance(error, urllib.error.URLError) else error
        raise DirectiveError(f'LOAD WEB: {shown(url)}: {reason}') from None
    return data
