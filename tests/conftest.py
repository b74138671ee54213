"""Fixtures for all tests: an own ROS domain for each test process, and a graph of real nodes."""

from __future__ import annotations

import atexit
import contextlib
import copy
import gc
import os
import shutil
import sys
import tempfile
import threading
import time
import traceback
from collections.abc import Callable, Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any, TypeVar

import hypothesis
import pytest

from launcher.environment import keep_bytecode
from surveillance_runtime import incidents
from surveillance_runtime.discovery import launched_nodes
from surveillance_runtime.testing import claim_domain

T = TypeVar('T')

# Each run draws the same examples, and none fails because the machine is busy.
# `--hypothesis-profile explore` draws others.
hypothesis.settings.register_profile(
    'explore', deadline=None, suppress_health_check=[hypothesis.HealthCheck.too_slow]
)
hypothesis.settings.register_profile(
    'suite', hypothesis.settings.get_profile('explore'), derandomize=True
)
hypothesis.settings.load_profile('suite')

# What the imports leave is no garbage: looking for it costs a fourth of their time.
gc.disable()
# As `launch.py test` has it: otherwise each process of a run compiles all that it imports.
keep_bytecode(os.environ)
sys.dont_write_bytecode = bool(os.environ.get('PYTHONDONTWRITEBYTECODE'))
sys.pycache_prefix = os.environ.get('PYTHONPYCACHEPREFIX')
_domain = claim_domain()
os.environ['ROS_DOMAIN_ID'] = str(_domain)
# What a robot keeps for its next start is a test's own.
_STATE = Path(tempfile.mkdtemp(prefix='surveillance_state_'))
atexit.register(shutil.rmtree, _STATE, ignore_errors=True)
os.environ['XDG_STATE_HOME'] = str(_STATE)
_MEMORY = _STATE / 'memory'
_MEMORY.mkdir()
os.environ['XDG_RUNTIME_DIR'] = str(_MEMORY)
# Nor are its proxies: servers of a test are on this machine.
for _name in [name for name in os.environ if name.lower().endswith('_proxy')]:
    del os.environ[_name]
USER_ENVIRON = dict(os.environ)
"""What a user's shell gives to a command; tests of commands start them with it."""
# A test machine's neighbours are no part of a test.
os.environ |= launched_nodes(os.environ)


def pytest_configure(config: pytest.Config) -> None:
    """Have each of several processes import the test folders in an order of its own.

    In a new checkout nothing is compiled: what one process has compiled is there for the others.
    """
    own = Path(__file__).parent
    if not hasattr(config, 'workerinput') or config.args != config.getini('testpaths'):
        return
    folders = sorted({str(each.parent) for each in own.rglob('test_*.py')})
    number = int(config.workerinput['workerid'].removeprefix('gw'))
    first = number * len(folders) // config.workerinput['workercount']
    config.args[:] = folders[first:] + folders[:first]


def pytest_collection_modifyitems(config: pytest.Config, items: list[pytest.Item]) -> None:
    """Mark each test by what it needs: nothing (unit), ROS nodes (nodes), a whole mission.

    Several processes begin with the files that take longest, those that start processes or whole
    missions, then those that say so (`early`), and end at about the same time.
    """
    kinds = ('mission', 'nodes', 'unit')
    dearest: dict[Path, float] = {}
    for item in items:
        folder = item.path.relative_to(item.config.rootpath).parts[1]
        fixtures = set(getattr(item, 'fixturenames', ()))
        if folder == 'mission' or fixtures & MISSION_FIXTURES:
            kind = 0
        elif fixtures & NODE_FIXTURES:
            kind = 1
        else:
            kind = 2
        item.add_marker(kinds[kind])
        early = 0.5 if item.get_closest_marker('early') else 2.0
        dear = 0.0 if fixtures & PROCESS_FIXTURES else min(early, kind)
        dearest[item.path] = min(dear, dearest.get(item.path, dear))
    if hasattr(config, 'workerinput'):
        items.sort(key=lambda item: (dearest[item.path], item.path))


def pytest_collection_finish() -> None:
    """Keep modules and tests out of the garbage collector's way, and have it look less often.

    Most tests build a small world and drop it. The default interval costs some folders 6 %.
    """
    gc.freeze()
    gc.set_threshold(10_000)
    gc.enable()


NODE_FIXTURES = {'graph', 'ros_domain'}
"""Fixtures with ROS nodes in the test's own process."""
PROCESS_FIXTURES = {'start', 'terminal'}
"""Fixtures that start processes, which a test then waits for."""
MISSION_FIXTURES = {'robot', 'launch', 'started', 'mission', 'page', 'viewer'}
"""Fixtures with a whole mission, in this process or as `launch.py` starts it."""


@pytest.fixture(scope='session')
def ros_domain() -> int:
    """Provide the ROS domain of this test process, also in its environment."""
    return _domain


def destroy_half_made(error: BaseException) -> None:
    """Destroy each node whose constructor failed, which nobody else can.

    The error holds it, and pytest the error: its latched messages would reach the next tests.
    """
    from surveillance_runtime.node import PatrolNode

    for frame, _ in traceback.walk_tb(error.__traceback__):
        node = frame.f_locals.get('self')
        if isinstance(node, PatrolNode):
            with contextlib.suppress(AttributeError):  # it failed before it was a node
                PatrolNode.destroy_node(node)  # a kind's own expects all that it makes


