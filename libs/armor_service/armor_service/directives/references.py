"""The directives about references, files and logging, and APPLY and REASON."""

from __future__ import annotations

import math
import threading
import time
from pathlib import Path

from armor_service.access import LOG_ENDINGS, ONTOLOGY_ENDINGS, WORLD_ENDINGS, Settings
from armor_service.directives.table import control, flag, text, utility
from armor_service.doubtful_rules import endless_rules
from armor_service.protocol import (
    DirectiveError,
    DirectiveRequest,
    DirectiveResponse,
    ExitCode,
)
from armor_service.reference import (
    NATIVE,
    NOBODY,
    Effort,
    Origin,
    Reference,
    knowledge_base,
)
from armor_service.rendering import parse_entity, shown
from armor_service.workspace import Workspace
from owl_reasoner import gc_control
from owl_reasoner.documents.reading import read_ontology
from owl_reasoner.documents.xml_reading import OntologyFileError
from owl_reasoner.knowledge_base import KnowledgeBase
from owl_reasoner.owl.axioms import Axiom, Rule
from owl_reasoner.reasoner.budget import ReasoningBudgetError

_BY_ENDING = {'.nt': 'ntriples', '.nq': 'nquads', '.omn': 'manchester'}
"""What SAVE writes by the ending of the path."""
RELEASE_AFTER = 0.2
DROP_WITHIN = 0.5
"""Seconds for which DROP waits for who uses the reference; it goes in any case."""
WRITTEN = {
    'turtle': 'ntriples',
    'jsonld': 'ntriples',
    'owlxml': 'rdfxml',
    'functional': 'rdfxml',
}
"""What SAVE writes for formats that are only read: N-Triples is Turtle as well."""
WEB_TIMEOUT = 20.0
FIRST = 10
"""How many times as long as the next one the first reasoning is taken to need."""
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
    'Only files in the ontologies folder and the directories that may be read. A file that cannot '
    'be loaded leaves no reference behind. While another client is mounted, refused with 102 if it '
    'were to change the first flag. What the reasoner does not support is named in the '
    'description. Switching buffering off applies what waits.'
)
_WEB_DIFFERS = 'Refused unless the parameter allow_web is set.'


@utility(
    'LOAD WEB MOUNTED',
    *(text('url'), *_LOAD),
    summary='LOAD WEB, then MOUNT.',
    differs=_WEB_DIFFERS,
    slow=True,
)
@utility(
    'LOAD WEB',
    *(text('url'), *_LOAD),
    summary='LOAD FILE with a document from the web.',
    differs=_WEB_DIFFERS,
    slow=True,
)
@utility(
    'LOAD FILE MOUNTED',
    *(text('path'), *_LOAD),
    summary='LOAD FILE, then MOUNT. When mounting is refused the ontology stays loaded.',
    slow=True,
)
@utility('LOAD FILE', text('path'), *_LOAD, summary=_LOAD_SUMMARY, differs=_LOAD_DIFFERS, slow=True)
def _load(
    workspace: Workspace,
    request: DirectiveRequest,
    source: str,
    iri: str,
    buffered: bool,
    reasoner: str,
    lazy: bool,
) -> DirectiveResponse:
    name = request.reference_name
    notes = [f'{name} is loaded already']
    if not _rebuffer(workspace, request, buffered):
        with gc_control.uncollected():
            ref, found = _read_document(workspace, request, source, iri, reasoner)
            gc_control.settle(len(ref.kb))
        ref.buffering.manipulation, ref.buffering.reasoner = buffered, lazy
        with workspace.entering:
            entered = name not in workspace.references
            if entered:
                if workspace.store:
                    workspace.store.loaded(ref)
                workspace.register(ref)
        if entered:
            notes = found
            for note in notes:
                workspace.warn(f'{name}: {note}')
        else:
            _rebuffer(workspace, request, buffered)
    if request.secondary:
        _mount(workspace, request)
    return DirectiveResponse(error_description='; '.join(notes))


def _rebuffer(workspace: Workspace, request: DirectiveRequest, buffered: bool) -> bool:
    """Give a loaded reference the buffering of a further LOAD; False when there is none."""
    with workspace.references.locked_if_there(request.reference_name) as ref:
        if ref is None:
            return False
        if ref.buffering.manipulation != buffered:
            workspace.check_free(ref, request.client_name)
            ref.buffer(buffered)
            workspace.commit(ref)
    return True


