"""Two robots of the same names in one domain, by mistake: one is refused, the other one told."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import pytest
import rclpy
from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus, KeyValue
from rclpy.node import Node

from surveillance_runtime import duplicate_nodes
from surveillance_runtime.duplicate_nodes import DuplicateNodes, DuplicateNodeWatch, Launch
from surveillance_runtime.launch_protocol import AGE, LAUNCH, launch_of_process
from surveillance_runtime.node import PatrolNode

OLD, NEW = Launch('desk, process 7', 900.0), Launch('robot, process 8', 3.0)


def test_the_younger_launch_ends_and_of_two_that_began_together_one() -> None:
    assert NEW.yields_to(OLD)
    assert not OLD.yields_to(NEW)
    twin = Launch('robot2, process 8', 3.5)
    assert twin.yields_to(NEW) != NEW.yields_to(twin)


def test_one_that_was_killed_is_no_namesake() -> None:
    """The graph keeps it for a while, but it says nothing more."""
    heard = DuplicateNodes(OLD.name)
    for now in range(3):
        heard.hear('/armor_server', b'1', OLD, now)
        heard.hear('/armor_server', b'2', NEW, now)
        heard.hear('/robot2/armor_server', b'3', NEW, now)
    assert heard.launches(2.0) == {NEW: ['/armor_server']}
    heard.hear('/armor_server', b'1', OLD, 6.0)
    assert heard.launches(6.0) == {}


def test_one_message_says_nothing() -> None:
    heard = DuplicateNodes(OLD.name)
    heard.hear('/armor_server', b'1', OLD, 0.0)
    heard.hear('/armor_server', b'2', NEW, 0.0)
    assert heard.launches(0.1) == {}
    assert heard.launches(0.1, ['/armor_server']) == {}


def speaker(graph: Any, name: str, says: str, launch: Launch) -> None:
    """Have a node tell of its launch as each node does, under some name."""
    node = graph.add(PatrolNode, name=name)
    repeat(node, node.create_publisher(DiagnosticArray, '/diagnostics', 10), says, launch)


def repeat(node: PatrolNode, publisher: Any, says: str, launch: Launch) -> None:
    values = [KeyValue(key=LAUNCH, value=launch.name), KeyValue(key=AGE, value=str(launch.age))]
    said = [DiagnosticStatus(name=each, values=values) for each in says.split()]
    node.create_timer(0.05, lambda: publisher.publish(DiagnosticArray(status=said)))


@pytest.fixture
def stranger() -> Iterator[Node]:
    """Provide a node of another process; ask for it before the graph that publishes with it."""
    context = rclpy.Context()
    rclpy.init(args=[], context=context)
    node = Node('stranger', context=context)
    yield node
    node.destroy_node()
    rclpy.try_shutdown(context=context)


@pytest.fixture
def quick(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(duplicate_nodes, 'PERIOD', 0.1)


@pytest.mark.usefixtures('quick')
def test_the_younger_robot_ends_and_names_the_other(graph: Any) -> None:
    own, _ = launch_of_process()
    speaker(graph, 'armor_server', 'armor_server', Launch(own, 1.0))
    speaker(graph, 'armor_server', 'armor_server', OLD)
    watching = graph.add(PatrolNode, name='robot_behavior')
    DuplicateNodeWatch(watching)
    graph.until(lambda: watching.failure)
    assert watching.unusable
    assert 'started by desk, process 7 900 s ago: /armor_server; expected' in watching.failure


@pytest.mark.usefixtures('quick')
def test_the_older_robot_goes_on_and_tells(stranger: Node, graph: Any) -> None:
    own, _ = launch_of_process()
    speaker(graph, 'armor_server', 'armor_server', Launch(own, 5000.0))
    speaker(graph, 'armor_server', 'armor_server', OLD)
    # Somebody else who says that it is one of the robot's nodes is not believed.
    watching = graph.add(PatrolNode, name='robot_behavior')
    foreign = stranger.create_publisher(DiagnosticArray, '/diagnostics', 10)
    graph.until(lambda: watching.count_publishers('/diagnostics') >= 3)
    repeat(watching, foreign, 'armor_server', Launch('elsewhere, process 1', 9e9))
    DuplicateNodeWatch(watching)
    graph.until(watching.incidents.open)
    assert [str(each) for each in watching.incidents.open()] == ['robot desk, process 7']
    assert watching.failure is None


@pytest.mark.usefixtures('quick')
def test_one_message_speaks_for_all_nodes_of_a_process(graph: Any) -> None:
    own, _ = launch_of_process()
    speaker(graph, 'armor_server', 'armor_server planner_controller', Launch(own, 1.0))
    speaker(graph, 'planner_controller', 'planner_controller', OLD)
    watching = graph.add(PatrolNode, name='robot_behavior')
    DuplicateNodeWatch(watching)
    graph.until(lambda: watching.failure)
    assert '/planner_controller; expected' in watching.failure
