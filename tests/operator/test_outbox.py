"""What a sink does not take waits, in an order that no single one can hold up."""

from __future__ import annotations

import threading
import time
from pathlib import Path

import pytest

from surveillance_operator.notify.notification import Notification
from surveillance_operator.notify.outbox import DeliveryError, Outbox
from tests.operator.notify_peers import Clock, news


class Sink:
    def __init__(self) -> None:
        self.taken: list[str] = []
        self.problems: list[DeliveryError] = []

    def __call__(self, each: Notification) -> None:
        if self.problems:
            raise self.problems.pop(0)
        self.taken.append(each.key)


def test_what_fails_is_tried_again_at_growing_distances_in_order(tmp_path: Path) -> None:
    clock, sink, said = Clock(), Sink(), []
    sink.problems = [DeliveryError('no answer in time') for _ in range(5)]
    outbox = Outbox(tmp_path, {'a': sink}, said.append, clock)
    outbox.put(news('k1'))
    waits = []
    while (due := outbox.deliver_due('a')) is not None:
        waits.append(due - clock.now)
        clock.now = due
    assert waits == [1.0, 2.0, 4.0, 8.0, 16.0]
    outbox.put(news('k2'))
    outbox.deliver_due('a')
    assert sink.taken == ['k1', 'k2']
    assert said == ['a: no answer in time; it is tried again', 'a: works again']
    assert outbox.waiting() == {'a': 0}


def test_nothing_is_lost_or_told_twice_over_a_restart(tmp_path: Path) -> None:
    clock, away, there = Clock(), Sink(), Sink()
    away.problems = [DeliveryError('refused')] * 2
    first = Outbox(tmp_path, {'away': away, 'there': there}, now=clock)
    first.put(news('k1'))
    first.put(news('k2'))
    first.deliver_due('away')
    first.deliver_due('there')
    assert (away.taken, there.taken) == ([], ['k1', 'k2'])
    (tmp_path / 'away' / '0.json').write_text('{"cut o')  # a crash in the middle of writing
    again = Outbox(tmp_path, {'away': away, 'there': there}, now=clock)
    assert not again.put(news('k1'))
    assert again.put(news('k3'))
    again.deliver_due('away')
    again.deliver_due('there')
    assert (away.taken, there.taken) == (['k1', 'k2', 'k3'], ['k1', 'k2', 'k3'])


def test_one_sink_that_hangs_does_not_hold_up_another(tmp_path: Path) -> None:
    hang, told = threading.Event(), threading.Event()

    def slow(_: Notification) -> None:
        hang.wait(60.0)

    outbox = Outbox(tmp_path, {'slow': slow, 'quick': lambda _: told.set()})
    outbox.start()
    outbox.put(news(at=time.time()))
    assert told.wait(60.0)
    assert outbox.waiting()['slow'] == 1
    hang.set()
    outbox.close()


def test_what_cannot_be_delivered_is_dropped_with_a_line_and_the_queue_is_bounded(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr('surveillance_operator.notify.outbox.MOST_WAITING', 3)
    clock, sink, said = Clock(), Sink(), []
    sink.problems = [DeliveryError('answered 400', final=True)]
    outbox = Outbox(tmp_path, {'a': sink}, said.append, clock)
    for number in range(5):
        outbox.put(news(f'k{number}'))
    outbox.deliver_due('a')
    assert sink.taken == ['k3', 'k4']
    assert said[-1] == 'a: answered 400; not told: 3: door D1 is ajar in C1'
    sink.problems = [DeliveryError('away')] * 2
    outbox.put(news('old'))
    outbox.deliver_due('a')
    clock.now += 2 * 86400.0
    outbox.deliver_due('a')
    assert said[-1].startswith('a: away; not told')


def test_what_a_sink_can_never_take_is_put_aside_and_the_others_go_out(tmp_path: Path) -> None:
    taken: list[str] = []

    def deliver(sent: Notification) -> None:
        if sent.key == 'poison':
            raise UnicodeEncodeError('utf-8', sent.text, 0, 1, 'surrogates not allowed')
        taken.append(sent.key)

    said, troubles, clock = [], [], Clock()
    outbox = Outbox(
        tmp_path, {'a': deliver}, said.append, clock, lambda *each: troubles.append(each)
    )
    outbox.put(news('poison'))
    outbox.put(news('good'))
    assert outbox.deliver_due('a') is None
    assert taken == ['good']
    (first, second) = troubles
    assert first[0] == 'a'
    assert first[1].endswith('; not told: 3: door D1 is ajar in C1')
    assert second == ('a', ''), 'the sink works'


def test_what_a_sink_does_not_take_now_lets_the_next_one_pass(tmp_path: Path) -> None:
    taken: list[str] = []
    refused = {'first'}

    def deliver(sent: Notification) -> None:
        if sent.key in refused:
            raise DeliveryError('answered 451')
        taken.append(sent.key)

    clock = Clock()
    outbox = Outbox(tmp_path, {'a': deliver}, now=clock)
    for key in ('first', 'second', 'third'):
        outbox.put(news(key))
    assert outbox.deliver_due('a') == clock.now + 1.0
    assert taken == ['second', 'third']
    refused.clear()
    clock.now += 1.0
    outbox.deliver_due('a')
    assert taken == ['second', 'third', 'first']


def test_a_sink_that_is_away_is_not_tried_for_each_and_told_of_after_a_while(
    tmp_path: Path,
) -> None:
    tries: list[str] = []

    def deliver(sent: Notification) -> None:
        tries.append(sent.key)
        raise DeliveryError('no answer in time')

    clock, troubles = Clock(), []
    outbox = Outbox(
        tmp_path, {'a': deliver}, now=clock, trouble=lambda *each: troubles.append(each)
    )
    for number in range(100):
        outbox.put(news(f'k{number}', at=clock.now))
    due = outbox.deliver_due('a')
    assert len(tries) == 2
    while due is not None and not troubles:
        clock.now = due
        due = outbox.deliver_due('a')
    assert len(tries) < 20
    assert troubles[0][1].startswith('no answer in time for ')


def test_what_an_ended_run_could_not_hand_over_the_next_one_does(tmp_path: Path) -> None:
    """A person calls an alarm false, and the run ends before the sink has answered."""
    clock, away, there = Clock(), Sink(), Sink()
    away.problems = [DeliveryError('no answer in time')]
    ended = Outbox(tmp_path / 'one', {'a': away}, now=clock)
    ended.put(news('all clear', at=clock.now))
    ended.deliver_due('a')
    running = Outbox(tmp_path / 'two', {'a': away}, now=clock)
    running.put(news('still sent by its own run', at=clock.now))
    ended.close(0.0)
    following = Outbox(tmp_path / 'three', {'a': there, 'b': Sink()}, now=clock)
    for folder in ('one', 'two', 'three', 'missing'):
        following.take_over(tmp_path / folder, clock.now - 60.0)
    following.deliver_due('a')
    assert there.taken == ['all clear']
    assert not list((tmp_path / 'one' / 'a').iterdir())
    running.close(0.0)
    later = Outbox(tmp_path / 'four', {'a': there}, now=clock)
    later.take_over(tmp_path / 'two', clock.now + 1.0)
    assert later.waiting() == {'a': 0}, 'nobody is told of what is too old'
    following.close(0.0)
    later.close(0.0)
