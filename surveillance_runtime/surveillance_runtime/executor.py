"""An executor for one thread that keeps what it waits for from one wait to the next.

rclpy's `SingleThreadedExecutor` gathers every entity of every node anew before each wait, and makes
a task and two coroutines for each callback: half of the processor time of a process with all the
patrol's nodes (230 entities, 30 waits for each simulated second). Here the entities are gathered
when one came or went, and a callback is simply called. While messages and timers alone keep the
process busy, the rest (most of the entities) is looked at every 10 ms; the waits between look only
at what had a message lately.

rclpy's own `EventsExecutor` waits for no set at all, but in Jazzy it leaves asynchronous service
callbacks unanswered (rclpy 1613), asks a waiting coroutine again without pause, and may end the
process where a publisher with event callbacks is destroyed (rclpy 1644).
"""

from __future__ import annotations

import inspect
import time
from collections import deque
from collections.abc import Callable, Container, Iterator
from contextlib import ExitStack
from typing import Any

from rclpy.callback_groups import CallbackGroup
from rclpy.executors import (
    ExternalShutdownException,
    SingleThreadedExecutor,
    TimeoutObject,
)
from rclpy.impl.implementation_singleton import rclpy_implementation as _rclpy
from rclpy.node import Node
from rclpy.subscription import Subscription
from rclpy.task import Task
from rclpy.utilities import timeout_sec_to_nsec
from rclpy.waitable import NumberOfEntities

from surveillance_runtime.message_source import SourceTaker

_MOST_LISTS = 30
"""Wait lists that are kept: one for each set of callback groups that coroutines held at once."""
_EVERYTHING_PERIOD = 0.01
"""Seconds of real time between two looks at more than the messages and timers that keep the process
busy."""
_CHOICE_PERIOD = 1.0
"""Seconds after which it is chosen anew what keeps the process busy."""
_BUSY_KINDS = ('timer', 'subscription')
_KINDS = ('timer', 'subscription', 'guard_condition', 'client', 'service')


class _WaitList:
    """What is waited for: entities whose callbacks may be called.

    Args:
        entities: By kind; waitables under 'waitable'.
        guards: The executor's own guard conditions.
        context: ROS context.
    """

    def __init__(self, entities: dict[str, list[Any]], guards: list[Any], context: Any) -> None:
        # Marks the handles as in use: what is destroyed meanwhile goes when the list is closed.
        self._in_use = ExitStack()
        self._in_use.enter_context(context.handle)
        self._handles: dict[str, list[Any]] = {kind: [] for kind in _KINDS}
        self._by_pointer: dict[str, dict[int, Any]] = {kind: {} for kind in _KINDS}
        for kind in _KINDS:
            for entity in entities[kind]:
                self._use(kind, entity)
        for guard in guards:
            self._use('guard_condition', guard)
        self._waitables = [each for each in entities['waitable'] if self._entered(each)]
        count = NumberOfEntities(
            *(
                len(self._handles[kind])
                for kind in ('subscription', 'guard_condition', 'timer', 'client', 'service')
            )
        )
        for waitable in self._waitables:
            count += waitable.get_num_entities()
        self._looked_at = self._handles
        self._set = _rclpy.WaitSet(
            count.num_subscriptions,
            count.num_guard_conditions,
            count.num_timers,
            count.num_clients,
            count.num_services,
            count.num_events,
            context.handle,
        )

    def _use(self, kind: str, entity: Any) -> None:
        if self._entered(entity.handle):
            self._handles[kind].append(entity.handle)
            self._by_pointer[kind][entity.handle.pointer] = entity

    def _entered(self, handle: Any) -> bool:
        try:
            self._in_use.enter_context(handle)
        except _rclpy.InvalidHandle:
            return False
        return True

    def look_only_at(self, entities: Container[Any]) -> None:
        """Leave all others out of the waits: each handle is put into the set again every time."""
        self._looked_at = {
            kind: [each for each in handles if self._by_pointer[kind][each.pointer] in entities]
            for kind, handles in self._handles.items()
        }

    def wait(self, timeout: int) -> Iterator[tuple[str, Any]]:
        """Wait until something is ready; yield it, with its kind.

        Args:
            timeout: Nanoseconds; negative: without end.
        """
        if not any(self._looked_at.values()):
            return  # rcl does not wait for nothing
        wait_set = self._set
        wait_set.clear_entities()
        for kind, add in (
            ('subscription', wait_set.add_subscription),
            ('client', wait_set.add_client),
            ('service', wait_set.add_service),
            ('timer', wait_set.add_timer),
            ('guard_condition', wait_set.add_guard_condition),
        ):
            for handle in self._looked_at[kind]:
                add(handle)
        for waitable in self._waitables:
            waitable.add_to_wait_set(wait_set)
        # The only place where this thread sleeps, and the interpreter's lock is let go.
        wait_set.wait(timeout)
        for waitable in self._waitables:
            if waitable.is_ready(wait_set):
                yield 'waitable', waitable
        for kind in _KINDS:
            known = self._by_pointer[kind]
            for pointer in wait_set.get_ready_entities(kind):
                if pointer in known:  # else it belongs to a waitable
                    yield kind, known[pointer]

    def close(self) -> None:
        """Let the handles go."""
        self._in_use.close()


