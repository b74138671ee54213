"""How long a directive takes: inside the server, through ROS, and with the durable store.

    python benchmarks/armor_calls.py [--quick]

Through ROS every call is measured beside a bare std_srvs/Trigger call to another process, in random
order in one loop, so that a busy machine slows all of them alike. The caller, the armor server, the
map builder (which subscribes to changes) and the Trigger server are processes of their own.
"""

from __future__ import annotations

import argparse
import os
import random
import statistics
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import Any

ROOT = Path(__file__).resolve().parents[1]
IRI = 'http://bnc/exp-rob-lab/2022-23'
PLACE = ROOT / 'config' / 'seven_rooms.yaml'
TRIGGER = """
from std_srvs.srv import Trigger
from surveillance_runtime.node import PatrolNode
from surveillance_runtime.process import run_node

class Bare(PatrolNode):
    def __init__(self, **options):
        super().__init__('bare', **options)
        self.create_service(Trigger, 'bare', lambda _request, response: response)

run_node(Bare)
"""
Row = tuple[str, float, str]
"""What was called, median milliseconds, and the comparison."""


def medians(calls: Mapping[str, Callable[[], Any]], rounds: int) -> dict[str, float]:
    """Median milliseconds of each call, taken in random order."""
    taken: dict[str, list[float]] = {name: [] for name in calls}
    names = list(calls)
    shuffle = random.Random(1).shuffle
    for _ in range(rounds):
        shuffle(names)
        for name in names:
            start = time.perf_counter()
            calls[name]()
            taken[name].append(time.perf_counter() - start)
    return {name: statistics.median(times) * 1e3 for name, times in taken.items()}


class Visit:
    """The directives of one visit: three replacements, REASON, and the decision's queries."""

    def __init__(self, client: Any) -> None:
        self._client = client
        self._time = 2_000_000_000
        for place in ('C1', 'E'):
            client.manipulation.replace_one_dataprop_b2_ind(
                'visitedAt', place, 'LONG', str(self._time)
            )
        client.manipulation.replace_one_dataprop_b2_ind('now', 'Robot1', 'LONG', str(self._time))
        client.manipulation.replace_one_objectprop_b2_ind('isIn', 'Robot1', 'E')
        client.utils.sync_buffered_reasoner()
        self._place, self._other = 'E', 'C1'
        self._visited = {'E': self._time, 'C1': self._time}

    def __call__(self) -> None:
        """Move between two places and choose the next."""
        change, ask = self._client.manipulation, self._client.query
        self._place, self._other = self._other, self._place
        new, now = str(self._time + 1), str(self._time)
        change.replace_objectprop_b2_ind('isIn', 'Robot1', self._place, self._other)
        old = str(self._visited[self._place])
        change.replace_dataprop_b2_ind('visitedAt', self._place, 'LONG', new, old)
        change.replace_dataprop_b2_ind('now', 'Robot1', 'LONG', new, now)
        self._client.utils.sync_buffered_reasoner()
        ask.objectprop_b2_ind('canReach', 'Robot1')
        ask.ind_b2_class('URGENT')
        ask.ind_b2_class('CORRIDOR')
        self._time += 1
        self._visited[self._place] = self._time


def single_calls(client: Any) -> dict[str, Callable[[], Any]]:
    """The directives that are measured one by one."""
    times = iter(range(2_100_000_000, 2_200_000_000))
    last = [str(next(times))]
    client.manipulation.replace_one_dataprop_b2_ind('visitedAt', 'R1', 'LONG', last[0])

    def replace() -> None:
        new = str(next(times))
        client.manipulation.replace_dataprop_b2_ind('visitedAt', 'R1', 'LONG', new, last[0])
        last[0] = new

    return {
        'QUERY OBJECTPROP IND': lambda: client.query.objectprop_b2_ind('canReach', 'Robot1'),
        'QUERY IND CLASS': lambda: client.query.ind_b2_class('CORRIDOR'),
        'REPLACE DATAPROP IND': replace,
        'REASON': lambda: client.utils.sync_buffered_reasoner(),
    }


