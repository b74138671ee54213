"""The directives about references, files and logging, and APPLY and REASON."""

from __future__ import annotations

import contextlib
import urllib.error
import urllib.request
from typing import Any

from surveillance_ontology.armor.access import SafePaths, Settings
from surveillance_ontology.armor.directives.table import control, flag, text, utility
from surveillance_ontology.armor.protocol import (
    DirectiveError,
    DirectiveRequest,
    DirectiveResponse,
    ExitCode,
)
from surveillance_ontology.armor.reference import (
    NATIVE,
    NOBODY,
    Origin,
    Reference,
    knowledge_base,
)
from surveillance_ontology.armor.rendering import parse_entity, shown
from surveillance_ontology.armor.session import Session
from surveillance_ontology.documents.reading import OntologyFileError, read_ontology
from surveillance_ontology.documents.writing import OntologyWriteError, write_ontology
from surveillance_ontology.knowledge_base import KnowledgeBase
from surveillance_ontology.owl.axioms import Axiom
from surveillance_ontology.reasoner.java_reasoning import JavaKnowledgeBase, JavaReasonerError

WRITTEN = {'turtle': 'ntriples', 'owlxml': 'rdfxml'}
"""What SAVE writes for formats that are only read: N-Triples is Turtle as well."""
WEB_TIMEOUT = 20.0
MAX_NAMED = 5
"""How many unsupported statements a description names."""

_LOAD = (
    text('iri'),
    flag('buffered manipulation'),
    text('reasoner'),
    flag('buffered reasoner'),
)
_LOAD_SUMMARY = (
    'Loads an ontology under the reference name. With buffered manipulation changes wait until '
    'APPLY or REASON; with a buffered reasoner derived facts follow at REASON only. A name that is '
    'loaded already stays as it is, except for the first flag.'
)
_LOAD_DIFFERS = (
    'Only files in the allowed directories. A file that cannot be loaded leaves no reference '
    'behind. What the reasoner does not support is named in the description. Switching buffering '
    'off applies what waits.'
)
_WEB_DIFFERS = 'Refused unless the parameter allow_web is set.'


@utility('LOAD FILE', text('path'), *_LOAD, summary=_LOAD_SUMMARY, differs=_LOAD_DIFFERS, slow=True)
def _load_file(session: Session, request: DirectiveRequest, *values: Any) -> DirectiveResponse:
    return _load(session, request, *values)


@utility(
    'LOAD FILE MOUNTED',
    *(text('path'), *_LOAD),
    summary='LOAD FILE, then MOUNT. When mounting is refused the ontology stays loaded.',
    slow=True,
)
def _load_file_mounted(
    session: Session, request: DirectiveRequest, *values: Any
) -> DirectiveResponse:
    response = _load(session, request, *values)
    _mount(session, request)
    return response


@utility(
    'LOAD WEB',
    *(text('url'), *_LOAD),
    summary='LOAD FILE with a document from the web.',
    differs=_WEB_DIFFERS,
    slow=True,
)
def _load_web(session: Session, request: DirectiveRequest, *values: Any) -> DirectiveResponse:
    return _load(session, request, *values, web=True)


@utility(
    'LOAD WEB MOUNTED',
    *(text('url'), *_LOAD),
    summary='LOAD WEB, then MOUNT.',
    differs=_WEB_DIFFERS,
    slow=True,
)
def _load_web_mounted(
    session: Session, request: DirectiveRequest, *values: Any
) -> DirectiveResponse:
    response = _load(session, request, *values, web=True)
    _mount(session, request)
    return response


@utility('DROP', summary='Forgets the reference; success also when there is none.')
def _do_drop(session: Session, request: DirectiveRequest) -> DirectiveResponse:
    _drop(session, request.reference_name)
    return DirectiveResponse()


@utility(
    'SAVE',
    text('path', ''),
    summary='Writes the asserted axioms in the format that was loaded; an empty path stands for '
    'the file that was loaded.',
    differs='Written beside the file and renamed, so that a crash leaves the old file whole. '
    'Turtle is written as N-Triples, OWL/XML as RDF/XML; a path that ends in .nt gets N-Triples, '
    'which hold names that RDF/XML cannot.',
    slow=True,
)
def _do_save(session: Session, request: DirectiveRequest, path: str) -> DirectiveResponse:
    _save(session, request.reference_name, path, inferences=False)
    return DirectiveResponse()


@utility(
    'SAVE INFERENCE',
    text('path', ''),
    summary='SAVE with the derived facts.',
    differs='The live ontology stays as it is; ARMOR asserts every derived fact for good.',
    slow=True,
)
def _save_inference(session: Session, request: DirectiveRequest, path: str) -> DirectiveResponse:
    _save(session, request.reference_name, path, inferences=True)
    return DirectiveResponse()


@utility(
    'MOUNT',
    summary='From now on only this client may change the ontology; 203 when another is mounted or '
    'the reference is unknown.',
    differs='Enforced, unless the parameter enforce_mount is off; ARMOR reports 102 and carries '
    'the manipulation out.',
)
def _do_mount(session: Session, request: DirectiveRequest) -> DirectiveResponse:
    return _mount(session, request)


@utility('UNMOUNT', summary='Ends MOUNT; a client that is not mounted changes nothing by it.')
def _do_unmount(session: Session, request: DirectiveRequest) -> DirectiveResponse:
    return _unmount(session, request)


@utility('GET ALL REFS', summary='The names of all references.')
def _get_all(session: Session, _: DirectiveRequest) -> DirectiveResponse:
    return DirectiveResponse(queried_objects=session.references.names())