class Graph:
    """Nodes of one test in a ROS context of their own, spun by one executor thread.

    Attributes:
        node: A plain node for scripted peers and clients.
        may_fail: Whether callbacks may raise, which costs their message.
    """

    def __init__(self) -> None:
        import rclpy

        from surveillance_runtime.node import PatrolNode
        from surveillance_runtime.process import ExecutorThread

        self.context = rclpy.Context()
        rclpy.init(context=self.context, domain_id=_domain)
        self._spinner = ExecutorThread(self.context)
        self._nodes: list[PatrolNode] = []
        self.may_fail = False
        self._changed = threading.Condition()
        self.node = self.add(PatrolNode, name='test')
        self._spinner.start()

    def add(
        self,
        kind: Callable[..., T],
        parameters: dict[str, Any] | None = None,
        namespace: str = '',
        **options: Any,
    ) -> T:
        """Create a node and spin it; `parameters` are its overrides, nested names dotted."""
        from rclpy.parameter import Parameter

        overrides = [Parameter(name, value=value) for name, value in (parameters or {}).items()]
        try:
            node = kind(
                **options,
                context=self.context,
                namespace=namespace,
                parameter_overrides=overrides,
                use_global_arguments=False,
            )
        except BaseException as error:
            destroy_half_made(error)
            raise
        self._nodes.append(node)  # type: ignore[arg-type]
        self._spinner.executor.add_node(node)
        return node

    def remove(self, node: Any) -> None:
        """Stop and destroy one node, as when its process ends."""
        node.stop()
        self.drop(node)

    def drop(self, node: Any) -> None:
        """Destroy one node without a goodbye, as when its process is killed."""
        self._spinner.executor.remove_node(node)
        self._nodes.remove(node)
        done = threading.Event()
        self._spinner.executor.create_task(lambda: (node.destroy_node(), done.set()))
        assert done.wait(240.0), 'executor does not spin'

    def until(self, predicate: Callable[[], Any], timeout: float = 240.0) -> Any:
        """Wait until the predicate holds; it is looked at whenever `touch` is called and often.

        Returns:
            What the predicate returned.
        """
        deadline = time.monotonic() + timeout
        with self._changed:
            while not (value := predicate()):
                remaining = deadline - time.monotonic()
                assert remaining > 0, f'not within {timeout} s'
                assert self.failure is None, repr(self.failure)
                self._changed.wait(min(remaining, 0.01))
        return value

    @property
    def failure(self) -> BaseException | None:
        """What a callback raised, unless the test wants callbacks to fail."""
        return self._spinner.error or (None if self.may_fail else self._spinner.lost)

    def touch(self) -> None:
        """Make `until` look at its predicate now."""
        with self._changed:
            self._changed.notify_all()

    def listen(self, msg_type: Any, topic: str, qos: Any = 10) -> list[Any]:
        """Subscribe; returns the list to which each message is appended, however late."""
        from rclpy.qos import QoSProfile

        kept = copy.copy(qos) if isinstance(qos, QoSProfile) else QoSProfile(depth=qos)
        kept.depth = 1000
        messages: list[Any] = []

        def arrived(message: Any) -> None:
            messages.append(message)
            self.touch()

        self.node.create_subscription(msg_type, topic, arrived, kept)
        return messages

    def said(self) -> list[str]:
        """Return the list to which each line that a node logs is appended.

        Waiting for a line of `capfd` may last for ever: what is printed while that reads is lost.
        A line that is said once, before the two have found each other, comes as well: rclpy keeps
        the lines of the last ten seconds for who comes late.
        """
        from rcl_interfaces.msg import Log

        from surveillance_runtime.qos import STATE_QOS

        lines: list[str] = []

        def arrived(line: Log) -> None:
            lines.append(line.msg)
            self.touch()

        kept = copy.copy(STATE_QOS)
        kept.depth = 1000
        self.node.create_subscription(Log, '/rosout', arrived, kept)
        return lines

    def close(self) -> None:
        """Stop all nodes while messages flow, then the executor, then ROS."""
        import rclpy

        for node in reversed(self._nodes):
            node.stop()
        self._spinner.stop()
        for node in reversed(self._nodes):
            node.destroy_node()
        rclpy.try_shutdown(context=self.context)
        if self.failure is not None:
            raise self.failure


@pytest.fixture(autouse=True)
def _released() -> Iterator[None]:
    """Let no robot of the next test be stopped by this one."""
    yield
    for kept in _STATE.glob('**/surveillance/stop_*.json'):
        kept.unlink()


@pytest.fixture
def incidents_at_once(monkeypatch: pytest.MonkeyPatch) -> None:
    """Have incidents begin and end without the delays of the table, which are real time."""
    kind = incidents.alarm_kind
    monkeypatch.setattr(
        incidents,
        'alarm_kind',
        lambda *cause: replace(kind(*cause), on_delay=0.0, off_delay=0.0),
    )


@pytest.fixture
def graph() -> Iterator[Graph]:
    """Provide a graph of real nodes; see `Graph`."""
    graph = Graph()
    yield graph
    graph.close()