def inside(rounds: int) -> list[Row]:
    """The service without ROS, without and with the store."""
    from surveillance_ontology.armor.store import Store

    rows = _service_rows('in process', None, rounds)
    with tempfile.TemporaryDirectory() as directory:
        rows += _service_rows('with store', Store(Path(directory)), max(rounds // 10, 20))
    return rows


def _service_rows(label: str, store: Any, rounds: int) -> list[Row]:
    from surveillance_ontology.armor.access import DATA
    from surveillance_ontology.armor.client import ArmorClient, InProcessTransport
    from surveillance_ontology.armor.service import ArmorService
    from surveillance_ontology.patrol_ontology import PatrolOntology
    from surveillance_runtime.place import read_place

    service = ArmorService(store=store)
    client = ArmorClient('benchmark', 'map', InProcessTransport(service))
    ontology = PatrolOntology(client)
    ontology.build(read_place(PLACE), str(DATA / 'surveillance.owl'), IRI, 2_000_000_000)
    ontology.record_place('E', 2_000_000_000)
    corridors = f'SELECT ?x WHERE {{ ?x a <{IRI}#CORRIDOR> }}'
    calls = {'one visit (7 directives)': Visit(client), **single_calls(client)}
    taken = medians(calls, rounds)
    taken |= medians({'QUERY SPARQL, repeated': lambda: client.query.sparql(corridors)}, 50)
    service.close()
    return [(f'{name}, {label}', milliseconds, '') for name, milliseconds in taken.items()]


@contextmanager
def servers() -> Any:
    """The processes that answer."""
    module = 'surveillance_ontology.'
    arguments = [
        ['-m', module + 'armor_server_node', '--ros-args', '-p', 'store:=none'],
        ['-m', module + 'ontology_map_builder_node', '--ros-args', '--params-file', str(PLACE)],
        ['-c', TRIGGER],
    ]
    quiet = subprocess.DEVNULL
    processes = [
        subprocess.Popen([sys.executable, *each], stdout=quiet, stderr=quiet) for each in arguments
    ]
    try:
        yield
    finally:
        for process in processes:
            process.terminate()
        for process in processes:
            process.wait(10)


def through_ros(rounds: int) -> list[Row]:
    """Calls over ROS, beside a bare service call."""
    import rclpy
    from std_srvs.srv import Trigger

    from surveillance_interfaces.srv import ReferenceName
    from surveillance_ontology.armor_client import ArmorClient
    from surveillance_runtime.calls import ServiceCaller
    from surveillance_runtime.node import PatrolNode
    from surveillance_runtime.process import ExecutorThread
    from surveillance_runtime.testing import claim_domain

    os.environ['ROS_DOMAIN_ID'] = str(claim_domain())
    with servers():
        rclpy.init()
        node = PatrolNode('benchmark')
        spinner = ExecutorThread()
        spinner.executor.add_node(node)
        spinner.start()
        try:
            names = ServiceCaller(node, ReferenceName, 'ontology_map/reference_name')
            client = ArmorClient(node, 'benchmark', names.call(ReferenceName.Request(), 30.0).name)
            bare = ServiceCaller(node, Trigger, 'bare')
            bare.call(Trigger.Request(), 30.0)
            batch = [client.request('QUERY IND CLASS', 'ROOM')] * 100
            calls: dict[str, Callable[[], Any]] = {
                'bare Trigger': lambda: bare.call(Trigger.Request(), 5.0),
                **single_calls(client),
            }
            taken = medians(calls, rounds)
            taken |= medians({'batch of 100 queries': lambda: client.batch(batch)}, 20)
        finally:
            spinner.stop()
            node.destroy_node()
            rclpy.try_shutdown()
    reference = taken['bare Trigger']
    return [(f'{name}, ROS', ms, f'{ms / reference:.2f} x Trigger') for name, ms in taken.items()]


def rows(quick: bool) -> list[Row]:
    """All rows of the table."""
    return [*inside(200 if quick else 2000), *through_ros(200 if quick else 2000)]


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument('--quick', action='store_true', help='fewer calls')
    options = parser.parse_args()
    print(f'{"call (seven rooms)":48}{"median":>12}')
    for name, milliseconds, comparison in rows(options.quick):
        print(f'{name:48}{milliseconds:9.3f} ms  {comparison}')


if __name__ == '__main__':
    main()