@utility(
    'DROP',
    summary='Forgets the reference; success also when there is none.',
    differs='Refused with 102 while another client is mounted.',
    slow=True,
)
def _drop(workspace: Workspace, request: DirectiveRequest) -> DirectiveResponse:
    ref = workspace.references.get(request.reference_name)
    if ref is None:
        return DirectiveResponse()
    workspace.check_free(ref, request.client_name)
    workspace.references.remove(ref)
    # Whoever reasons over it ends soon, and writes nothing after this.
    ref.cancel.set()
    free = ref.lock.acquire(timeout=DROP_WITHIN)
    try:
        if workspace.store:
            workspace.store.dropped(ref.name)
    finally:
        if free:
            ref.lock.release()
    workspace.tell(ref.name, None)
    # Not yet: this directive and those that wait for the lock still refer to it.
    release = threading.Timer(RELEASE_AFTER, _release, args=(workspace, ref))
    release.daemon = True
    release.start()
    return DirectiveResponse()


def _release(workspace: Workspace, ref: Reference) -> None:
    """Give back an ontology's memory; of a large one also that of those who know its graph."""
    if len(ref.kb) > gc_control.LARGE:
        workspace.sparql.forget()
    with ref.lock:  # The last of those who found it before it was dropped.
        parts = ref.kb.give_up()
        ref.kb = KnowledgeBase(ref.kb.iri)
    gc_control.release(parts, workspace.references.hold_more_than(gc_control.LARGE))


@utility(
    'SAVE INFERENCE',
    text('path', ''),
    summary='SAVE with the derived facts.',
    differs='The live ontology stays as it is; ARMOR asserts every derived fact for good.',
    slow=True,
)
@utility(
    'SAVE',
    text('path', ''),
    summary='Writes the asserted axioms in the format that was loaded, to a file below the '
    'ontologies folder that ends as ontologies do.',
    differs='Without a path it is refused unless the parameter overwrite_loaded is set: ARMOR '
    'writes over the file that was loaded. Refused with 102 while another client is mounted. '
    'Written beside the file and renamed, so that a crash leaves the old file whole; it keeps its '
    'rights, and a read-only one is refused. '
    'Turtle and JSON-LD are written as N-Triples, OWL/XML and functional syntax as RDF/XML; a path '
    'that ends in .nt or .nq gets N-Triples or N-Quads, which hold names that RDF/XML cannot, and '
    'one that ends in .omn Manchester syntax.',
    slow=True,
)
def _save(workspace: Workspace, request: DirectiveRequest, path: str) -> DirectiveResponse:
    # Late, as what LOAD WEB needs: a server that starts again is to be back at once.
    from owl_reasoner.documents.writing import write_ontology

    with workspace.references.locked(request.reference_name) as first:
        workspace.check_free(first, request.client_name)
        chosen = path or _loaded_file(workspace, first)
    # While nobody waits for the reference: the disk may not answer.
    target = workspace.paths.to_write(chosen, ONTOLOGY_ENDINGS)
    with workspace.references.locked(request.reference_name) as ref, gc_control.uncollected():
        workspace.check_free(ref, request.client_name)
        if ref is not first and not path:
            # Its own file is another one.
            raise DirectiveError(f'SAVE: {ref.name} was loaded again meanwhile')
        taken = next(workspace.states)
        axioms = list(ref.kb.axioms())
        if request.primary:
            axioms = list(dict.fromkeys([*axioms, *ref.kb.facts()]))
        iri, origin = ref.kb.iri, ref.origin
    form = _BY_ENDING.get(target.suffix.lower(), origin.format)
    with workspace.saving(target):
        if taken < workspace.saved.get(target, 0):
            return DirectiveResponse()  # A newer state is there already.
        try:
            with gc_control.uncollected():
                write_ontology(axioms, iri, target, form, origin.prefixes)
        except OntologyFileError as error:
            raise DirectiveError(f'SAVE: {error}') from None
        workspace.saved[target] = taken
    return DirectiveResponse()


@utility(
    'BACKUP',
    text('path'),
    native=False,
    summary='Writes a copy of the World of the reference, as of now, to a file below the '
    'ontologies folder that ends in .sqlite3. Only where the service keeps references. The '
    'description says what the copy lacks while another program keeps the World locked.',
    slow=True,
)
def _backup(workspace: Workspace, request: DirectiveRequest, path: str) -> DirectiveResponse:
    with workspace.references.locked(request.reference_name) as ref:
        name = ref.name
    if workspace.store is None:
        raise DirectiveError('BACKUP: the service keeps no references; SAVE writes one')
    lacks = workspace.store.backup(name, workspace.paths.to_write(path, WORLD_ENDINGS))
    return DirectiveResponse(error_description=lacks)


