"""A single-threaded executor that prepares its waits with less work.

rclpy's own executor looks at every entity of every node several times for each wait, searches a
list for each event handler, and after each callback wakes itself for a wait in which nothing is
ready. In a process that holds the whole patrol that is half of the work. This one keeps a list of
the entities until one comes or goes, and asks each callback group once.

It leans on members of `rclpy.executors.Executor` in Jazzy (7.1) that are not public; where they are
missing, `make_executor` returns rclpy's executor.
"""

from __future__ import annotations

from collections.abc import Callable, Generator
from typing import Any

from rclpy._rclpy_pybind11 import InvalidHandle
from rclpy.executors import (
    ExternalShutdownException,
    ShutdownException,
    SingleThreadedExecutor,
)
from rclpy.impl.implementation_singleton import rclpy_implementation
from rclpy.task import Task

_NEEDED = (
    '_context',
    '_guard',
    '_is_shutdown',
    '_make_handler',
    '_sigint_gc',
    '_take_client',
    '_take_guard_condition',
    '_take_service',
    '_take_subscription',
    '_take_timer',
    '_take_waitable',
    '_tasks',
    '_tasks_lock',
    '_wait_for_ready_callbacks',
    '_work_tracker',
)
_KINDS = ('subscription', 'timer', 'client', 'service')


def make_executor(context: Any = None) -> SingleThreadedExecutor:
    """Return the leanest single-threaded executor that this rclpy allows."""
    plain = SingleThreadedExecutor(context=context)
    if not all(hasattr(plain, name) for name in _NEEDED):
        return plain
    plain.shutdown()
    return LeanExecutor(context=context)