@utility(
    'GET REF CLIENT',
    text('reference'),
    summary='The client mounted on a reference, `none` when there is none.',
    differs='An unknown reference is answered with 205.',
)
def _get_client(session: Session, _: DirectiveRequest, name: str) -> DirectiveResponse:
    return DirectiveResponse(queried_objects=[session.references.find(name).mounted])


@utility('LOG FILE ON', text('path'), summary='Appends each directive with its answer to a file.')
def _log_file_on(session: Session, _: DirectiveRequest, path: str) -> DirectiveResponse:
    session.log.open(session.paths.to_write(path))
    return DirectiveResponse()


@utility('LOG FILE OFF', summary='Ends LOG FILE ON.')
def _log_file_off(session: Session, _: DirectiveRequest) -> DirectiveResponse:
    session.log.close()
    return DirectiveResponse()


@utility('LOG SCREEN ON', summary='Writes each directive with its answer to the console.')
def _log_screen_on(session: Session, _: DirectiveRequest) -> DirectiveResponse:
    session.log.on_screen = True
    return DirectiveResponse()


@utility('LOG SCREEN OFF', summary='Ends LOG SCREEN ON.')
def _log_screen_off(session: Session, _: DirectiveRequest) -> DirectiveResponse:
    session.log.on_screen = False
    return DirectiveResponse()


@utility('INVALID COMMAND', summary='Always answered with 205; for tests of clients.')
def _invalid(_: Session, __: DirectiveRequest) -> DirectiveResponse:
    raise DirectiveError('Invalid command.', ExitCode.INVALID_COMMAND)


@control('APPLY', summary='Applies the changes that wait; derived facts follow only at REASON.')
def _apply(ref: Reference) -> None:
    ref.flush()


@control(
    'REASON',
    summary='Applies the changes that wait and brings the derived facts up to date.',
    differs='Recovers from an inconsistent ontology once its cause is retracted; ARMOR does not '
    'with buffering.',
)
def _reason(ref: Reference) -> None:
    ref.reason()


def _load(
    session: Session,
    request: DirectiveRequest,
    source: str,
    iri: str,
    buffered: bool,
    reasoner: str,
    lazy: bool,
    *,
    web: bool = False,
) -> DirectiveResponse:
    """Do LOAD; see the table."""
    name = request.reference_name
    again = DirectiveResponse(error_description=f'{name} is loaded already')
    if _rebuffer(session, name, buffered):
        return again
    with session.loading:
        if name not in session.references:
            ref, notes = _read_document(
                name, source, iri, reasoner, session.paths, session.settings, web=web
            )
            ref.buffered_manipulation, ref.buffered_reasoner = buffered, lazy
            if session.store:
                session.store.loaded(ref)
            session.register(ref)
            for note in notes:
                session.warn(f'{name}: {note}')
            return DirectiveResponse(error_description='; '.join(notes))
    _rebuffer(session, name, buffered)
    return again


def _rebuffer(session: Session, name: str, buffered: bool) -> bool:
    if name not in session.references:
        return False
    with contextlib.suppress(DirectiveError), session.references.locked(name) as ref:
        if session.store and ref.buffered_manipulation != buffered:
            session.store.buffered(name, buffered)
        ref.buffer(buffered)
        return True
    return False


def _drop(session: Session, name: str) -> None:
    """Do DROP."""
    with contextlib.suppress(DirectiveError), session.references.locked(name) as ref:
        if session.store:
            session.store.dropped(name)
        session.references.remove(ref)
        session.tell(name, None)


def _mount(session: Session, request: DirectiveRequest) -> DirectiveResponse:
    """Do MOUNT.

    Raises:
        DirectiveError: 203, the reference is unknown or another client is mounted.
    """
    client, name = request.client_name, request.reference_name
    if name not in session.references:
        raise DirectiveError(
            f'{client} cannot be mounted on {name}. Unknown reference.', ExitCode.MOUNT_REFUSED
        )
    with session.references.locked(name) as ref:
        if not ref.is_free_for(client):
            raise DirectiveError(
                f'{client} cannot be mounted on {name}. Another client is already mounted on it.',
                ExitCode.MOUNT_REFUSED,
            )
        note = f'{client} is mounted already' if ref.mounted == client != NOBODY else ''
        if session.store and ref.mounted != client:
            session.store.mounted(name, client)
        ref.mounted = client
    return DirectiveResponse(error_description=note)


def _unmount(session: Session, request: DirectiveRequest) -> DirectiveResponse:
    """Do UNMOUNT.

    Raises:
        DirectiveError: 205, there is no such reference.
    """
    with session.references.locked(request.reference_name) as ref:
        if ref.mounted != request.client_name:
            note = f'{request.client_name} is not mounted on {ref.name}'
            return DirectiveResponse(error_description=note)
        if session.store:
            session.store.mounted(ref.name, NOBODY)
        ref.mounted = NOBODY
    return DirectiveResponse()


def _save(session: Session, name: str, path: str, *, inferences: bool) -> None:
    """Do SAVE and SAVE INFERENCE.

    Raises:
        DirectiveError: 205, the path is not allowed or cannot be written.
    """
    with session.references.locked(name) as ref:
        target = path or str(ref.origin.file or '')
        if not target:
            raise DirectiveError(f'SAVE: {name} was loaded from {ref.origin.path}; expected a path')
        axioms = list(ref.kb.axioms())
        if inferences:
            axioms = list(dict.fromkeys([*axioms, *ref.kb.facts()]))
        origin = ref.origin
    form = 'ntriples' if target.endswith('.nt') else origin.format
    try:
        write_ontology(axioms, ref.kb.iri, session.paths.to_write(target), form, origin.prefixes)
    except OntologyWriteError as error:
        raise DirectiveError(f'SAVE: {error}') from None


def _read_document(
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
