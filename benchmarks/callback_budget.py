"""What the callbacks of a node's topics, services and actions cost, whatever they are told.

What a node takes is found by introspection, so a new handler is tried, too. While a patrol runs,
the honest messages that each hears are kept. Then one field after the other gets other values:
numbers drawn log-uniformly from 1e-300 to 1e300 with both signs, zero, NaN and infinities, arrays
from empty to a million elements, strings that are odd or long. The callback is called with that by
the executor's thread as the executor would, with the identity of the honest publisher, and the
processor time of that thread is measured. A call that seems dear is made again: imports and the
work of others' garbage are no property of a message.
"""

from __future__ import annotations

import array
import copy
import importlib
import math
import random
import threading
import time
import types
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field
from typing import Any

from rclpy.action import ActionClient, get_action_server_names_and_types_by_node
from rclpy.node import Node
from rclpy.serialization import deserialize_message, serialize_message
from rclpy.subscription import Subscription

from benchmarks.fuzz_nodes import ARRAY_CODES, STRANGE_STRINGS

BUDGET, LARGE_BUDGET = 0.010, 0.050
"""Seconds of processor time that a callback may take; the second for `LARGE`."""
LARGE = ('Image', 'CompressedImage', 'LaserScan', 'PointCloud2', 'OccupancyGrid', 'OntologyMap')
"""Pictures, scans and maps: long when they are honest."""
TRIES = 4
"""The cheapest of so many calls counts."""
LONGEST, LONGEST_NESTED = 1_000_000, 10_000
"""Elements of an array of numbers, and of messages or texts; letters of all texts of an array."""
PATIENCE = 60.0
_INTEGERS = {'char': (0, 255), 'octet': (0, 255), 'byte': (0, 255)} | {
    f'{sign}int{bits}': (0, 2**bits - 1) if sign else (-(2 ** (bits - 1)), 2 ** (bits - 1) - 1)
    for sign in ('', 'u')
    for bits in (8, 16, 32, 64)
}
_NO_INFO = {
    'source_timestamp': 0,
    'received_timestamp': 0,
    'publication_sequence_number': 1,
    'reception_sequence_number': 1,
    'publisher_gid': bytes(16),
}


