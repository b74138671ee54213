"""The armor server: ARMOR's two services, and a topic that tells which facts change.

What is quick is answered in the callback itself. What may take long (loading, saving, SPARQL, a
first reasoning) goes to a worker thread, so that other clients are not kept waiting.
"""

from __future__ import annotations

import queue
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

from rclpy.callback_groups import ReentrantCallbackGroup
from rclpy.event_handler import PublisherEventCallbacks
from rclpy.task import Future

from surveillance_interfaces.msg import FactChanges
from surveillance_interfaces.srv import ArmorDirective, ArmorDirectiveList
from surveillance_ontology.armor.change_feed import ChangeFeed
from surveillance_ontology.armor.journal import JournalError
from surveillance_ontology.armor.service import ArmorService
from surveillance_ontology.armor.settings import Settings
from surveillance_ontology.armor.store import Store
from surveillance_ontology.armor_client import CHANGES_TOPIC
from surveillance_ontology.conversions import changes_to_ros, fill_response, request_from_ros
from surveillance_runtime.node import PatrolNode, StartError, run_node
from surveillance_runtime.qos import STATE_QOS

WORKERS = 4
"""Threads for directives that may take long."""


class ArmorServer(PatrolNode):
    """Serves ARMOR directives."""

    def __init__(self, **node_options: Any) -> None:
        super().__init__('armor_server', **node_options)
        log = self.get_logger()
        settings, directory = self._settings(), self._store_directory()
        try:
            store = Store(Path(directory).expanduser()) if directory else None
            self._service = ArmorService(settings, log.info, log.warn, store)
        except JournalError as error:
            raise StartError(f'{self.get_name()}: parameter store: {error}') from None
        self._feed = ChangeFeed(self._service, self._soon)
        self._work: queue.SimpleQueue[Callable[[], None] | None] = queue.SimpleQueue()
        self._publisher = self.create_publisher(
            FactChanges,
            CHANGES_TOPIC,
            STATE_QOS,
            event_callbacks=PublisherEventCallbacks(matched=lambda _status: self._publish()),
        )
        group = ReentrantCallbackGroup()
        self.create_service(
            ArmorDirective, 'armor_interface_srv', self._on_directive, callback_group=group
        )
        self.create_service(
            ArmorDirectiveList,
            'armor_interface_serialized_srv',
            self._on_list,
            callback_group=group,
        )
        for number in range(WORKERS):
            self.spawn(self._run_work, f'armor worker {number}')

    def on_stop(self) -> None:
        """End the workers."""
        for _ in range(WORKERS):
            self._work.put(None)
        self._service.close()

    def _settings(self) -> Settings:
        default = Settings()
        directories = self.parameter(
            'directories',
            ['.'],
            'Directories inside which LOAD, SAVE and LOG may read and write files.',
            check=lambda value: None if all(value) else 'names of directories',
        )
        return Settings(
            directories=tuple(directories),
            enforce_mount=self.parameter(
                'enforce_mount',
                default.enforce_mount,
                'Refuse changes by other clients while a client is mounted; ARMOR 2.2 does not.',
            ),
            narrow_doubles=self.parameter(
                'narrow_doubles',
                default.narrow_doubles,
                'Store values of type DOUBLE as xsd:float, as ARMOR 2.2 does.',
            ),
            allow_web=self.parameter(
                'allow_web', default.allow_web, 'Let LOAD WEB fetch documents from the web.'
            ),
            sparql_derived=self.parameter(
                'sparql_derived',
                default.sparql_derived,
                'Let SPARQL see derived facts too; ARMOR 2.2 shows it the asserted ones only.',
            ),
            sparql_timeout=self.parameter(
                'sparql_timeout',
                default.sparql_timeout,
                'Longest time a SPARQL query may take, seconds.',
                minimum=0.01,
                maximum=3600.0,
            ),
        )

    def _store_directory(self) -> str:
        directory: str = self.parameter(
            'store',
            '',
            'Directory in which references and their changes are kept over a restart; empty: none.',
            read_only=True,
        )
        return directory

    async def _on_directive(self, request: Any, response: Any) -> Any:
        directive = request_from_ros(request.armor_request)
        answer = self._service.execute_at_once(directive)
        if answer is None:
            answer = await self._in_worker(lambda: self._service.execute(directive))
        fill_response(response.armor_response, answer)
        return response

    async def _on_list(self, request: Any, response: Any) -> Any:
        directives = [request_from_ros(msg) for msg in request.armor_requests]
        answer = await self._in_worker(lambda: self._service.execute_list(directives))
        response.success = answer.success
        response.is_consistent = answer.is_consistent
        new = type(ArmorDirective.Response().armor_response)
        response.armor_responses = [fill_response(new(), each) for each in answer.responses]
        return response

    def _in_worker(self, run: Callable[[], Any]) -> Future:
        future = Future(executor=self.executor)

        def work() -> None:
            future.set_result(run())
            # A future completed by another thread does not wake the executor.
            if self.executor is not None:
                self.executor.wake()

        self._work.put(work)
        return future

    def _run_work(self) -> None:
        while (work := self._work.get()) is not None:
            work()

    def _soon(self) -> None:
        if self.executor is not None:
            self.executor.create_task(self._publish)

    def _publish(self) -> None:
        if self._publisher.get_subscription_count() == 0:
            return
        for change in self._feed.take():
            msg = changes_to_ros(*change)
            msg.stamp = self.get_clock().now().to_msg()
            self._publisher.publish(msg)


def main(args: list[str] | None = None) -> int:
    """Run the node as a process."""
    return run_node(ArmorServer, args)


if __name__ == '__main__':
    sys.exit(main())
