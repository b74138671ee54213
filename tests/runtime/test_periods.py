"""What a node does with one period is done by one timer."""

from __future__ import annotations

import gc
import weakref
from typing import Any

import pytest

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


def test_what_a_node_does_periodically_does_not_keep_a_node_that_was_destroyed(graph: Any) -> None:
    node = PatrolNode('gone', context=graph.node.context)
    every(node, 5.0, node.get_name)
    node.destroy_node()
    gone = weakref.ref(node)
    del node
    gc.collect()
    assert gone() is None


def test_a_timer_may_fire_as_soon_as_it_is_made(
    graph: Any, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The node may be spun by another thread than the one that asks for the calls."""
    node = graph.add(PatrolNode, name='node')
    make = node.create_timer

    def fires(*words: Any, **named: Any) -> Any:
        timer = make(*words, **named)
        timer.callback()
        return timer

    monkeypatch.setattr(node, 'create_timer', fires)
    every(node, 0.05, lambda: None)
