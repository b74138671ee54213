"""The directive service: several ontologies under reference names, and what directives do to them.

    service = ArmorService()
    request = DirectiveRequest('me', 'map', 'QUERY', 'IND', 'CLASS', ('ROOM',))
    service.execute(request).queried_objects

Threads may share a service: each reference has a lock, held for one directive or for a whole batch.
Nothing that a client sends makes it raise.
"""

from __future__ import annotations

import contextlib
import time
from collections.abc import Callable, Sequence
from typing import Any

from armor_service.access import Settings
from armor_service.changes import Change
from armor_service.directives import Directive, Kind, look_up
from armor_service.doubtful_rules import doubtful_rules
from armor_service.names import doubtful_names, unknown_names
from armor_service.protocol import (
    DirectiveError,
    DirectiveRequest,
    DirectiveResponse,
    ExitCode,
    ListResponse,
    StoreError,
)
from armor_service.quarantine import Submission, TooHardError
from armor_service.reference import Reference
from armor_service.rendering import one_line, shown
from armor_service.store.store import Store
from armor_service.workspace import Watcher, Workspace

LONG_ARGUMENTS = 1000
"""Arguments from which on a directive is not quick."""
LARGE = 1000
"""Axioms from which on a query that gathers from all of them is not quick."""


class ArmorService:
    """Carries out directives on a workspace.

    Args:
        settings: What is allowed.
        screen: Writes a line of LOG SCREEN.
        warn: Told in one line of what went wrong inside and of what a client should know.
        store: Makes references durable; those it holds are there at once.
        clock: Seconds since the epoch, for what is told of changes that are taken back.

    Raises:
        StoreError: What is in the store cannot be read.

    Attributes:
        workspace: What the directives act on.
    """

    def __init__(
        self,
        settings: Settings | None = None,
        screen: Callable[[str], None] = print,
        warn: Callable[[str], None] = print,
        store: Store | None = None,
        clock: Callable[[], float] = time.time,
    ) -> None:
        self.workspace = Workspace(settings or Settings(), screen, warn, store)
        self._settings, self._store = self.workspace.settings, self.workspace.store
        self._references = self.workspace.references
        self._clock = clock

    def watch(self, watcher: Watcher) -> None:
        """Tell a watcher of every change; see `Workspace.watch`."""
        self.workspace.watch(watcher)

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
            self.workspace.warn(problem)
            response = _refusal(problem)
        if not response.error_description.isprintable():
            response.error_description = one_line(response.error_description)
        ref = self._references.get(request.reference_name)
        if ref is not None:
            response.is_consistent = ref.kb.consistent
        if self.workspace.log.enabled:
            self.workspace.log.write(request, response, is_loaded=ref is not None)
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
        ref = self._references.get(request.reference_name)
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
        if len(requests) > self._settings.max_batch:
            problem = f'{len(requests)} directives in a list, at most {self._settings.max_batch}'
            return ListResponse(False, False, [_refusal(problem)])
        names = {request.reference_name for request in requests}
        with self._references.held(names):
            try:
                with self._store.batch() if self._store else contextlib.nullcontext():
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
        self.workspace.close()

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
            response: DirectiveResponse = directive.run(self.workspace, request, *values)
            return response
        ref = self._references.find(request.reference_name)
        if directive.slow:
            response = directive.run(self.workspace, ref, *self._values(directive, request, ref))
        else:
            # Plainly: `Registry.locked` costs a quarter of a quick query.
            with ref.lock:
                if ref.dropped:
                    return self._execute(request)
                ref.open()
                if directive.kind is Kind.QUERY:
                    response = directive.run(ref, *self._values(directive, request, ref))
                else:
                    if self._store:
                        self._store.check(ref.name)
                        self._store.take_in(ref)
                    try:
                        remark = self._change(directive, request, ref)
                    finally:
                        self.workspace.commit(ref)
                    response = DirectiveResponse(error_description=remark)
        return response

    def _change(self, directive: Directive, request: DirectiveRequest, ref: Reference) -> str:
        """Carry out a manipulation; return what a client should know of it."""
        self.workspace.check_free(ref, request.client_name)
        if directive.kind is Kind.CONTROL:
            remark: str = directive.run(ref, *self._values(directive, request, ref))
            return remark
        changes: list[Change] = directive.run(ref, *self._values(directive, request, ref))
        doubts = self._doubts(request, ref, changes)
        told = Submission(request.client_name, self._clock(), tuple(changes))
        ref.effort.heavy |= directive.schema
        remark = '; '.join(filter(None, (ref.missing(changes), *doubts)))
        if not changes:
            waiting = (
                f'; {len(ref.buffering.queue)} changes wait for APPLY'
                if ref.buffering.waiting
                else ''
            )
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
        doubts = [*doubtful_names(ref, changes), *doubtful_rules(ref, changes)]
        if self._settings.strict:
            refused = [*unknown_names(ref, changes), *(d for d in doubts if 'forbids' in d)]
            if refused:
                raise DirectiveError(f'{request.words}: {"; ".join(dict.fromkeys(refused))}')
        return doubts

    def _values(self, directive: Directive, request: DirectiveRequest, ref: Reference) -> list[Any]:
        return directive.read(
            request.args, ref.kb.iri, narrow_doubles=self._settings.narrow_doubles
        )

    def _check_size(self, request: DirectiveRequest) -> None:
        args = request.args
        if len(args) > self._settings.max_arguments:
            raise DirectiveError(f'{len(args)} arguments, at most {self._settings.max_arguments}')
        characters = sum(map(len, args))
        if characters > self._settings.max_characters:
            raise DirectiveError(
                f'{characters} characters of arguments, at most {self._settings.max_characters}'
            )


def _refusal(problem: str) -> DirectiveResponse:
    return DirectiveError(problem).response


def _check_name(name: str) -> None:
    if len(name) > 256 or not name.isprintable():
        raise DirectiveError(
            f'reference name {shown(name)}: expected at most 256 printable characters'
        )
