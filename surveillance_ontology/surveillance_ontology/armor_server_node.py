"""The armor server: ARMOR's two services, and a topic that tells which facts change.

What is quick is answered in the callback itself. What may take long (loading, saving, SPARQL, a
first reasoning) goes to a worker thread, so that other clients are not kept waiting.
"""

from __future__ import annotations

import re
import sys
import time
from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import Any, TypeVar

from rclpy.callback_groups import ReentrantCallbackGroup
from rclpy.clock import Clock, ClockType
from rclpy.event_handler import PublisherEventCallbacks

from armor_service.access import Settings, state_folder
from armor_service.changes import ChangeFeed, NumberedChange
from armor_service.protocol import DirectiveRequest, DirectiveResponse, StoreError
from armor_service.service import ArmorService
from armor_service.store.store import Store
from armor_service.turns import Backlog, Turns
from state_machines.ros.waiting import executor_of, reported
from surveillance_interfaces.msg import ArmorDirectiveRes, FactChanges
from surveillance_interfaces.srv import ArmorDirective, ArmorDirectiveList
from surveillance_ontology.armor_client import CHANGES_TOPIC
from surveillance_ontology.conversions import changes_to_ros, fill_response, request_from_ros
from surveillance_ontology.patrol_vocabulary import DATA
from surveillance_runtime.launch_protocol import NotNowError
from surveillance_runtime.node import PatrolNode
from surveillance_runtime.parameters import ParameterError
from surveillance_runtime.process import run_node
from surveillance_runtime.qos import STATE_QOS
from surveillance_runtime.waiting import AwaitedWork

PUBLISH_DELAY = 0.005
"""Seconds by which changes are told later, so that this delays no client's next directive."""
SWITCH_INTERVAL = 0.0005
"""Seconds after which a thread that computes lets another one run; Python's default is 0.005."""
SLICE = 0.005
"""Seconds for which waiting requests are answered before the executor sees to other things."""
MOST_WAITING = 5000
"""Requests that are taken and wait; further ones wait in the middleware."""
WORKERS = 4
"""Threads for directives that may take long, as many for `LONG_QUERIES`, for LOAD and for SAVE."""
QUERIES = 2
"""Long queries of one ontology at a time."""
LONG_QUERIES = ('SPARQL', 'EXPLAIN')
_Answer = TypeVar('_Answer')


class ArmorServer(PatrolNode):
    """Serves ARMOR directives.

    Args:
        keep: Whether the store is on by default; the parameter `store` decides.
        node_options: As for `PatrolNode`.
    """

    def __init__(self, *, keep: bool = False, **node_options: Any) -> None:
        super().__init__('armor_server', **node_options)
        self._service = _service(self, keep)
        self._feed = ChangeFeed(self._soon)
        self._service.watch(self._feed.note)
        self._subscribers = 0
        self._untold: list[NumberedChange] = []
        self._publisher = self.create_publisher(
            FactChanges,
            CHANGES_TOPIC,
            STATE_QOS,
            event_callbacks=PublisherEventCallbacks(matched=self._on_matched),
        )
        # Steady time: a simulated clock may stand still.
        steady = Clock(clock_type=ClockType.STEADY_TIME)
        # It runs once: what the store found is told before anybody spins the node, and not again.
        self._pause = self.create_timer(PUBLISH_DELAY, self._on_pause, clock=steady)
        self._pools: list[AwaitedWork] = []
        self._work, self._queries = self._turns(), self._turns(QUERIES)
        # Apart from each other and from the rest: a disk may not answer.
        self._documents = {'LOAD': self._turns(), 'SAVE': self._turns()}
        group = ReentrantCallbackGroup()
        self._backlog: Backlog[tuple[Any, Any]] = Backlog()
        self._single = self.create_service(
            ArmorDirective, 'armor_interface_srv', self._on_directive, callback_group=group
        )
        self.create_service(
            ArmorDirectiveList,
            'armor_interface_serialized_srv',
            self._on_list,
            callback_group=group,
        )

    def on_stop(self) -> None:
        """End the workers and queries that run."""
        for threads in self._pools:
            threads.stop()
        self._service.workspace.sparql.close()

    def destroy_node(self) -> None:
        """Close the store as well: nothing is answered any more."""
        self._service.close()
        super().destroy_node()

    async def _on_directive(self, request: Any, response: Any) -> Any:
        self._take_more()
        directive = request_from_ros(request.armor_request)
        answer = self._service.execute_at_once(directive) or await self._slow_answer(directive)
        fill_response(response.armor_response, answer)
        return response

    def _take_more(self) -> None:
        """Take the requests that wait in the middleware as well.

        The executor takes one request for each of its rounds, which costs more than most
        directives, and a client that sends many keeps the others waiting.
        """
        idle = not self._backlog
        while len(self._backlog) < MOST_WAITING:
            with self._single.handle:
                request, header = self._single.handle.service_take_request(ArmorDirective.Request)
            if header is None:
                break
            self._backlog.put(request.armor_request.client_name, (request, header))
        if idle and self._backlog:
            executor_of(self).create_task(self._answer_backlog)

    async def _answer_backlog(self) -> None:
        end = time.monotonic() + SLICE
        while self._backlog and time.monotonic() < end:
            request, header = self._backlog.take()
            directive = request_from_ros(request.armor_request)
            answer = self._service.execute_at_once(directive)
            if answer is None:
                executor_of(self).create_task(self._answer_slow, directive, header)
            else:
                self._send(answer, header)
        if self._backlog:
            # Others first: those who subscribe, lists, and requests that came meanwhile.
            self._take_more()
            executor_of(self).create_task(self._answer_backlog)

    async def _answer_slow(self, directive: DirectiveRequest, header: Any) -> None:
        self._send(await self._slow_answer(directive), header)

    def _send(self, answer: DirectiveResponse, header: Any) -> None:
        response = ArmorDirective.Response()
        fill_response(response.armor_response, answer)
        self._single.send_response(response, header)

    async def _slow_answer(self, directive: DirectiveRequest) -> DirectiveResponse:
        name, client = directive.reference_name, directive.client_name
        turns = self._turns_of(directive)
        return await self._done(turns, name, client, lambda: self._service.execute(directive))

    def _turns(self, each: int = 1) -> Turns:
        """Make threads of their own for directives of one kind; see `Turns`."""
        threads = AwaitedWork(self, WORKERS)
        self._pools.append(threads)
        return Turns(threads.put, each)

    async def _done(
        self, turns: Turns, name: str, client: str, work: Callable[[], _Answer]
    ) -> _Answer:
        future, report = reported(self, work)
        turns.put(name, client, report)
        answer: _Answer = await future
        return answer

    def _turns_of(self, directive: DirectiveRequest) -> Turns:
        """Return where a directive waits: what takes long must not keep changes waiting."""
        if directive.primary.upper() in LONG_QUERIES:
            return self._queries
        return self._documents.get(directive.command.upper(), self._work)

    async def _on_list(self, request: Any, response: Any) -> Any:
        directives = [request_from_ros(msg) for msg in request.armor_requests]
        names = ' '.join(sorted({directive.reference_name for directive in directives}))
        client = directives[0].client_name if directives else ''
        answer = await self._done(
            self._work, names, client, lambda: self._service.execute_list(directives)
        )
        response.success = answer.success
        response.is_consistent = answer.is_consistent
        rows = [fill_response(ArmorDirectiveRes(), row) for row in answer.responses]
        response.armor_responses = rows
        return response

    def _soon(self) -> None:
        if self.executor is not None:
            executor_of(self).create_task(self._begin_pause)

    def _begin_pause(self) -> None:
        # Not anew with each change: an unbroken series of changes would never be told.
        if self._pause.is_canceled():
            self._pause.reset()

    def _on_pause(self) -> None:
        # Cancelled nowhere else: rclpy fails on a timer that was due when it was cancelled.
        self._pause.cancel()
        self._publish()

    def _on_matched(self, status: Any) -> None:
        self._subscribers = status.current_count
        self._publish()

    def _publish(self) -> None:
        came = self._feed.take()
        for change in came:
            if change.is_consistent or not change.sequence:
                self.health.clear(change.reference_name)
            else:
                self.health.error(change.reference_name, f'{change.reference_name} is inconsistent')
        changes = [*self._untold, *came]
        if not self._subscribers:
            self._untold = changes[-1:]
            return
        self._untold = []
        for change in changes:
            msg = changes_to_ros(change)
            msg.stamp = self.get_clock().now().to_msg()
            self._publisher.publish(msg)


