"""The directive service: several ontologies under reference names, and what directives do to them.

    service = ArmorService()
    request = DirectiveRequest('me', 'map', 'QUERY', 'IND', 'CLASS', ('ROOM',))
    service.execute(request).queried_objects

Threads may share a service: each reference has a lock, held for one directive or for a whole batch.
Nothing that a client sends makes it raise.
"""

from __future__ import annotations

import contextlib
import itertools
import threading
import time
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any, TypeAlias

from armor_service.access import SafePaths, Settings
from armor_service.changes import Change
from armor_service.directive_log import DirectiveLog
from armor_service.directives import Directive, Kind, look_up
from armor_service.names import doubtful_names, unknown_names
from armor_service.protocol import (
    DirectiveError,
    DirectiveRequest,
    DirectiveResponse,
    ExitCode,
    ListResponse,
    StoreError,
)
from armor_service.reference import Limits, Reference, Registry, Told, TooHardError
from armor_service.rendering import one_line, shown
from armor_service.sparql import SparqlEngine
from armor_service.store import Store
from armor_service.worlds import Worlds
from owl_reasoner import memory
from owl_reasoner.knowledge_base import Changes

LONG_ARGUMENTS = 1000
"""Arguments from which on a directive is not quick."""
LARGE = 1000
"""Axioms from which on a query that gathers from all of them is not quick."""

Watcher: TypeAlias = Callable[[str, Changes | None], None]
"""Told of a reference's name and what changed in it; None: it was loaded or dropped."""