class Draws:
    """Values of fields.

    Args:
        chance: Where randomness comes from.
        longest: Elements of an array of numbers at most.
    """

    def __init__(self, chance: random.Random, longest: int = LONGEST) -> None:
        self._chance = chance
        self._longest = longest

    def number(self, kind: str) -> Any:
        """Return a number for a field of a message."""
        chance = self._chance
        if kind in ('double', 'float'):
            if chance.random() < 0.2:
                return chance.choice((0.0, -0.0, math.nan, math.inf, -math.inf))
            value = chance.choice((1.0, -1.0)) * 10.0 ** chance.uniform(-300.0, 300.0)
            return value if kind == 'double' or abs(value) < 3.4e38 else math.copysign(3e38, value)
        if kind == 'boolean':
            return chance.random() < 0.5
        low, high = _INTEGERS[kind]
        size = min(high, int(10.0 ** chance.uniform(0.0, math.log10(high))))
        value = chance.choice((low, high, 0, size))
        return max(low, -size) if chance.random() < 0.3 else value

    def text(self, longest: int = LONGEST) -> str:
        """Return a text, odd or long."""
        if longest > 1 and self._chance.random() < 0.3:
            letter = self._chance.choice(('x', '/', '\n', '\u2028', '{'))
            return letter * self._length(min(longest, self._longest))
        return self._chance.choice(STRANGE_STRINGS)

    def _length(self, most: int) -> int:
        if self._chance.random() < 0.2:
            return self._chance.choice((0, 1, most))
        return int(10.0 ** self._chance.uniform(0.0, math.log10(most)))

    def values(self, kind: str, count: int | None = None) -> Any:
        """Return an array of a field's elements."""
        nested = '/' in kind or kind.startswith(('string', 'wstring'))
        if count is None:
            count = self._length(min(LONGEST_NESTED, self._longest) if nested else self._longest)
        if kind.startswith(('string', 'wstring')):
            few = [self.text(LONGEST // max(count, 1)) for _ in range(min(count, 20))]
        else:
            # What is in them is short: nothing of a gigabyte is delivered.
            inner = Draws(self._chance, min(self._longest, 100)) if '/' in kind else self
            few = [inner.value(kind) for _ in range(min(count, 20))]
        if not few:
            return []
        whole = count // len(few) + 1
        if kind in ARRAY_CODES:
            return (array.array(ARRAY_CODES[kind], few) * whole)[:count]
        return (few * whole)[:count]

    def value(self, kind: str) -> Any:
        """Return a value of any kind."""
        if kind.startswith('sequence<'):
            inner, _, bound = kind[9:-1].partition(', ')
            return self.values(inner, self._chance.randint(0, int(bound)) if bound else None)
        if kind.endswith(']'):
            inner, _, count = kind[:-1].rpartition('[')
            return self.values(inner, int(count))
        if '/' in kind:
            message = _class(kind)()
            for name, inner in message.get_fields_and_field_types().items():
                put(message, name, self.value(inner))
            return message
        return self.text() if kind.startswith(('string', 'wstring')) else self.number(kind)

    def changed(self, message: Any, path: Sequence[str]) -> Any:
        """Return a copy of a message with another value in one field."""
        changed = copy.copy(message)
        name, *rest = path
        kind = changed.get_fields_and_field_types()[name]
        old = getattr(changed, name)
        if rest and isinstance(old, list):
            elements = [*old] or [_class(kind[9:-1].partition(', ')[0])()]
            number = self._chance.randrange(len(elements))
            elements[number] = self.changed(elements[number], rest)
            put(changed, name, elements)
        elif rest:
            put(changed, name, self.changed(old, rest))
        elif 'sequence<' in kind and len(old) and self._chance.random() < 0.5:
            # One element of an array that is long as an honest one.
            elements = copy.copy(old)
            inner = kind[9:-1].partition(', ')[0]
            if isinstance(elements, list) or inner in ARRAY_CODES:
                elements[self._chance.randrange(len(old))] = self.value(inner)
            put(changed, name, elements)
        else:
            put(changed, name, self.value(kind))
        return changed


def put(message: Any, name: str, value: Any) -> None:
    """Set a field; what the class refuses no peer of rclpy can send, and it stays."""
    try:
        setattr(message, name, value)
    except (AssertionError, ValueError, TypeError, OverflowError):
        return


def _class(kind: str) -> Any:
    package, name = kind.split('/')
    return getattr(importlib.import_module(f'{package}.msg'), name)


def fields_of(kind: Any, depth: int = 0) -> Iterator[tuple[str, ...]]:
    """Return the fields of a kind of message, also those inside of others, as paths of names."""
    for name, field_kind in kind.get_fields_and_field_types().items():
        yield (name,)
        inner = field_kind
        if inner.startswith('sequence<'):
            inner = inner[9:-1].partition(', ')[0]
        if '/' in inner and depth < 6:
            for rest in fields_of(_class(inner), depth + 1):
                yield (name, *rest)


@dataclass
class Heard:
    """Something that a node takes.

    Attributes:
        node, name: Of what.
        kind: The class of what it is told.
        call: Tells it what `ready` made of a message; the executor's thread may call it.
        ready: Makes of a message what the middleware would give.
        honest: Messages that were heard.
        on_honest: Called when one was.
    """

    node: str
    name: str
    kind: Any
    call: Callable[[Any], Any]
    honest: list[Any] = field(default_factory=list)
    on_honest: Callable[[], object] = lambda: None
    ready: Callable[[Any], Any] = lambda message: message

    @property
    def budget(self) -> float:
        """Seconds of processor time that its callback may take."""
        return LARGE_BUDGET if self.kind.__name__ in LARGE else BUDGET


def heard_by(node: Node) -> list[Heard]:
    """Return what a node takes, and have what it hears from now on kept as honest."""
    found = [_topic(node, each) for each in node.subscriptions]
    for service in node.services:
        found.append(_service(node, service))
    return [*found, *_actions(node)]


def _topic(node: Node, subscription: Subscription) -> Heard:
    callback = subscription.callback
    only_message = subscription._callback_type is Subscription.CallbackType.MessageOnly
    number = 0

    def call(told: Any) -> Any:
        nonlocal number
        number += 1
        if only_message:
            return callback(told)
        later = info['publication_sequence_number'] + number
        stamp = time.time_ns()
        return callback(
            told,
            {**info, 'publication_sequence_number': later, 'source_timestamp': stamp},
        )

    info: dict[str, Any] = dict(_NO_INFO)
    heard = Heard(node.get_name(), subscription.topic_name, subscription.msg_type, call)
    if subscription.raw:
        heard.ready = serialize_message

    def keep(*given: Any) -> Any:
        if len(heard.honest) < 3:
            message = given[0]
            if subscription.raw:
                message = deserialize_message(message, subscription.msg_type)
            heard.honest.append(message)
            if len(given) > 1:
                info.update(given[1])
            heard.on_honest()
        return callback(*given)

    # rclpy looks at how many arguments a callback takes when it is set: not again.
    subscription._callback = keep
    return heard


def _service(node: Node, service: Any) -> Heard:
    kind = service.srv_type

    def call(request: Any) -> Any:
        return service.callback(request, kind.Response())

    return Heard(node.get_name(), service.srv_name, kind.Request, call)


def _actions(node: Node) -> list[Heard]:
    """Return the actions that a node serves; each gets its goals from a client of its own."""
    found = []
    name, namespace = node.get_name(), node.get_namespace()
    for action, (kind, *_) in get_action_server_names_and_types_by_node(node, name, namespace):
        package, _, class_name = kind.split('/')
        action_type = getattr(importlib.import_module(f'{package}.action'), class_name)
        client = ActionClient(node, action_type, action)

        def call(goal: Any, client: ActionClient = client) -> None:
            client.send_goal_async(goal)

        found.append(Heard(name, action, action_type.Goal, call))
    return found


@dataclass
class Cost:
    """The dearest call so far.

    Attributes:
        heard: What was called.
        path: The field that was changed.
        seconds: Processor time.
        what: The value, shortened.
        calls: How many calls there were.
    """

    heard: Heard
    path: str = ''
    seconds: float = 0.0
    what: str = ''
    calls: int = 0

    @property
    def broken(self) -> bool:
        """Whether it took more than it may."""
        return self.seconds > self.heard.budget


@types.coroutine
def _measured(coroutine: Any, note: Callable[[float], None]) -> Any:
    """Carry a coroutine out as the executor does, and note what each of its steps costs."""
    value = None
    while True:
        begun = time.thread_time()
        try:
            awaited = coroutine.send(value)
        except StopIteration as end:
            note(time.thread_time() - begun)
            return end.value
        except Exception:
            note(time.thread_time() - begun)
            return None
        note(time.thread_time() - begun)
        value = yield awaited


class Prober:
    """Calls what nodes take, in the thread of the executor that spins them.

    Args:
        executor: The executor.
        draws: The values.
    """

    def __init__(self, executor: Any, draws: Draws) -> None:
        self._executor = executor
        self._draws = draws

    def in_executor(self, work: Callable[[], Any]) -> None:
        """Have work done by the executor's thread, and wait for it.

        Raises:
            TimeoutError: The executor did not come to it: it hangs.
        """
        done = threading.Event()

        def run() -> None:
            try:
                work()
            finally:
                done.set()

        self._executor.create_task(run)
        if not done.wait(PATIENCE):
            raise TimeoutError(f'the executor does nothing else for {PATIENCE:g} s')

    def probe(self, heard: Heard, draws: int, paths: Sequence[Sequence[str]] = ()) -> Cost:
        """Call something with each of its fields changed so many times."""
        cost = Cost(heard)
        base = heard.honest or [heard.kind()]
        for path in paths or [*fields_of(heard.kind)]:
            remaining = draws
            while remaining > 0:
                batch = min(remaining, 10)
                remaining -= batch
                messages = [
                    self._draws.changed(base[(remaining + i) % len(base)], path)
                    for i in range(batch)
                ]
                self.in_executor(lambda p=path, m=messages: self._call_all(cost, p, m))
        return cost

    def _call_all(self, cost: Cost, path: Sequence[str], messages: Sequence[Any]) -> None:
        for message in messages:
            cost.calls += 1
            seconds = self._call(cost.heard, message)
            tries = 1
            while seconds > max(cost.seconds, 0.5 * cost.heard.budget) and tries < TRIES:
                tries += 1
                seconds = min(seconds, self._call(cost.heard, message))
            if seconds > cost.seconds:
                cost.seconds, cost.path = seconds, '.'.join(path)
                value = message
                for name in path:
                    value = value[0] if isinstance(value, list) and value else value
                    value = getattr(value, name, value)
                size = f'{len(value)} x ' if hasattr(value, '__len__') else ''
                cost.what = f'{size}{value!r:.40}'[:60]

    def _call(self, heard: Heard, message: Any) -> float:
        """Return the processor time of one call, seconds; what it awaits comes later."""
        spent = 0.0

        def note(seconds: float) -> None:
            nonlocal spent
            spent = max(spent, seconds)

        try:
            told = heard.ready(message)
        except Exception:  # no peer can send it
            return 0.0
        begun = time.thread_time()
        try:
            returned = heard.call(told)
        except Exception:  # it costs its message
            returned = None
        note(time.thread_time() - begun)
        if hasattr(returned, 'send'):

            async def rest() -> None:
                await _measured(returned, note)

            self._executor.create_task(rest())
        return spent
