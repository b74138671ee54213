"""Subscribed facts are the server's in the end, in whatever order things happen; without ROS.

Servers come, die and are two at once; each publishes as `ArmorServer` does, over a writer that
keeps its last message alone: an earlier one may be lost. Readers and writers learn of each other in
any order, answers are late or do not come, and the executor takes what is ready in any order.
"""

from __future__ import annotations

import contextlib
import random
from collections import deque
from collections.abc import Callable, Coroutine, Generator
from types import SimpleNamespace
from typing import Any

import pytest

from armor_service import changes
from armor_service.client import ArmorServiceCallError, ArmorServiceInternalError
from armor_service.facts import ShortFact, parse_fact
from owl_reasoner.notifier import Changes
from owl_reasoner.owl.axioms import ClassAssertion
from surveillance_interfaces.msg import FactChanges
from surveillance_ontology import armor_client
from surveillance_ontology.armor_client import FactSubscription
from surveillance_ontology.armor_server_node import ArmorServer

REFERENCES = ('map', 'other')
FACTS = [ShortFact(name, (of,)) for name in 'PPQ' for of in 'abcd']
Moves = list[Callable[[], object]]


class Server:
    """One armor server: its references, and its topic as far as the subscriber hears it."""

    _publish = ArmorServer._publish

    def __init__(self, world: World, facts: dict[str, dict[ShortFact, bool]]) -> None:
        self.random = world.random
        self.facts = {name: dict(found) for name, found in facts.items()}
        self.alive, self.reader_knows, self.writer_knows = True, False, False
        self.wire: deque[FactChanges] = deque()
        self.tasks: deque[Callable[[], object]] = deque()
        self._last: FactChanges | None = None
        self._feed = changes.ChangeFeed(lambda: self.tasks.append(self._publish))
        self._untold: list[changes.NumberedChange] = []
        self._publisher = self
        self._others = self._subscribers = self.random.randrange(2)
        self.health = SimpleNamespace(clear=lambda *_: None, error=lambda *_: None)

    def get_clock(self) -> Any:
        return SimpleNamespace(now=lambda: SimpleNamespace(to_msg=lambda: FactChanges().stamp))

    def publish(self, message: FactChanges) -> None:
        self._last = message
        if self.writer_knows:
            self._send(message)

    def _send(self, message: FactChanges) -> None:
        if self.wire and self.random.random() < 0.5:
            self.wire.pop()  # not acknowledged yet, and kept no more
        self.wire.append(message)

    def know_reader(self) -> None:
        self.writer_knows = True
        if self._last is not None:
            self._send(self._last)
        self.tasks.append(self._on_matched)

    def _on_matched(self) -> None:
        self._subscribers = self._others + 1
        self._publish()

    def load(self, name: str) -> None:
        if name not in self.facts:
            self.facts[name] = {}
            self._feed.note(name, None)

    def drop(self, name: str) -> None:
        if self.facts.pop(name, None) is not None:
            self._feed.note(name, None)

    def change(self, name: str, count: int) -> None:
        if (held := self.facts.get(name)) is None:
            return
        batches: tuple[list[Any], list[Any]] = [], []
        for fact in dict.fromkeys(self.random.choices(FACTS, k=count)):
            came = fact not in held
            derived = held.setdefault(fact, self.random.random() < 0.5)
            if not came:
                del held[fact]
            iris = (f'http://x#{name}' for name in (fact.predicate, *fact.arguments))
            batches[came].append((ClassAssertion(*iris), derived))
        gone, come = batches
        self._feed.note(name, Changes(1, tuple(come), tuple(gone), True))

    def answer(self, name: str, pattern: str) -> Any:
        if name not in self.facts:
            return ArmorServiceInternalError(f'unknown reference {name!r}', 205)
        found = [fact for fact in self.facts[name] if parse_fact(pattern).matches(fact)]
        return found, [fact for fact in found if not self.facts[name][fact]]


class Question:
    """A question under way: who may answer yet, what comes, and what came."""

    def __init__(self, servers: list[Server], name: str, pattern: str) -> None:
        self.servers, self.name, self.pattern = servers, name, pattern
        self.coming: list[Any] = []
        self.came: Any = None

    def __await__(self) -> Generator[Any, None, Any]:
        yield self
        if isinstance(self.came, Exception):
            raise self.came
        return self.came

    def ask(self, server: Server) -> None:
        self.servers.remove(server)
        self.coming.append(server.answer(self.name, self.pattern))

    def take(self, answer: Any) -> None:
        self.came = answer


