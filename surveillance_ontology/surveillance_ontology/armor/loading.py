"""LOAD: from a file or web document to a reference, or to one line that says why not."""

from __future__ import annotations

import urllib.error
import urllib.request
from collections.abc import Iterable

from surveillance_ontology.armor.paths import SafePaths
from surveillance_ontology.armor.protocol import DirectiveError
from surveillance_ontology.armor.reference import Origin, Reference
from surveillance_ontology.armor.rendering import parse_entity, shown
from surveillance_ontology.armor.settings import Settings
from surveillance_ontology.documents.reading import OntologyFileError, read_ontology
from surveillance_ontology.knowledge_base import KnowledgeBase
from surveillance_ontology.owl.axioms import Axiom
from surveillance_ontology.reasoner.java_reasoning import JavaKnowledgeBase, JavaReasonerError

NATIVE = ('', 'PELLET', 'NATIVE')
"""Names of the reasoner of this package; PELLET is what ARMOR's clients send."""
JAVA = {'HERMIT': 'hermit', 'OPENLLET': 'pellet', 'PELLET_JAVA': 'pellet'}
"""Names of the Java reasoners, see `java_reasoning`."""
WRITTEN = {'turtle': 'ntriples', 'owlxml': 'rdfxml'}
"""What SAVE writes for formats that are only read: N-Triples is Turtle as well."""
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
    notes: list[str] = []
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
    kb = _reasoned(base, document.axioms, reasoner, notes)
    if not kb.consistent:
        notes.append('the ontology is inconsistent')
    unsupported = [*document.unsupported, *kb.unsupported]
    if unsupported:
        more = f' and {len(unsupported) - MAX_NAMED} more' if len(unsupported) > MAX_NAMED else ''
        named = '; '.join(unsupported[:MAX_NAMED])
        notes.append(f'{len(unsupported)} statements not supported by the reasoner: {named}{more}')
    used = reasoner if isinstance(kb, JavaKnowledgeBase) else ''
    form = WRITTEN.get(document.format, document.format)
    return Reference(name, kb, Origin(path, form, document.prefixes, used)), notes


def knowledge_base(base: str, axioms: Iterable[Axiom], reasoner: str) -> KnowledgeBase:
    """Make a knowledge base with the reasoner of a name; the native one for unknown names."""
    kind = JAVA.get(reasoner.upper())
    return JavaKnowledgeBase(base, axioms, kind) if kind else KnowledgeBase(base, axioms)


def _reasoned(base: str, axioms: list[Axiom], reasoner: str, notes: list[str]) -> KnowledgeBase:
    kb = knowledge_base(base, axioms, reasoner)
    try:
        kb.reason()
    except JavaReasonerError as error:
        notes.append(f'reasoner {shown(reasoner)} cannot be used, the native one is: {error}')
        kb = KnowledgeBase(base, axioms)
        kb.reason()
    else:
        if reasoner.upper() not in NATIVE and not isinstance(kb, JavaKnowledgeBase):
            notes.append(f'reasoner {shown(reasoner)} is not available, the native one is used')
    return kb


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