class PatrolExecutor(SingleThreadedExecutor):
    """Spins nodes in the thread that spins it, as rclpy's executor of the same kind does."""

    def __init__(self, *, context: Any = None) -> None:
        super().__init__(context=context)
        self._ready: deque[tuple[str, Any]] = deque()
        self._new_tasks: deque[Task] = deque()
        # Tasks that wait, and the entity whose callback group they hold, if any.
        self._waiting: dict[Task, Any] = {}
        self._entities: dict[str, list[Any]] = {}
        # By the groups that coroutines hold: what keeps a process busy, and everything.
        self._wait_lists: dict[frozenset[CallbackGroup], tuple[_WaitList, _WaitList]] = {}
        self._everything_due = self._choice_due = 0.0
        self._lately_called: set[Any] = set()
        self._changed = True
        self._sources: SourceTaker | None = None
        self._take: dict[str, Callable[[Any], Any]] = {
            'timer': _call_timer,
            'subscription': self._take_subscription,
            'guard_condition': self._take_guard_condition,
            'client': self._take_client,
            'service': self._take_service,
            'waitable': self._take_waitable,
        }

    def create_task(self, callback: Any, *args: Any, **kwargs: Any) -> Task:
        """Have a function called, or a coroutine carried out, by the spinning thread."""
        task = Task(callback, args, kwargs, executor=self)
        self._new_tasks.append(task)
        super().wake()
        return task

    def wake(self) -> None:
        """Look again: an entity came or went, or a future is done; from any thread."""
        self._changed = True
        super().wake()

    def add_node(self, node: Node) -> bool:
        """Spin a node, too."""
        added = bool(super().add_node(node))
        self.wake()
        return added

    def remove_node(self, node: Node) -> None:
        """Spin a node no more."""
        super().remove_node(node)
        # Afterwards: whoever spins meanwhile has gathered it once more.
        self.wake()

    def _spin_once_impl(
        self, timeout_sec: Any = None, wait_condition: Callable[[], bool] = lambda: False
    ) -> None:
        """Call one callback, or wait for some once; all public ways to spin lead here."""
        if not self._ready:
            self._carry_on()
            if wait_condition() or self._is_shutdown:
                return
            timeout = timeout_sec.timeout if isinstance(timeout_sec, TimeoutObject) else timeout_sec
            self._wait(timeout_sec_to_nsec(timeout))
        if self._ready:
            self._call(*self._ready.popleft())

    def _wait(self, timeout: int) -> None:
        if not self._context.ok():
            raise ExternalShutdownException
        if self._changed:
            self._changed = False
            self._gather()
        # A group that a waiting coroutine holds admits no second callback: its entities are left
        # out of the wait, or they would be ready again and again without being taken.
        held = frozenset(
            entity.callback_group
            for entity in self._waiting.values()
            if entity is not None and not entity.callback_group.can_execute(entity)
        )
        if held not in self._wait_lists:
            if len(self._wait_lists) >= _MOST_LISTS:
                self._close_wait_lists()
            self._wait_lists[held] = self._new_wait_lists()
        busy, everything = self._wait_lists[held]
        now = time.monotonic()
        try:
            # Most of a second's messages come from few entities: these are looked at alone, often,
            # and all together now and then. Putting every handle into a wait set costs more than
            # the callbacks of a quiet node.
            if now >= self._choice_due:
                busy.look_only_at(self._lately_called)
                self._lately_called.clear()
                self._choice_due = now + _CHOICE_PERIOD
            if now < self._everything_due:
                self._ready.extend(busy.wait(0))
            if not self._ready:
                for kind, entity in everything.wait(timeout):
                    if entity.callback_group is not None:  # as the executor's own guards have
                        self._ready.append((kind, entity))
                self._everything_due = time.monotonic() + _EVERYTHING_PERIOD
        except _rclpy.InvalidHandle:
            self._changed = True  # another thread has just destroyed something

    def _gather(self) -> None:
        """Look which entities there are; forget the wait lists if they are others."""
        nodes = self.get_nodes()
        entities: dict[str, list[Any]] = {
            'timer': [each for node in nodes for each in node.timers],
            'subscription': [each for node in nodes for each in node.subscriptions],
            'guard_condition': [each for node in nodes for each in node.guards],
            'client': [each for node in nodes for each in node.clients],
            'service': [each for node in nodes for each in node.services],
            'waitable': [each for node in nodes for each in node.waitables],
        }
        # Making a wait list enters every handle: not for each change of a future, only for others.
        if entities != self._entities:
            self._close_wait_lists()
            self._entities = entities

    def _close_wait_lists(self) -> None:
        for lists in self._wait_lists.values():
            for each in lists:
                each.close()
        self._wait_lists.clear()
        self._lately_called.clear()

    def _new_wait_lists(self) -> tuple[_WaitList, _WaitList]:
        """Return what may be waited for now: entities whose groups are not held."""
        free = {
            kind: [each for each in entities if each.callback_group.can_execute(each)]
            for kind, entities in self._entities.items()
        }
        busy = {kind: each if kind in _BUSY_KINDS else [] for kind, each in free.items()}
        return (
            _WaitList(busy, [], self._context),
            _WaitList(free, [self._guard, self._sigint_gc], self._context),
        )

    def _call(self, kind: str, entity: Any) -> None:
        """Take what an entity has received and work on it, if its group lets it."""
        if not entity.callback_group.beginning_execution(entity):
            if kind == 'guard_condition':
                entity.trigger()  # the wait has taken that away
            return
        self._lately_called.add(entity)
        task = None
        try:
            if kind != 'timer' or _is_due(entity):
                work = self._take[kind](entity)
                # A callback that returned no coroutine is over: no task, which costs more than many
                # callbacks.
                if work is not None:
                    task = Task(work, executor=self)
                    _step(task)
        finally:
            if task is None or task.done():
                entity.callback_group.ending_execution(entity)
            else:
                self._waiting[task] = entity

    def _carry_on(self) -> None:
        """Go on with all tasks until those that are left wait for something."""
        went_on = True
        while went_on:
            went_on = False
            while self._new_tasks:
                self._waiting[self._new_tasks.popleft()] = None
            # All of them: that a future is done says nothing of who awaits it, and they are few.
            for task in list(self._waiting):
                try:
                    _step(task)
                finally:
                    if task.done() or task.cancelled():
                        went_on = True
                        entity = self._waiting.pop(task)
                        if entity is not None:
                            entity.callback_group.ending_execution(entity)

    def _take_subscription(self, subscription: Subscription) -> Any:
        """Take a message and hand it over; return what the callback left to await, if anything.

        A serialized message comes with the identity of its publisher.
        """
        only_message = subscription._callback_type is Subscription.CallbackType.MessageOnly
        try:
            handle = subscription.handle
            with handle:
                if subscription.raw and not only_message:
                    if self._sources is None:
                        self._sources = SourceTaker()
                    taken = self._sources.take(handle)
                else:
                    taken = handle.take_message(subscription.msg_type, subscription.raw)
        except _rclpy.InvalidHandle:
            return None
        if taken is None:
            return None
        return _coroutine(subscription.callback(*(taken[:1] if only_message else taken)))

    def shutdown(self, timeout_sec: float | None = None) -> bool:
        """Stop, and close the coroutines that wait. Nobody may spin any more."""
        self._close_wait_lists()
        if self._sources is not None:
            self._sources.close()
            self._sources = None
        for task in (*self._new_tasks, *self._waiting):
            task.cancel()
        return bool(super().shutdown(timeout_sec))


def _call_timer(timer: Any) -> Any:
    """Set a timer for the next time and call its callback; return what is left to await."""
    try:
        with timer.handle:
            timer.handle.call_timer()
    except _rclpy.InvalidHandle:
        return None
    return _coroutine(timer.callback())


def _coroutine(returned: Any) -> Any:
    """Return what a callback returned when it is to be awaited, otherwise None."""
    return returned if inspect.iscoroutine(returned) else None


def _is_due(timer: Any) -> bool:
    """Tell whether a timer is due: to rcl, one that was cancelled may be ready."""
    try:
        return bool(timer.handle.is_timer_ready())
    except _rclpy.InvalidHandle:
        return False


def _step(task: Task) -> None:
    """Go on with a task; raises what it raises."""
    task()
    if task.done() and task.exception() is not None:
        raise task.exception()