class ArmorService:
    """Carries out directives, and is what they act on.

    Args:
        settings: What is allowed.
        screen: Writes a line of LOG SCREEN.
        warn: Told in one line of what went wrong inside and of what a client should know.
        store: Makes references durable; those it holds are there at once.
        clock: Seconds since the epoch, for what is told of changes that are taken back.

    Raises:
        StoreError: What is in the store cannot be read.

    Attributes:
        settings: What is allowed.
        paths: Which files may be read and written.
        log: The log of directives.
        sparql: Runs SPARQL queries.
        references: What is loaded.
        entering: Held while what was loaded gets its name.
        store: Makes references durable; None: they end with the process.
        worlds: Writes them for programs that use owlready2; None: nobody does.
        states: Numbers the states that are taken to be saved.
        saved: The newest state that each file holds.
        limits: What reasoning over changes may use.
    """

    def __init__(
        self,
        settings: Settings | None = None,
        screen: Callable[[str], None] = print,
        warn: Callable[[str], None] = print,
        store: Store | None = None,
        clock: Callable[[], float] = time.time,
    ) -> None:
        self.settings = settings or Settings()
        readable = (*self.settings.directories, *self.settings.read_only_directories)
        self.paths = SafePaths(self.settings.writable, readable)
        self.log = DirectiveLog(screen, self.settings.max_file_bytes)
        self.sparql = SparqlEngine(self.settings)
        self.references = Registry()
        self.entering = threading.Lock()
        self.store = store
        self.worlds: Worlds | None = None
        self.states = itertools.count(1)
        self.saved: dict[Path, int] = {}
        self._saving: dict[Path, threading.Lock] = {}
        self._warn = warn
        self._clock = clock
        memory_limit = self.settings.reasoning_memory * 2**20
        self.limits = Limits(self.settings.reasoning_timeout, memory_limit)
        self._watchers: list[Watcher] = [self.sparql.note]
        if store:
            store.warn = self.warn
            if self.settings.worlds:
                self.worlds = Worlds(store.directory / 'worlds', self.warn)
            with memory.uncollected():
                recovered = store.recover()
                for ref in recovered:
                    self.register(ref)
                    memory.settle(len(ref.kb))
            if self.worlds:
                self.worlds.keep_only(self.references.names())
            for note in store.notes:
                warn(note)
            threading.Thread(
                target=self._open_all, args=(recovered,), name='opener', daemon=True
            ).start()

    def warn(self, text: str) -> None:
        """Write a line for the operator."""
        self._warn(one_line(text))

    def watch(self, watcher: Watcher) -> None:
        """Tell a watcher of every change of asserted and derived facts.

        It is called inside the directive that caused the change and must be quick.
        """
        self._watchers.append(watcher)

    def tell(self, name: str, changes: Changes | None) -> None:
        """Tell the watchers of a change."""
        for watcher in self._watchers:
            watcher(name, changes)

    def register(self, ref: Reference) -> None:
        """Make a reference known under its name, and its changes to the watchers."""

        def on_changes(changes: Changes) -> None:
            self.tell(ref.name, changes)

        taken_back = ref.on_taken_back

        def on_taken_back(lines: list[str], undo: list[Change]) -> None:
            taken_back(lines, undo)
            for line in lines:
                self.warn(f'{ref.name}: taken back: {line}')

        ref.limits, ref.on_taken_back = self.limits, on_taken_back
        ref.kb.subscribe(on_changes)
        if self.worlds:
            self.worlds.follow(ref)
        self.references.add(ref)
        self.tell(ref.name, None)

    def _open_all(self, references: Sequence[Reference]) -> None:
        """Reason over what was there before this process, one reference after the other.

        Whoever asks for one does not wait for the others.
        """
        for ref in references:
            with ref.lock, memory.uncollected(), contextlib.suppress(StoreError):
                if not ref.dropped:
                    ref.open()

    def saving(self, path: Path) -> threading.Lock:
        """Return what is held while a state is written to a file."""
        return self._saving.setdefault(path, threading.Lock())

    def check_free(self, ref: Reference, client: str) -> None:
        """Check that no other client is mounted on a reference.

        Raises:
            DirectiveError: 102, there is one.
        """
        if self.settings.enforce_mount and not ref.is_free_for(client):
            raise DirectiveError(
                f'{client} cannot connect to {ref.name}. Another client is already mounted on it.',
                ExitCode.REFERENCE_BUSY,
            )

    def execute(self, request: DirectiveRequest) -> DirectiveResponse:
        """Carry out one directive; never raises for what a client sent."""
        try:
            response = self._execute(request)
        except DirectiveError as error:
            response = error.response
        except StoreError as error:
            response = _refusal(f'{request.words}: nothing was done: {error}')
        except TooHardError as error:
            response = DirectiveError(f'{request.words}: {error}', timeout=True).response
        except Exception as error:
            problem = f'{request.words}: internal error, {type(error).__name__}: {error}'
            self.warn(problem)
            response = _refusal(problem)
        if not response.error_description.isprintable():
            response.error_description = one_line(response.error_description)
        ref = self.references.get(request.reference_name)
        if ref is not None:
            response.is_consistent = ref.kb.consistent
        if self.log.enabled:
            self.log.write(request, response, is_loaded=ref is not None)
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
        writes = self.store is not None and directive.kind.may_reason
        if writes or directive.slow or directive.schema or len(request.args) > LONG_ARGUMENTS:
            return None
        ref = self.references.get(request.reference_name)
        if ref is None:
            return self.execute(request)
        if not ref.lock.acquire(blocking=False):
            return None
        try:
            slow = directive.kind.may_reason and ref.is_slow
            if slow or not ref.opened or (directive.gathers and len(ref.kb) > LARGE):
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
                with self.store.batch() if self.store else contextlib.nullcontext():
                    responses = [self.execute(request) for request in requests]
            except StoreError as error:
                problem = f'lost at the next start: {error}'
                return ListResponse(False, False, [_refusal(problem) for _ in requests])
        return ListResponse(
            success=all(response.success for response in responses),
            is_consistent=responses[-1].is_consistent if responses else False,
            responses=responses,
        )

    def close(self) -> None:
        """End helper processes and close files."""
        self.sparql.close()
        for name in self.references.names():
            if (ref := self.references.get(name)) is not None:
                ref.cancel.set()
        if self.worlds:
            self.worlds.close()
        if self.store:
            self.store.close()
        self.log.close()

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
            response: DirectiveResponse = directive.run(self, request, *values)
            return response
        ref = self.references.find(request.reference_name)
        if directive.slow:
            response = directive.run(self, ref, *self._values(directive, request, ref))
        else:
            # Plainly: `Registry.locked` costs a quarter of a quick query.
            with ref.lock:
                if ref.dropped:
                    return self._execute(request)
                ref.open()
                if directive.kind is Kind.QUERY:
                    response = directive.run(ref, *self._values(directive, request, ref))
                else:
                    remark = self._change(directive, request, ref)
                    response = DirectiveResponse(error_description=remark)
        if self.store and directive.kind.may_reason:
            self.store.compact_if_large(self.references.held_briefly)
        return response

    def _change(self, directive: Directive, request: DirectiveRequest, ref: Reference) -> str:
        """Carry out a manipulation; return what a client should know of it."""
        self.check_free(ref, request.client_name)
        if directive.kind is Kind.CONTROL:
            if self.store and ref.waiting:
                self.store.flushed(ref.name)
            remark: str = directive.run(ref, *self._values(directive, request, ref))
            return remark
        changes: list[Change] = directive.run(ref, *self._values(directive, request, ref))
        doubts = self._doubts(request, ref, changes)
        told = Told(request.client_name, self._clock(), tuple(changes))
        if self.store and changes:
            self.store.changed(ref.name, told)
        ref.heavy |= directive.schema
        remark = '; '.join(filter(None, (ref.missing(changes), *doubts)))
        if not changes:
            waiting = f'; {len(ref.queue)} changes wait for APPLY' if ref.waiting else ''
            remark = f'{request.words}: nothing to change{waiting}'
        try:
            problem = ref.submit(told)
        except TooHardError as error:
            return '; '.join(filter(None, (remark, f'done, but nothing is derived: {error}')))
        if problem:
            raise DirectiveError(f'{request.words}: taken back: {problem}')
        return '; '.join(filter(None, (remark, ref.too_hard)))

    def _doubts(
        self, request: DirectiveRequest, ref: Reference, changes: list[Change]
    ) -> list[str]:
        """Return what the client should know of the names in its changes.

        Raises:
            DirectiveError: 205, the service is strict about them.
        """
        doubts = list(doubtful_names(ref, changes))
        if self.settings.strict:
            refused = [*unknown_names(ref, changes), *(d for d in doubts if 'forbids' in d)]
            if refused:
                raise DirectiveError(f'{request.words}: {"; ".join(dict.fromkeys(refused))}')
        return doubts

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
    return DirectiveError(problem).response


def _check_name(name: str) -> None:
    if len(name) > 256 or not name.isprintable():
        raise DirectiveError(
            f'reference name {shown(name)}: expected at most 256 printable characters'
        )