def _loaded_file(workspace: Workspace, ref: Reference) -> str:
    if not ref.origin.file:
        raise DirectiveError(f'SAVE: {ref.name} was loaded from {ref.origin.path}; expected a path')
    if not workspace.settings.overwrite_loaded:
        raise DirectiveError(
            f'SAVE: expected a path; the parameter overwrite_loaded permits writing over '
            f'{ref.origin.file}, which was loaded'
        )
    return str(ref.origin.file)


@utility(
    'MOUNT',
    summary='From now on only this client may change the ontology; 203 when another is mounted or '
    'the reference is unknown.',
    differs='Enforced, unless the parameter enforce_mount is off; ARMOR reports 102 and carries '
    'the manipulation out.',
    slow=True,
)
def _mount(workspace: Workspace, request: DirectiveRequest) -> DirectiveResponse:
    client, name = request.client_name, request.reference_name
    refusal = f'{client} cannot be mounted on {name}.'
    with workspace.references.locked_if_there(name) as ref:
        if ref is None:
            raise DirectiveError(f'{refusal} Unknown reference.', ExitCode.MOUNT_REFUSED)
        if not ref.is_free_for(client):
            problem = f'{refusal} Another client is already mounted on it.'
            raise DirectiveError(problem, ExitCode.MOUNT_REFUSED)
        note = f'{client} is mounted already' if ref.mounted == client != NOBODY else ''
        ref.mounted = client
        workspace.commit(ref)
    return DirectiveResponse(error_description=note)


@utility(
    'UNMOUNT',
    summary='Ends MOUNT; a client that is not mounted changes nothing by it.',
    slow=True,
)
def _unmount(workspace: Workspace, request: DirectiveRequest) -> DirectiveResponse:
    with workspace.references.locked(request.reference_name) as ref:
        if ref.mounted != request.client_name:
            note = f'{request.client_name} is not mounted on {ref.name}'
            return DirectiveResponse(error_description=note)
        ref.mounted = NOBODY
        workspace.commit(ref)
    return DirectiveResponse()


@utility('GET ALL REFS', summary='The names of all references.')
def _get_all(workspace: Workspace, _: DirectiveRequest) -> DirectiveResponse:
    return DirectiveResponse(queried_objects=workspace.references.names())


@utility(
    'GET REF CLIENT',
    text('reference'),
    summary='The client mounted on a reference, `none` when there is none.',
    differs='An unknown reference is answered with 205.',
)
def _get_client(workspace: Workspace, _: DirectiveRequest, name: str) -> DirectiveResponse:
    return DirectiveResponse(queried_objects=[workspace.references.find(name).mounted])


@utility(
    'LOG FILE ON',
    text('path'),
    summary='Appends each directive with its answer to a file.',
    differs='Only to .log and .txt files below the ontologies folder; closed at 64 MiB.',
    slow=True,
)
def _log_file_on(workspace: Workspace, _: DirectiveRequest, path: str) -> DirectiveResponse:
    workspace.log.open(workspace.paths.to_write(path, LOG_ENDINGS))
    return DirectiveResponse()


@utility('LOG FILE OFF', summary='Ends LOG FILE ON.', slow=True)
def _log_file_off(workspace: Workspace, _: DirectiveRequest) -> DirectiveResponse:
    workspace.log.close()
    return DirectiveResponse()


@utility('LOG SCREEN ON', summary='Writes each directive with its answer to the console.')
def _log_screen_on(workspace: Workspace, _: DirectiveRequest) -> DirectiveResponse:
    workspace.log.on_screen = True
    return DirectiveResponse()


@utility('LOG SCREEN OFF', summary='Ends LOG SCREEN ON.')
def _log_screen_off(workspace: Workspace, _: DirectiveRequest) -> DirectiveResponse:
    workspace.log.on_screen = False
    return DirectiveResponse()


@utility('INVALID COMMAND', summary='Always answered with 205; for tests of clients.')
def _invalid(_: Workspace, __: DirectiveRequest) -> DirectiveResponse:
    raise DirectiveError('Invalid command.', ExitCode.INVALID_COMMAND)


@control('APPLY', summary='Applies the changes that wait; derived facts follow only at REASON.')
def _apply(ref: Reference) -> str:
    ref.flush()
    return ''