class LeanExecutor(SingleThreadedExecutor):  # type: ignore[misc]
    """Runs callbacks in the thread that spins, one at a time; otherwise as rclpy's."""

    _tasks: list[tuple[Task, Any, Any]]

    def __init__(self, *, context: Any = None) -> None:
        self._stale = True
        super().__init__(context=context)
        self._entities: dict[str, list[tuple[Any, Any]]] = {}
        self._guards: list[tuple[Any, Any]] = []
        self._waitables: list[tuple[Any, Any]] = []

    def wake(self) -> None:
        """Look at the nodes' entities anew: one came or went."""
        self._stale = True
        super().wake()

    def add_node(self, node: Any) -> bool:
        """Add a node whose callbacks are to be run."""
        added = super().add_node(node)
        self.wake()
        return bool(added)

    def remove_node(self, node: Any) -> None:
        """Run a node's callbacks no longer."""
        super().remove_node(node)
        self.wake()

    def _wait_for_ready_callbacks(
        self, timeout_sec: Any = None, nodes: Any = None, condition: Any = None
    ) -> Generator[tuple[Task, Any, Any], None, None]:
        if timeout_sec is not None or nodes is not None:
            arguments = [timeout_sec, nodes] + ([] if condition is None else [condition])
            yield from super()._wait_for_ready_callbacks(*arguments)
            return
        worked = False
        while not worked and not self._is_shutdown:
            for task, entity, node in self._unfinished():
                worked = True
                yield task, entity, node
            for entity, node, take in self._wait():
                if entity.callback_group.can_execute(entity):
                    worked = True
                    yield self._make_handler(entity, node, take), entity, node
            if condition is not None and condition():
                return
        if self._is_shutdown:
            raise ShutdownException()

    def _unfinished(self) -> list[tuple[Task, Any, Any]]:
        """Return the tasks that wait for something, newest first, and forget the ended ones."""
        with self._tasks_lock:
            self._tasks = [
                each for each in self._tasks if not (each[0].done() or each[0].cancelled())
            ]
            return [each for each in reversed(self._tasks) if not each[0].executing()]

    def _look(self) -> None:
        self._stale = False
        entities: dict[str, list[tuple[Any, Any]]] = {kind: [] for kind in _KINDS}
        guards: list[tuple[Any, Any]] = []
        waitables: list[tuple[Any, Any]] = []
        for node in self.get_nodes():
            entities['subscription'] += [(each, node) for each in node.subscriptions]
            entities['timer'] += [(each, node) for each in node.timers]
            entities['client'] += [(each, node) for each in node.clients]
            entities['service'] += [(each, node) for each in node.services]
            guards += [(each, node) for each in node.guards]
            waitables += [(each, node) for each in node.waitables]
        self._entities, self._guards, self._waitables = entities, guards, waitables

    def _wait(self) -> list[tuple[Any, Any, Callable[[Any], Any]]]:
        """Wait until something is ready; return what, with its node and how to take it."""
        if self._stale:
            self._look()
        may_run: dict[int, bool] = {}

        def is_wanted(entity: Any) -> bool:
            if entity._executor_event:
                return False
            group = entity.callback_group
            allowed = may_run.get(id(group))
            if allowed is None:
                allowed = may_run[id(group)] = bool(group.can_execute(entity))
            return allowed

        held: list[Any] = []
        try:
            wanted = {
                kind: [pair for pair in pairs if is_wanted(pair[0]) and _hold(pair[0].handle, held)]
                for kind, pairs in self._entities.items()
            }
            guards = [pair for pair in self._guards if is_wanted(pair[0])]
            for guard, _ in guards:
                if guard._executor_triggered:
                    guard.trigger()
            guards = [pair for pair in guards if _hold(pair[0].handle, held)]
            own = [each for each in (self._guard, self._sigint_gc) if _hold(each.handle, held)]
            waitables = [
                pair for pair in self._waitables if is_wanted(pair[0]) and _hold(pair[0], held)
            ]
            _hold(self._context.handle, held)
            wait_set = self._wait_set(wanted, len(guards) + len(own), waitables)
            for kind, add in (
                ('subscription', wait_set.add_subscription),
                ('client', wait_set.add_client),
                ('service', wait_set.add_service),
                ('timer', wait_set.add_timer),
            ):
                for entity, _ in wanted[kind]:
                    add(entity.handle)
            for guard, _ in guards:
                wait_set.add_guard_condition(guard.handle)
            for guard in own:
                wait_set.add_guard_condition(guard.handle)
            for waitable, _ in waitables:
                waitable.add_to_wait_set(wait_set)
            wait_set.wait(-1)
            if self._is_shutdown:
                raise ShutdownException()
            if not self._context.ok():
                raise ExternalShutdownException()
            return self._ready(wait_set, wanted, guards, waitables)
        finally:
            for handle in reversed(held):
                handle.__exit__(None, None, None)

    def _wait_set(
        self, wanted: dict[str, list[Any]], guards: int, waitables: list[tuple[Any, Any]]
    ) -> Any:
        counts = {kind: len(pairs) for kind, pairs in wanted.items()}
        events = 0
        for waitable, _ in waitables:
            more = waitable.get_num_entities()
            counts['subscription'] += more.num_subscriptions
            counts['timer'] += more.num_timers
            counts['client'] += more.num_clients
            counts['service'] += more.num_services
            guards += more.num_guard_conditions
            events += more.num_events
        wait_set = rclpy_implementation.WaitSet(
            counts['subscription'],
            guards,
            counts['timer'],
            counts['client'],
            counts['service'],
            events,
            self._context.handle,
        )
        wait_set.clear_entities()
        return wait_set

    def _ready(
        self,
        wait_set: Any,
        wanted: dict[str, list[tuple[Any, Any]]],
        guards: list[tuple[Any, Any]],
        waitables: list[tuple[Any, Any]],
    ) -> list[tuple[Any, Any, Callable[[Any], Any]]]:
        triggered = set(wait_set.get_ready_entities('guard_condition'))
        for guard, _ in guards:
            if guard.handle.pointer in triggered:
                guard._executor_triggered = True
        ready: list[tuple[Any, Any, Callable[[Any], Any]]] = [
            (each, node, self._take_waitable) for each, node in waitables if each.is_ready(wait_set)
        ]
        takes = {
            'timer': self._take_timer,
            'subscription': self._take_subscription,
            'client': self._take_client,
            'service': self._take_service,
        }
        for kind, take in takes.items():
            pointers = set(wait_set.get_ready_entities(kind))
            if not pointers:
                continue
            for entity, node in wanted[kind]:
                # A cancelled timer shows as ready: rcl is asked again.
                if entity.handle.pointer in pointers and (
                    kind != 'timer' or entity.handle.is_timer_ready()
                ):
                    ready.append((entity, node, take))
        ready += [
            (each, node, self._take_guard_condition)
            for each, node in guards
            if each._executor_triggered
        ]
        return ready

    def _make_handler(self, entity: Any, node: Any, take: Callable[[Any], Any]) -> Task:
        entity._executor_event = True

        async def handle() -> None:
            # With one thread nobody waits meanwhile, so nobody needs to be woken afterwards.
            if self._is_shutdown or not entity.callback_group.beginning_execution(entity):
                entity._executor_event = False
                return
            with self._work_tracker:
                call = take(entity)
                entity._executor_event = False
                try:
                    if call is not None:
                        await call()
                finally:
                    entity.callback_group.ending_execution(entity)

        task = Task(handle, executor=self)
        with self._tasks_lock:
            self._tasks.append((task, entity, node))
        return task


def _hold(handle: Any, held: list[Any]) -> bool:
    """Keep a handle from being destroyed during the wait; False if it is gone already."""
    try:
        handle.__enter__()
    except InvalidHandle:
        return False
    held.append(handle)
    return True
