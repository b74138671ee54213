"""What nodes say of their health on `/diagnostics`."""

from __future__ import annotations

import os
from collections.abc import Callable, Iterator
from typing import Any, cast

import pytest
from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus

from surveillance_runtime import diagnostics
from surveillance_runtime.diagnostics import DiagnosticsThread, Heartbeat
from surveillance_runtime.health import ERROR, OK, WARN, Health
from surveillance_runtime.launch_protocol import HEARTBEAT, LAUNCH, RESTARTS
from surveillance_runtime.node import PatrolNode, report_exception


class Plain(PatrolNode):
    def __init__(self, **options: Any) -> None:
        super().__init__('plain', **options)


class Watched:
    """A node whose health is published often, and what came of it."""

    def __init__(self, graph: Any, namespace: str = '') -> None:
        self.late = 0.0
        self.heard = graph.listen(DiagnosticArray, '/diagnostics')
        self.node = graph.add(Plain, namespace=namespace)
        self.thread = DiagnosticsThread([self.node], lambda: self.late)
        self._graph = graph

    def until(self, level: bytes) -> DiagnosticStatus:
        """Wait for a status of a level."""
        del self.heard[:]
        found = self._graph.until(
            lambda: [each for m in list(self.heard) for each in m.status if each.level == level]
        )
        return found[-1]


@pytest.fixture
def watched(graph: Any, monkeypatch: pytest.MonkeyPatch) -> Iterator[Watched]:
    monkeypatch.setattr(diagnostics, 'PERIOD', 0.05)
    monkeypatch.setattr(diagnostics, 'RECENT', 0.3)
    monkeypatch.setenv(RESTARTS, '2')
    made = Watched(graph)
    yield made
    made.thread.stop()


def test_the_newest_word_on_a_subject_counts() -> None:
    health = Health()
    health.error('help', 'the door is closed')
    health.warn('help', 'trying')
    health.error('lidar', 'silent')
    assert health.findings() == [(WARN, 'trying'), (ERROR, 'silent')]
    health.clear('help')
    health.clear('never noted')
    assert health.findings() == [(ERROR, 'silent')]


def test_a_node_reports_itself_and_what_it_uses(watched: Watched) -> None:
    assert 'started again' in watched.until(WARN).message
    status = watched.until(OK)
    assert (status.name, status.hardware_id, status.message) == (
        'plain',
        'surveillance_robot',
        'up',
    )
    values = {each.key: float(each.value) for each in status.values if each.key != LAUNCH}
    assert values['restarts'] == 2
    assert values['memory_mb'] > 10
    assert values['descriptors'] > 3
    assert values['threads'] > 1


def test_a_node_that_needs_somebody_is_an_error_until_it_goes_on(watched: Watched) -> None:
    watched.until(OK)
    watched.node.health.warn('path', 'a door is closed')
    watched.node.health.error('help', 'waiting for help: no way out')
    assert watched.until(ERROR).message == 'waiting for help: no way out; a door is closed'
    watched.node.health.clear('help')
    assert watched.until(WARN).message == 'a door is closed'


def test_a_lost_message_is_a_warning_for_a_while(watched: Watched) -> None:
    watched.until(OK)
    report_exception(ValueError('no\nnumber'), watched.node, 'callback')
    assert watched.until(WARN).message == 'a message was lost: callback: ValueError: no\\nnumber'
    values = {each.key: each.value for each in watched.until(OK).values}
    assert values['lost_messages'] == '1'


def test_an_executor_that_hangs_is_an_error(watched: Watched) -> None:
    watched.late = 4.0
    assert watched.until(ERROR).message.startswith('callbacks wait for 4.0 s')


def test_the_last_word_of_a_node_that_failed_is_why(watched: Watched) -> None:
    watched.until(OK)
    watched.node.fail('no lidar')
    watched.thread.stop()
    assert watched.until(ERROR).message == 'no lidar'


def test_a_second_robot_has_names_of_its_own(graph: Any, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(diagnostics, 'PERIOD', 0.05)
    second = Watched(graph, namespace='/robot2')
    status = second.until(OK)
    second.thread.stop()
    assert (status.name, status.hardware_id) == ('robot2/plain', 'robot2')


class BeatenByHand:
    """Stands in for the node whose timer beats."""

    def create_timer(self, _period: float, callback: Callable[[], None], **_options: Any) -> None:
        self.beat = callback


def test_a_process_that_did_not_run_for_long_says_that_it_slept(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """An executor that alone was late for as long did not sleep: DDS went on beside it."""
    reader, writer = os.pipe()
    monkeypatch.setenv(HEARTBEAT, str(writer))
    now, node = 0.0, BeatenByHand()
    heartbeat = Heartbeat(cast(Any, [node]), lambda: now)
    while now < 2 * diagnostics.SLEPT_AFTER:
        now += diagnostics.PERIOD
        heartbeat.take_lateness()
    node.beat()
    assert os.read(reader, 9) == b'.'
    now += 1.0 + diagnostics.SLEPT_AFTER
    heartbeat.take_lateness()
    heartbeat.take_lateness()
    node.beat()
    assert os.read(reader, 9) == b'S.'
    os.close(reader)
