"""What a stranger says costs a callback little, whatever it is; and the next Stop is heard."""

from __future__ import annotations

import math
import random
import threading
from pathlib import Path
from typing import Any

import pytest
from geometry_msgs.msg import PoseWithCovarianceStamped
from std_srvs.srv import SetBool

from benchmarks.callback_budget import Draws, Prober, fields_of, heard_by
from benchmarks.whole_stack import ROOT, Stack
from state_machines.ros import ServiceCaller
from surveillance_interfaces.msg import OntologyMap, StopRequest
from surveillance_runtime.node import PatrolNode

PATIENCE = 30.0
"""How many times its budget a callback may take here: processor time, but of any machine."""
NAMES = 25
"""How many topics, services and actions are tried in a run; all of them by
`benchmarks/faults.py --only callbacks`."""


def test_whatever_is_said_the_next_stop_is_heard(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    seed = random.randrange(10**6)
    print('seed', seed)
    chance = random.Random(seed)
    stack = Stack(ROOT / 'config' / 'seven_rooms.yaml')
    try:
        heard = [each for node in stack.nodes.values() for each in heard_by(node)]
        assert len(heard) > NAMES
        scans = next(each for each in heard if each.name == '/scan')
        arrived = threading.Event()
        scans.on_honest = arrived.set
        stack.start()
        assert arrived.wait(60.0)
        stop = ServiceCaller(stack.observer, SetBool, 'stop')
        prober = Prober(stack._spinner.executor, Draws(chance, 20_000))
        for each in chance.sample(heard, NAMES):
            cost = prober.probe(each, 1)
            said = f'{each.node} {each.name}: {cost.path} = {cost.what}: {cost.seconds:.3f} s'
            assert cost.seconds < PATIENCE * each.budget, said
        answer = stop.call(SetBool.Request(data=True), 60.0)
        assert answer.success, answer.message
        assert stack.error is None
    finally:
        stack.close()


def test_a_new_handler_is_found(graph: Any) -> None:
    node = graph.add(PatrolNode, name='new')
    node.create_subscription(OntologyMap, 'places', lambda _message: None, 10)
    node.create_service(SetBool, 'switch', lambda _request, response: response)
    names = {each.name for each in heard_by(node)}
    assert {'/places', 'switch'} <= names


def test_a_callback_that_costs_too_much_is_told(graph: Any) -> None:
    node = graph.add(PatrolNode, name='slow')

    def work(message: StopRequest) -> None:
        sum(range(5_000_000 if message.owner else 1))

    node.create_subscription(StopRequest, 'slow', work, 10)
    slow = next(each for each in heard_by(node) if each.name == '/slow')
    prober = Prober(graph._spinner.executor, Draws(random.Random(1), 10))
    assert not prober.probe(slow, 3, [('reason',)]).broken
    cost = prober.probe(slow, 3, [('owner',)])
    assert cost.broken
    assert cost.path == 'owner'


def test_every_field_is_drawn_and_kept_in_its_type() -> None:
    draws = Draws(random.Random(3), 1000)
    paths = [*fields_of(PoseWithCovarianceStamped)]
    assert ('pose', 'pose', 'position', 'x') in paths
    assert ('header', 'stamp', 'nanosec') in paths
    seen = set()
    base = PoseWithCovarianceStamped()
    for path in paths:
        for _ in range(50):
            changed = draws.changed(base, path)
            assert isinstance(changed, PoseWithCovarianceStamped)
            if path == ('pose', 'pose', 'position', 'x'):
                seen.add(changed.pose.pose.position.x)
    assert base == PoseWithCovarianceStamped(), 'the honest message stays'
    sizes = [math.log10(abs(each)) for each in seen if math.isfinite(each) and each]
    assert min(sizes) < -100 < 100 < max(sizes)
    assert any(math.isinf(each) or math.isnan(each) for each in seen)
    lengths = {len(draws.changed(OntologyMap(), ('places',)).places) for _ in range(100)}
    assert {0, 1} <= lengths
    assert max(lengths) > 100
