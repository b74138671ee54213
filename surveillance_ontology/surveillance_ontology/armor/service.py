"""The directive service: several ontologies under reference names, and what directives do to them.

    service = ArmorService()
    request = DirectiveRequest('me', 'map', 'QUERY', 'IND', 'CLASS', ('ROOM',))
    service.execute(request).queried_objects

Threads may share a service: each reference has a lock, held for one directive or for a whole batch.
Nothing that a client sends makes it raise.
"""

from __future__ import annotations

import contextlib
import threading
from collections.abc import Callable, Iterable, Sequence
from typing import Any

from surveillance_ontology.armor import (  # noqa: F401 - the modules fill the table
    manipulations,
    queries,
    sparql_queries,
    utilities,
)
from surveillance_ontology.armor.changes import Change
from surveillance_ontology.armor.directive_log import DirectiveLog
from surveillance_ontology.armor.journal import JournalError
from surveillance_ontology.armor.loading import load_document
from surveillance_ontology.armor.paths import SafePaths
from surveillance_ontology.armor.protocol import (
    DirectiveError,
    DirectiveRequest,
    DirectiveResponse,
    ExitCode,
    ListResponse,
)
from surveillance_ontology.armor.reference import NOBODY, Reference
from surveillance_ontology.armor.registry import Registry
from surveillance_ontology.armor.rendering import shown
from surveillance_ontology.armor.settings import Settings
from surveillance_ontology.armor.sparql import SparqlEngine
from surveillance_ontology.armor.store import Store
from surveillance_ontology.armor.table import Directive, Kind, look_up
from surveillance_ontology.documents.writing import OntologyWriteError, write_ontology
from surveillance_ontology.knowledge_changes import Changes
from surveillance_ontology.reasoner.java_reasoning import JavaReasonerError

LONG_ARGUMENTS = 1000
Watcher = Callable[[str, Changes | None], None]
"""Told of a reference's name and what changed in it; None: it was loaded or dropped."""


