"""What nodes say of their health on `/diagnostics`."""

from __future__ import annotations

import os
from collections.abc import Callable
from typing import Any, cast

import pytest

from surveillance_runtime import diagnostics
from surveillance_runtime.diagnostics import Heartbeat
from surveillance_runtime.health import ERROR, OK, WARN, Health
from surveillance_runtime.launch_protocol import HEARTBEAT

from .watched_nodes import Watched


def test_the_newest_word_on_a_subject_counts() -> None:
    health = Health()
    health.error('help', 'the door is closed')
    health.warn('help', 'trying')
    health.error('lidar', 'silent')
    assert health.findings() == [(WARN, 'trying'), (ERROR, 'silent')]
    health.clear('help')
    health.clear('never noted')
    assert health.findings() == [(ERROR, 'silent')]


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