class World:
    """A subscriber, its node, executor and client, and the servers there were."""

    def __init__(self, seed: int) -> None:
        self.random = random.Random(seed)
        self.servers: list[Server] = []
        self.kept: dict[str, dict[ShortFact, bool]] = {}
        self.events = 0
        self.reader: deque[FactChanges] = deque()
        self.tasks: deque[Coroutine[Any, Any, None]] = deque()
        self.waiting: list[tuple[Coroutine[Any, Any, None], Question]] = []
        self.retry = False
        self.told: set[ShortFact] = set()
        self.executor = SimpleNamespace(create_task=lambda ask: self.tasks.append(ask()))
        self.armor = SimpleNamespace(reference_name='map', query=SimpleNamespace())
        self.armor.query.facts_by_origin = self
        self.subscription = FactSubscription(self, self.armor, 'P(?)', self._on_fact)  # type: ignore[arg-type]

    def _on_fact(self, fact: ShortFact, came: bool) -> None:
        assert came != (fact in self.told), 'each is told once'
        (self.told.add if came else self.told.discard)(fact)

    # What it is to the subscription: node, timer, client.

    def get_logger(self) -> Any:
        return SimpleNamespace(debug=lambda _text: None)

    def create_timer(self, _period: float, callback: Any, clock: Any) -> Any:
        self.on_retry = callback
        return self

    def cancel(self) -> None:
        self.retry = False

    def reset(self) -> None:
        self.retry = True

    def create_subscription(
        self, _kind: Any, _topic: str, callback: Any, _qos: Any, event_callbacks: Any
    ) -> Any:
        self.on_message, self.on_matched = callback, event_callbacks.matched
        return SimpleNamespace(
            get_publisher_count=lambda: sum(each.reader_knows for each in self.servers)
        )

    async def call_async(self, pattern: str) -> Any:
        known = [each for each in self.servers if each.alive and each.reader_knows]
        if not known:
            raise ArmorServiceCallError('no server')
        return await Question(known, self.armor.reference_name, pattern)

    # What may happen.

    def play(self) -> None:
        busy = self.random.choice([0.1, 0.3, 0.6])
        for _ in range(self.random.randrange(10, 120)):
            moves = self._moves(failing=True)
            if not moves or self.random.random() < busy:
                self._disturb()
            else:
                self.random.choice(moves)()
        for server in self._alive()[1:]:
            self._kill(server)
        if not self._alive():
            self._start()
        while moves := self._moves(failing=False):
            self.random.choice(moves)()

    def facts(self) -> set[ShortFact]:
        (server,) = self._alive()
        held = server.facts.get(self.armor.reference_name, {})
        return {fact for fact in held if fact.predicate == 'P'}

    def _alive(self) -> list[Server]:
        return [each for each in self.servers if each.alive]

    def _disturb(self) -> None:
        alive, chance = self._alive(), self.random.random()
        if not alive or (chance < 0.04 and len(alive) < 2):
            self._start()
            return
        server, name = self.random.choice(alive), self.random.choice(REFERENCES)
        if chance < 0.1:
            self._kill(server)
        elif chance < 0.2:
            server.drop(name)
        elif chance < 0.4:
            server.load(name)
        elif chance < 0.42:
            self.armor.reference_name = name
            self.subscription.ask_anew()
        else:
            server.change(name, self.random.choice([1, 1, 2, 5]))

    def _start(self) -> None:
        self.servers.append(Server(self, self.random.choice([self.kept, {}])))

    def _kill(self, server: Server) -> None:
        if not server.reader_knows:
            self._know(server, True)
        server.alive, self.kept = False, server.facts

    def _know(self, server: Server, known: bool) -> None:
        server.reader_knows = known
        self.events += 1
        if not known:
            server.wire.clear()

    def _hear(self, server: Server) -> None:
        message = server.wire.popleft()
        if server.reader_knows:
            self.reader.append(message)

    def _match(self) -> None:
        self.events -= 1
        self.on_matched(None)

    def _run(self, task: Coroutine[Any, Any, None]) -> None:
        with contextlib.suppress(StopIteration):
            self.waiting.append((task, task.send(None)))

    def _go_on(self, task: Coroutine[Any, Any, None], question: Question) -> None:
        self.waiting.remove((task, question))
        self._run(task)

    def _moves(self, *, failing: bool) -> Moves:
        """Return what may come next; often drawn is what takes no time."""
        quick: Moves = []
        slow: Moves = []
        for each in self.servers:
            if each.alive and each.tasks:
                quick.append(lambda each=each: each.tasks.popleft()())
            if each.wire:
                quick.append(lambda each=each: self._hear(each))
            if each.alive != each.reader_knows:
                slow.append(lambda each=each: self._know(each, each.alive))
            if each.alive and not each.writer_knows:
                slow.append(each.know_reader)
        if self.events:
            quick.append(self._match)
        if self.reader:
            quick.append(lambda: self.on_message(self.reader.popleft()))
        if self.tasks:
            quick.append(lambda: self._run(self.tasks.popleft()))
        for task, question in self.waiting:
            if question.came is not None:
                quick.append(lambda task=task, question=question: self._go_on(task, question))
                continue
            able = [each for each in question.servers if each.alive]
            slow += [lambda each=each, question=question: question.ask(each) for each in able]
            if question.coming:
                slow.append(lambda question=question: question.take(question.coming.pop(0)))
            elif not able or (failing and self.random.random() < 0.05):
                lost = ArmorServiceCallError('no answer')
                slow.append(lambda question=question, lost=lost: question.take(lost))
        if self.retry:
            slow.append(self.on_retry)
        return 3 * quick + slow


def test_facts_are_those_of_the_server_once_all_is_quiet(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(changes, 'LARGE', 3)
    monkeypatch.setattr(armor_client, 'Clock', lambda **_: None)
    for seed in range(3200):
        world = World(seed)
        world.play()
        assert world.subscription.facts == world.facts() == world.told, seed
