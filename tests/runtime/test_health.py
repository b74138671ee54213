"""What a node says of itself."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import pytest

from surveillance_runtime import diagnostics
from surveillance_runtime.health import ERROR, OK, WARN
from surveillance_runtime.launch_protocol import LAUNCH, RESTARTS
from surveillance_runtime.node import report_exception

from .watched_nodes import Watched


@pytest.fixture
def watched(graph: Any, monkeypatch: pytest.MonkeyPatch) -> Iterator[Watched]:
    monkeypatch.setattr(diagnostics, 'PERIOD', 0.05)
    monkeypatch.setattr(diagnostics, 'RECENT', 0.3)
    monkeypatch.setenv(RESTARTS, '2')
    made = Watched(graph)
    yield made
    made.thread.stop()


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