class ArmorService:
    """Carries out directives.

    Args:
        settings: What is allowed.
        screen: Writes a line of LOG SCREEN.
        warn: Told in one line of what went wrong inside and of what a client should know.
        store: Makes references durable; those it holds are there at once.

    Raises:
        JournalError: What is in the store cannot be read.
    """

    def __init__(
        self,
        settings: Settings | None = None,
        screen: Callable[[str], None] = print,
        warn: Callable[[str], None] = print,
        store: Store | None = None,
    ) -> None:
        self.settings = settings or Settings()
        self.paths = SafePaths(self.settings.directories, self.settings.read_only_directories)
        self.log = DirectiveLog(screen)
        self.sparql = SparqlEngine()
        self._warn = warn
        self.references = Registry()
        self._loading = threading.Lock()
        self._watchers: list[Watcher] = []
        self._store = store
        for ref in store.recover() if store else ():
            self._register(ref)

    def execute(self, request: DirectiveRequest) -> DirectiveResponse:
        """Carry out one directive; never raises for what a client sent."""
        try:
            response = self._execute(request)
        except DirectiveError as error:
            response = DirectiveResponse(
                success=error.success,
                timeout=error.timeout,
                exit_code=int(error.exit_code),
                error_description=error.description,
            )
        except JournalError as error:
            response = _refusal(f'{request.words}: nothing was done: {error}')
        except JavaReasonerError as error:
            response = _refusal(f'{request.words}: {error}; native derivations only')
        except Exception as error:
            problem = f'{request.words}: internal error, {type(error).__name__}: {error}'
            problem = ' '.join(problem.split())
            self._warn(problem)
            response = _refusal(problem)
        ref = self.references.get(request.reference_name)
        if ref is not None:
            response.is_consistent = ref.kb.consistent
        if self.log.enabled:
            self.log.write(request, response)
        return response

    def execute_at_once(self, request: DirectiveRequest) -> DirectiveResponse | None:
        """Carry out a directive that will be quick.

        Returns:
            The response; None when it may take long or would have to wait for another thread. Then
            nothing was done, and the caller takes it to `execute` on a thread that may block.
        """
        try:
            directive = look_up(request)
        except DirectiveError:
            return self.execute(request)
        writes = self._store is not None and directive.kind.may_reason
        if writes or directive.slow or directive.schema or len(request.args) > LONG_ARGUMENTS:
            return None
        ref = self.references.get(request.reference_name)
        if ref is None:
            return self.execute(request)
        if not ref.lock.acquire(blocking=False):
            return None
        try:
            if directive.kind.may_reason and ref.is_slow:
                return None
            return self.execute(request)
        finally:
            ref.lock.release()

    def execute_list(self, requests: Sequence[DirectiveRequest]) -> ListResponse:
        """Carry out directives in order; no other client's directive comes in between.

        A failure does not end the batch: each directive has its own answer.
        """
        if len(requests) > self.settings.max_batch:
            problem = f'{len(requests)} directives in a list, at most {self.settings.max_batch}'
            return ListResponse(False, False, [_refusal(problem)])
        names = {request.reference_name for request in requests}
        with self.references.held(names):
            try:
                with self._store.batch() if self._store else contextlib.nullcontext():
                    responses = [self.execute(request) for request in requests]
            except JournalError as error:
                problem = f'nothing was done: {error}'
                try:
                    self._undo(names)
                except JournalError as worse:
                    problem = f'done, but lost at the next start: {error}; going back: {worse}'
                    self._warn(problem)
                return ListResponse(False, False, [_refusal(problem)])
        return ListResponse(
            success=all(response.success for response in responses),
            is_consistent=responses[-1].is_consistent if responses else False,
            responses=responses,
        )

    def close(self) -> None:
        """End helper processes and close files."""
        self.sparql.close()
        if self._store:
            self._store.close()
        self.log.close()

    def _undo(self, names: Iterable[str]) -> None:
        """Bring references back to what the store has of them."""
        assert self._store is not None
        durable = {ref.name: ref for ref in self._store.recover()}
        for name in names:
            kept, ref = durable.get(name), self.references.get(name)
            if kept is not None and ref is not None:
                ref.restore(kept)
                self._follow(ref)
            elif kept is not None:
                self._register(kept)
            elif ref is not None:
                self.references.remove(ref)
            self._tell(name, None)

    def watch(self, watcher: Watcher) -> Callable[[], None]:
        """Tell a watcher of every change of asserted and derived facts.

        It is called inside the directive that caused the change and must be quick.

        Returns:
            A function that ends the watching.
        """
        self._watchers.append(watcher)
        return lambda: self._watchers.remove(watcher)

    def load(
        self,
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
        if self._rebuffer(name, buffered):
            return again
        with self._loading:
            if name not in self.references:
                ref, notes = load_document(
                    name, source, iri, reasoner, self.paths, self.settings, web=web
                )
                ref.buffered_manipulation, ref.buffered_reasoner = buffered, lazy
                if self._store:
                    self._store.loaded(ref)
                self._register(ref)
                for note in notes:
                    self._warn(f'{name}: {note}')
                return DirectiveResponse(error_description='; '.join(notes))
        self._rebuffer(name, buffered)
        return again

    def _rebuffer(self, name: str, buffered: bool) -> bool:
        if name not in self.references:
            return False
        with contextlib.suppress(DirectiveError), self.references.locked(name) as ref:
            if self._store and ref.buffered_manipulation != buffered:
                self._store.buffered(name, buffered)
            ref.buffer(buffered)
            return True
        return False

    def _register(self, ref: Reference) -> None:
        self._follow(ref)
        self.references.add(ref)
        self._tell(ref.name, None)

    def _follow(self, ref: Reference) -> None:
        ref.kb.subscribe(lambda changes: self._tell(ref.name, changes))

    def _tell(self, name: str, changes: Changes | None) -> None:
        for watcher in tuple(self._watchers):
            watcher(name, changes)

    def drop(self, name: str) -> None:
        """Do DROP."""
        with contextlib.suppress(DirectiveError), self.references.locked(name) as ref:
            if self._store:
                self._store.dropped(name)
            self.references.remove(ref)
            self._tell(name, None)

    def mount(self, request: DirectiveRequest) -> DirectiveResponse:
        """Do MOUNT.

        Raises:
            DirectiveError: 203, the reference is unknown or another client is mounted.
        """
        client, name = request.client_name, request.reference_name
        if name not in self.references:
            raise DirectiveError(
                f'{client} cannot be mounted on {name}. Unknown reference.', ExitCode.MOUNT_REFUSED
            )
        with self.references.locked(name) as ref:
            if not ref.is_free_for(client):
                raise DirectiveError(
                    f'{client} cannot be mounted on {name}. '
                    'Another client is already mounted on it.',
                    ExitCode.MOUNT_REFUSED,
                )
            note = f'{client} is mounted already' if ref.mounted == client != NOBODY else ''
            if self._store and ref.mounted != client:
                self._store.mounted(name, client)
            ref.mounted = client
        return DirectiveResponse(error_description=note)

    def unmount(self, request: DirectiveRequest) -> DirectiveResponse:
        """Do UNMOUNT.

        Raises:
            DirectiveError: 205, there is no such reference.
        """
        with self.references.locked(request.reference_name) as ref:
            if ref.mounted != request.client_name:
                note = f'{request.client_name} is not mounted on {ref.name}'
                return DirectiveResponse(error_description=note)
            if self._store:
                self._store.mounted(ref.name, NOBODY)
            ref.mounted = NOBODY
        return DirectiveResponse()

    def save(self, name: str, path: str, *, inferences: bool) -> None:
        """Do SAVE and SAVE INFERENCE.

        Raises:
            DirectiveError: 205, the path is not allowed or cannot be written.
        """
        with self.references.locked(name) as ref:
            target = path or str(ref.origin.file or '')
            if not target:
                raise DirectiveError(
                    f'SAVE: {name} was loaded from {ref.origin.path}; expected a path'
                )
            axioms = list(ref.kb.axioms())
            if inferences:
                axioms = list(dict.fromkeys([*axioms, *ref.kb.facts()]))
            origin = ref.origin
        form = 'ntriples' if target.endswith('.nt') else origin.format
        try:
            write_ontology(axioms, ref.kb.iri, self.paths.to_write(target), form, origin.prefixes)
        except OntologyWriteError as error:
            raise DirectiveError(f'SAVE: {error}') from None

    def _execute(self, request: DirectiveRequest) -> DirectiveResponse:
        if not request.reference_name:
            raise DirectiveError(
                'Invalid request. No reference name specified.', ExitCode.NO_REFERENCE_NAME
            )
        directive = look_up(request)
        self._check_size(request)
        if directive.kind is Kind.UTILITY:
            _check_name(request.reference_name)
            values = directive.read(request.args, '')
            return _response(directive.run(self, request, *values))
        if directive.slow:
            ref = self.references.find(request.reference_name)
            return _response(directive.run(self, ref, *self._values(directive, request, ref)))
        ref = self.references.find(request.reference_name)
        with ref.lock:
            if ref.dropped:
                return self._execute(request)
            if directive.kind is Kind.QUERY:
                return _response(directive.run(ref, *self._values(directive, request, ref)))
            self._change(directive, request, ref)
        if self._store:
            self._store.compact_if_large(
                lambda: self.references.held(self.references.names()), self._warn
            )
        return DirectiveResponse()

    def _change(self, directive: Directive, request: DirectiveRequest, ref: Reference) -> None:
        if self.settings.enforce_mount and not ref.is_free_for(request.client_name):
            raise DirectiveError(
                f'{request.client_name} cannot connect to {ref.name}. '
                'Another client is already mounted on it.',
                ExitCode.REFERENCE_BUSY,
            )
        if directive.kind is Kind.CONTROL:
            if self._store and ref.queue:
                self._store.flushed(ref.name)
            directive.run(ref)
            return
        changes: list[Change] = directive.run(ref, *self._values(directive, request, ref))
        if self._store and changes:
            self._store.changed(ref.name, changes)
        ref.heavy |= directive.schema
        ref.submit(changes)

    def _values(self, directive: Directive, request: DirectiveRequest, ref: Reference) -> list[Any]:
        return directive.read(request.args, ref.kb.iri, narrow_doubles=self.settings.narrow_doubles)

    def _check_size(self, request: DirectiveRequest) -> None:
        args = request.args
        if len(args) > self.settings.max_arguments:
            raise DirectiveError(f'{len(args)} arguments, at most {self.settings.max_arguments}')
        characters = sum(map(len, args))
        if characters > self.settings.max_characters:
            raise DirectiveError(
                f'{characters} characters of arguments, at most {self.settings.max_characters}'
            )


def _refusal(problem: str) -> DirectiveResponse:
    code = int(ExitCode.INVALID_COMMAND)
    return DirectiveResponse(False, exit_code=code, error_description=problem)


def _response(result: Any) -> DirectiveResponse:
    assert isinstance(result, DirectiveResponse)
    return result


def _check_name(name: str) -> None:
    if len(name) > 256 or not name.isprintable():
        raise DirectiveError(
            f'reference name {shown(name)}: expected at most 256 printable characters'
        )