@control(
    'REASON',
    text('seconds', ''),
    summary='Applies the changes that wait and brings the derived facts up to date. With seconds '
    'of processor time it ends after them, and leaves all changes as they are.',
    differs='Recovers from an inconsistent ontology once its cause is retracted; ARMOR does not '
    'with buffering. A change over which reasoning takes too long is taken back, and named.',
)
def _reason(ref: Reference, seconds: str) -> str:
    if (rolled_back := ref.reason(_seconds(seconds))) != '':
        return f'taken back: {rolled_back}'
    return ''


def _seconds(text: str) -> float:
    try:
        seconds = float(text) if text else math.inf
    except ValueError:
        seconds = math.nan
    if not seconds > 0.0:
        raise DirectiveError(f'REASON: argument seconds {shown(text)}: expected a number above 0')
    return seconds


@utility(
    'CANCEL',
    native=False,
    summary='Ends the reasoning over the reference that runs, whoever asked for it. Changes stay, '
    'and nothing is derived until the next REASON.',
)
def _cancel(workspace: Workspace, request: DirectiveRequest) -> DirectiveResponse:
    ref = workspace.references.find(request.reference_name)
    workspace.check_free(ref, request.client_name)
    ref.cancel.set()
    return DirectiveResponse()


def _read_document(
    workspace: Workspace, request: DirectiveRequest, source: str, iri: str, reasoner: str
) -> tuple[Reference, list[str]]:
    """Read an ontology and reason over it.

    Args:
        workspace: The workspace.
        request: LOAD FILE or LOAD WEB.
        source: Path or URL.
        iri: What local names are completed with.
        reasoner: ARMOR's word for the reasoner, any case.

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
    found: Path | bytes
    try:
        if request.primary.upper() == 'WEB':
            path, found = source, _fetch(source, workspace.settings)
        else:
            with gc_control.collected():
                found = workspace.paths.to_read(source)
            path = str(found)
        limit = workspace.settings.max_file_bytes
        document = read_ontology(found, base, size_limit=limit, may_read=workspace.paths.may_read)
    except OntologyFileError as error:
        raise DirectiveError(f'LOAD: {error}') from None
    if document.iri and document.iri.rstrip('#') != base:
        notes.append(f'the document is of {document.iri}, names are completed with {base}')
    begin = time.thread_time()
    kb = _reasoned(workspace, base, document.axioms, reasoner, notes)
    took = (time.thread_time() - begin) / FIRST
    if not kb.consistent:
        notes.append('the ontology is inconsistent')
    rules = [axiom for axiom in document.axioms if isinstance(axiom, Rule)]
    notes += endless_rules(rules, rules)
    said = '; '.join(document.unsupported)
    unsupported = [*document.unsupported, *(one for one in kb.unsupported if one not in said)]
    if unsupported:
        more = f' and {len(unsupported) - MAX_NAMED} more' if len(unsupported) > MAX_NAMED else ''
        named = '; '.join(unsupported[:MAX_NAMED])
        notes.append(f'{len(unsupported)} statements not supported by the reasoner: {named}{more}')
    form = WRITTEN.get(document.format, document.format)
    origin = Origin(path, form, document.prefixes)
    effort = Effort(took=took, base=took * FIRST)
    return Reference(request.reference_name, kb, origin, effort=effort), notes


def _reasoned(
    workspace: Workspace, base: str, axioms: list[Axiom], reasoner: str, notes: list[str]
) -> KnowledgeBase:
    if reasoner.upper() not in NATIVE:
        notes.append(f'reasoner {shown(reasoner)} is not available, the native one is used')
    kb = knowledge_base(base, axioms)
    try:
        kb.reason(workspace.settings.loading_timeout, memory=workspace.limits.memory)
    except ReasoningBudgetError as error:
        raise DirectiveError(f'LOAD: {error}; nothing is loaded', timeout=True) from None
    return kb


def _fetch(url: str, settings: Settings) -> bytes:
    import urllib.error
    import urllib.request

    if not settings.allow_web:
        raise DirectiveError('LOAD WEB is not allowed; the parameter allow_web permits it')
    if not url.lower().startswith(('http://', 'https://')):
        raise DirectiveError(f'LOAD WEB: {shown(url)} is not an http address')
    try:
        with gc_control.collected(), urllib.request.urlopen(url, timeout=WEB_TIMEOUT) as answer:
            data: bytes = answer.read(settings.max_file_bytes + 1)
    except (OSError, ValueError) as error:
        reason = error.reason if isinstance(error, urllib.error.URLError) else error
        raise DirectiveError(f'LOAD WEB: {shown(url)}: {reason}') from None
    return data
