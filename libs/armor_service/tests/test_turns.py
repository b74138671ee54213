"""Whose turn it is, without threads: the test does what is started, when it likes."""

from __future__ import annotations

from collections import deque
from collections.abc import Callable

from armor_service.turns import Backlog, Turns


def test_a_backlog_gives_each_client_its_turn() -> None:
    backlog: Backlog[str] = Backlog()
    for client, item in (('a', 'a1'), ('a', 'a2'), ('a', 'a3'), ('b', 'b1')):
        backlog.put(client, item)
    first = [backlog.take(), backlog.take()]
    backlog.put('b', 'b2')
    assert first + [backlog.take() for _ in range(len(backlog))] == ['a1', 'b1', 'a2', 'b2', 'a3']
    assert len(backlog) == 0


class Started:
    """What was started and waits to be done, on so many threads at a time."""

    def __init__(self, each: int = 1) -> None:
        self.waiting: deque[Callable[[], object]] = deque()
        self.done: list[str] = []
        self.turns = Turns(self.waiting.append, each)

    def put(self, name: str, client: str, text: str) -> None:
        self.turns.put(name, client, lambda: self.done.append(text))

    def do(self) -> None:
        self.waiting.popleft()()

    def do_all(self) -> list[str]:
        while self.waiting:
            self.do()
        return self.done


def test_work_on_one_ontology_is_done_in_turn_from_each_client() -> None:
    started = Started()
    for number in range(3):
        started.put('map', 'many', f'many{number}')
    started.put('map', 'one', 'one')
    assert len(started.waiting) == 1, 'one piece at a time'
    assert started.turns.waiting('map') == 4
    assert started.do_all() == ['many0', 'one', 'many1', 'many2']
    assert started.turns.waiting('map') == 0


def test_work_on_another_ontology_comes_before_the_rest_of_the_first() -> None:
    started = Started()
    for number in range(3):
        started.put('map', 'a', f'map{number}')
    started.put('other', 'b', 'other')
    assert started.do_all() == ['map0', 'other', 'map1', 'map2']


def test_no_more_is_done_at_a_time_than_allowed() -> None:
    started = Started(each=2)

    def nested() -> None:
        started.done.append('begin')
        started.put('map', 'c', 'later')
        assert len(started.waiting) == 1, 'this one runs, another may, a third waits'
        started.do()
        started.done.append('end')

    started.turns.put('map', 'a', nested)
    started.put('map', 'b', 'beside')
    started.do()
    assert started.do_all() == ['begin', 'beside', 'end', 'later']
    started.put('map', 'a', 'again')
    assert started.do_all()[-1] == 'again'