def _service(node: PatrolNode, keep: bool) -> ArmorService:
    """Make the service that a node's parameters describe; it logs through the node.

    Args:
        node: The node.
        keep: Whether the store is on by default.

    Raises:
        ParameterError: A parameter is of the wrong type or out of range.
        NotNowError: The store cannot be used.
    """
    settings = node.declare_fields(Settings(read_only_directories=(DATA,)))
    stored = node.parameter(
        'store',
        'auto' if keep else 'none',
        'Directory that keeps references and their changes over a restart; auto: one for this '
        "domain, name and place in the user's state folder; none: keep nothing.",
        read_only=True,
    )
    place = node.parameter(
        'place',
        '',
        'Name of the place whose map is kept, part of the name of a store that is `auto`: another '
        'place has another store. Empty: one store for all.',
        read_only=True,
    )
    durability = node.parameter(
        'durability',
        'process',
        'What an answered change outlives: the end of the process, or a loss of power as well, for '
        'which each answer waits for the disk.',
        choices=('process', 'power'),
        read_only=True,
    )
    if not re.fullmatch(r'[\w-]*', place):
        raise ParameterError(
            f'{node.get_name()}: parameter place {place!r}: expected letters, digits, _ and -'
        )
    log = node.get_logger()
    folder = _own_folder(node, place) if stored == 'auto' else Path(stored).expanduser()
    if stored == 'auto' and place and not folder.exists():
        others = [each.name for each in folder.parent.glob(f'{_own_folder(node, "").name}*')]
        told = f', beside {", ".join(sorted(others))}' if others else ''
        log.info(f'place {place}: it has a store of its own, which is new{told}')
    try:
        synced = durability == 'power'
        store = None if stored in ('', 'none') else Store(folder, synced=synced)
        service = ArmorService(settings, log.info, log.warn, store)
        if store:
            kept = ', '.join(service.workspace.references.names()) or 'empty'
            log.info(f'store {folder} ({kept}); "-p store:=none" turns it off')
        return service
    except StoreError as error:
        raise NotNowError(f'{node.get_name()}: parameter store: {error}') from None


def _own_folder(node: PatrolNode, place: str) -> Path:
    name = node.get_fully_qualified_name().strip('/').replace('/', '.')
    own = f'{node.context.get_domain_id()}.{name}' + (f'.{place}' if place else '')
    return state_folder() / 'armor' / own


def prepare_process() -> None:
    """Set what holds for the whole process that this node runs in, alone or with others."""
    # A LOAD runs for seconds in Python; others are to get the interpreter often meanwhile.
    sys.setswitchinterval(SWITCH_INTERVAL)


def main(args: list[str] | None = None) -> int:
    """Run the node as a process."""
    prepare_process()
    return run_node(partial(ArmorServer, keep=True), args)


if __name__ == '__main__':
    sys.exit(main())
