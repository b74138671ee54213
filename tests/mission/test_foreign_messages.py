"""The same seeds give the same mission, and what a stranger says once changes nothing of it."""

from __future__ import annotations

import importlib
import random
from pathlib import Path
from typing import Any

import pytest

from benchmarks.fuzz_nodes import Generator
from surveillance_runtime.node import PatrolNode
from surveillance_runtime.qos import STATE_QOS

from .robot import mission

NOT_OURS = ('/clock', '/parameter_events', '/rosout', '/diagnostics')
"""Simulated time is the whole domain's; a parameter event is what another node says of itself."""
COMMANDS = ('container_init', 'map/build_map', '_action/', 'stop_requested')
"""What is sent there is obeyed: that is what the topic is for."""
SECONDS = 110.0


def heard_topics(nodes: list[Any]) -> dict[str, Any]:
    """Return the topics that nodes listen to, with the class of their messages."""
    found: dict[str, Any] = {}
    for node in nodes:
        names = node.get_subscriber_names_and_types_by_node(node.get_name(), node.get_namespace())
        for topic, (kind, *_) in names:
            if topic not in NOT_OURS and not any(part in topic for part in COMMANDS):
                package, _, name = kind.split('/')
                found[topic] = getattr(importlib.import_module(f'{package}.msg'), name)
    return found


def say(graph: Any, topic: str, message: Any) -> None:
    """Publish one message from a node that leaves as soon as it was heard."""
    stranger = graph.add(PatrolNode, name='stranger')
    publisher = stranger.create_publisher(type(message), topic, STATE_QOS)
    graph.until(publisher.get_subscription_count)
    publisher.publish(message)
    publisher.wait_for_all_acked()
    graph.drop(stranger)


@pytest.mark.parametrize('behaviour', ['surveillance', 'patrol'])
def test_a_mission_decides_as_its_twin(
    graph: Any, monkeypatch: pytest.MonkeyPatch, tmp_path: Path, behaviour: str
) -> None:
    decisions = []
    for name in ('twin', 'disturbed'):
        again = type(graph)()
        try:
            with (
                monkeypatch.context() as patch,
                mission(again, patch, behaviour, tmp_path / name) as robot,
            ):
                robot.begin()
                robot.until(20.0)
                if name == 'disturbed':
                    disturb(again, [*robot.nodes.values()])
                robot.until(SECONDS)
                decisions.append(robot.decisions())
        finally:
            again.close()
    twin, disturbed = decisions
    fewest = min(len(twin), len(disturbed))
    assert fewest >= 6
    assert disturbed[:fewest] == twin[:fewest]


def disturb(graph: Any, nodes: list[Any]) -> None:
    """Say something plain and something strange on each topic that the nodes listen to."""
    generator = Generator(random.Random(7), 100)
    topics = heard_topics(nodes)
    assert {'/battery_level', '/battery_low', '/robot_place'} <= topics.keys()
    for topic, kind in sorted(topics.items()):
        for message in (kind(), generator.message(kind)):
            say(graph, topic, message)
