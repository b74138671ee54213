"""What a node does with one period is done by one timer."""

from __future__ import annotations

from typing import Any

from surveillance_runtime.node import PatrolNode
from surveillance_runtime.periods import every


def test_one_timer_calls_all_and_one_that_fails_keeps_none_from_it(graph: Any) -> None:
    graph.may_fail = True
    node = graph.add(PatrolNode, name='node')
    before, called = len(list(node.timers)), []
    every(node, 0.05, lambda: 1 / 0)
    every(node, 0.05, lambda: called.append(True))
    assert len(list(node.timers)) == before + 1
    graph.until(lambda: len(called) >= 2)
