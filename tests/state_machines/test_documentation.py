"""The documents' code runs as it stands, block after block, and the reference is current."""

from __future__ import annotations

import importlib.util
import re
from pathlib import Path

from rclpy.node import Node

from state_machines.ros import GoalServer
from surveillance_interfaces.action import Plan

DOCS = Path(__file__).resolve().parents[2] / 'docs'


def run_blocks(name, kind='tutorial'):
    """Run a document's blocks of a kind in one namespace; how many, and that."""
    document = DOCS / name
    text = document.read_text(encoding='utf-8')
    namespace: dict[str, object] = {'__name__': 'tutorial'}
    blocks = re.findall(rf'^```python {kind}\n(.*?)^```$', text, re.MULTILINE | re.DOTALL)
    for block in blocks:
        line = text[: text.index(block)].count('\n')
        # Blank lines in front, so that an error names the line in the document.
        code = compile('\n' * line + block, str(document), 'exec')
        exec(code, namespace)
    return len(blocks), namespace


def test_the_tutorial_runs():
    assert run_blocks('how-to/state_machine.md')[0] >= 10


def test_the_machine_that_came_from_yasmin_runs():
    assert run_blocks('how-to/from_yasmin.md')[0] == 1


class Plain(Node):
    """Nothing but rclpy's node; the test's graph calls `stop` before it destroys it."""

    def stop(self):
        pass


def test_the_machine_that_came_from_smach_runs_on_a_plain_node(graph):
    count, code = run_blocks('how-to/from_smach.md', 'ros')
    assert count == 1
    visited = []

    def go_to(goal, run):
        visited.append(goal.target)
        return Plan.Result()

    peer = graph.add(Plain, node_name='peer')
    GoalServer(peer, Plan, 'go_to', go_to)
    assert code['run'](graph.add(Plain, node_name='patrol'), seconds=0.01) == 'finished'
    assert visited == ['R1', 'R2']


def test_the_reference_is_current():
    maker = DOCS / 'makers' / 'fsm_reference.py'
    spec = importlib.util.spec_from_file_location('fsm_reference', maker)
    assert spec is not None
    script = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(script)
    current = (DOCS / 'reference' / 'state_machines.md').read_text(encoding='utf-8')
    assert script.page() == current, 'run docs/makers/fsm_reference.py'
