"""How long a directive takes: inside the server, through ROS, and with the durable store.

    python benchmarks/armor_calls.py [--quick]

Through ROS every call is measured beside a bare std_srvs/Trigger call to another process, in random
order in one loop, so that a busy machine slows all of them alike. A whole visit (what changes,
REASON, and what a decision asks, as one list) is measured at 7 and 10,000 places. The caller, the
armor server, the map builder (which subscribes to changes) and the Trigger server are processes of
their own.

Under load: 50 clients of one process send 20 requests each at once, and answers are counted; one
client asks while another process sends 1,000 malformed requests a second, or while a large ontology
is loaded and saved. Its calls are beside the same calls on an idle server. Large: 100,000 axioms.
"""

from __future__ import annotations

import os
import random
import statistics
import subprocess
import sys
import tempfile
import threading
import time
from collections.abc import Callable, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import Any, cast

ROOT = Path(__file__).resolve().parents[1]
sys.path.insert(0, str(ROOT))

from benchmarks.patrol_facts import IRI, SCHEMA, Patrol, schema
from benchmarks.sizes import Size, sized_parser
from owl_reasoner import write_ontology

PLACE = ROOT / 'config' / 'seven_rooms.yaml'
PLACES = (7, 10_000)
"""Sizes of the maps of which a whole visit is measured."""
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
FLOOD = """
import sys, time
import rclpy
from surveillance_interfaces.srv import ArmorDirective
from surveillance_runtime.node import PatrolNode
rclpy.init()
node = PatrolNode('flood')
client = node.create_client(ArmorDirective, 'armor_interface_srv')
client.wait_for_service()
request = ArmorDirective.Request()
request.armor_request.command = 'ADD'
request.armor_request.reference_name = 'surveillance'
request.armor_request.args = ['<no iri', '\\x00']
start = time.monotonic()
sent = 0
print('flooding', flush=True)
while True:
    while sent < (time.monotonic() - start) * 1000:
        client.remove_pending_request(client.call_async(request))
        sent += 1
    time.sleep(0.001)
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
    """Return the directives that are measured one by one."""
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
    """Return the service without ROS, without and with the store."""
    from armor_service.store.store import Store

    rows = _service_rows('in process', None, rounds)
    few = max(rounds // 10, 20)
    for label, synced in (('with store', False), ('with store, synced', True)):
        with tempfile.TemporaryDirectory() as directory:
            rows += _service_rows(label, Store(Path(directory), synced=synced), few)
    return rows


def _service_rows(label: str, store: Any, rounds: int) -> list[Row]:
    from armor_service.access import Settings
    from armor_service.client import ArmorClient, InProcessTransport
    from armor_service.service import ArmorService
    from floor_plans import read_place
    from surveillance_ontology.map_ontology import MapOntology
    from surveillance_ontology.patrol_vocabulary import DATA
    from surveillance_ontology.robot_ontology import RobotOntology

    service = ArmorService(Settings(), store=store)
    client = ArmorClient('benchmark', 'map', InProcessTransport(service))
    MapOntology(client).build(
        read_place(PLACE).place, str(DATA / 'surveillance.owl'), IRI, 2_000_000_000
    )
    ontology = RobotOntology(client)
    ontology.record_place('E', 2_000_000_000)
    corridors = f'SELECT ?x WHERE {{ ?x a <{IRI}#CORRIDOR> }}'
    calls: dict[str, Callable[[], Any]] = {
        'one visit (7 directives)': Visit(client),
        **single_calls(client),
    }
    taken = medians(calls, rounds)
    taken |= medians({'QUERY SPARQL, repeated': lambda: client.query.sparql(corridors)}, 50)
    service.close()
    return [(f'{name}, {label}', milliseconds, '') for name, milliseconds in taken.items()]


class MappedVisit:
    """A visit on a generated map (`benchmarks/patrol_facts.py`), as one list of directives."""

    def __init__(self, client: Any, places: int, folder: Path) -> None:
        self._client, self._patrol = client, Patrol(places)
        file = folder / f'{places}.nt'
        write_ontology([*schema(), *self._patrol.assertions()], IRI, file, 'ntriples')
        client.utils.load_ref_from_file(str(file), IRI, False, 'PELLET', True)

    def __call__(self) -> None:
        """Go to a neighbour, and ask what a decision asks."""
        ask, patrol = self._client.request, self._patrol
        _, come, _ = patrol.step()
        is_in, now, visited = cast(tuple[Any, Any, Any], come)
        seen, time_now = visited.literal.lexical, now.literal.lexical
        answer = self._client.batch(
            [
                ask('SET OBJECTPROP IND', 'isIn', 'Robot1', is_in.object),
                ask('SET DATAPROP IND', 'now', 'Robot1', 'LONG', time_now),
                ask('SET DATAPROP IND', 'visitedAt', visited.subject, 'LONG', seen),
                ask('REASON'),
                ask('QUERY OBJECTPROP IND', 'canReach', 'Robot1'),
                ask('QUERY IND CLASS', 'URGENT'),
                ask('QUERY IND CLASS', 'CORRIDOR'),
                ask('QUERY OBJECTPROP IND', 'isIn', 'Robot1'),
            ]
        )
        assert answer.success, answer
        assert len(answer.responses[4].queried_objects) == len(patrol.beyond[patrol.place])


@contextmanager
def servers(folder: Path) -> Any:
    """Provide the processes that answer; the armor server reads ontologies in a folder."""
    module = 'surveillance_ontology.'
    arguments = [
        [
            *('-m', module + 'armor_server_node', '--ros-args', '-p', 'store:=none'),
            *('-p', f'ontologies_folder:={folder}'),
        ],
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
    """Call over ROS, beside a bare service call."""
    import rclpy
    from std_srvs.srv import Trigger

    from state_machines.ros import ServiceCaller
    from surveillance_interfaces.srv import ReferenceName
    from surveillance_ontology.armor_client import ArmorClient
    from surveillance_runtime.node import PatrolNode
    from surveillance_runtime.process import ExecutorThread
    from surveillance_runtime.testing import claim_domain

    os.environ['ROS_DOMAIN_ID'] = str(claim_domain())
    with tempfile.TemporaryDirectory() as folder, servers(Path(folder)):
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
            maps = [
                ArmorClient(node, 'benchmark', f'{places} places', timeout=120.0)
                for places in PLACES
            ]
            batch = [client.request('QUERY IND CLASS', 'ROOM')] * 100
            calls: dict[str, Callable[[], Any]] = {
                'bare Trigger': lambda: bare.call(Trigger.Request(), 5.0),
                **single_calls(client),
                **{
                    f'one visit, {places} places': MappedVisit(mapped, places, Path(folder))
                    for places, mapped in zip(PLACES, maps, strict=True)
                },
            }
            taken = medians(calls, rounds)
            taken |= medians({'batch of 100 queries': lambda: client.batch(batch)}, 20)
        finally:
            spinner.stop()
            node.destroy_node()
            rclpy.try_shutdown()
    reference = taken['bare Trigger']
    return [(f'{name}, ROS', ms, f'{ms / reference:.2f} x Trigger') for name, ms in taken.items()]


def under_load(seconds: float, axioms: int) -> list[Row]:
    """Return a client beside others that ask much of the server."""
    import rclpy

    from surveillance_interfaces.srv import ArmorDirective
    from surveillance_ontology.armor_client import ArmorClient
    from surveillance_runtime.node import PatrolNode
    from surveillance_runtime.process import ExecutorThread
    from surveillance_runtime.testing import claim_domain

    os.environ['ROS_DOMAIN_ID'] = str(claim_domain())
    folder = tempfile.TemporaryDirectory()
    write_large(Path(folder.name) / 'large.nt', axioms)
    parameters = ['-p', 'store:=none', '-p', f'ontologies_folder:={folder.name}']
    module = 'surveillance_ontology.armor_server_node'
    server = subprocess.Popen(
        [sys.executable, '-m', module, '--ros-args', *parameters, '--log-level', 'error'],
        stderr=subprocess.DEVNULL,
    )
    rclpy.init()
    node = PatrolNode('benchmark')
    spinner = ExecutorThread()
    spinner.executor.add_node(node)
    spinner.start()
    found: list[Row] = []
    try:
        client = ArmorClient(node, 'benchmark', 'surveillance', timeout=60.0)
        client.utils.load_ref_from_file(str(SCHEMA), IRI)
        client.manipulation.add_ind_to_class('R1', 'ROOM')

        def ask() -> Any:
            return client.query.ind_b2_class('ROOM')

        idle = percentile(ask, seconds)
        found.append(('a query, idle server: p99, ROS', idle, ''))
        peers = [node.create_client(ArmorDirective, 'armor_interface_srv') for _ in range(50)]
        request = ArmorDirective.Request()
        for field, value in zip(
            FIELDS, ('b', 'surveillance', 'QUERY', 'IND', 'CLASS'), strict=True
        ):
            setattr(request.armor_request, field, value)
        request.armor_request.args = ['ROOM']
        for peer in peers:
            peer.wait_for_service()
        start = time.perf_counter()
        futures = [peer.call_async(request) for _ in range(20) for peer in peers]
        lost, last = len(futures), start
        # On a busy machine an answer may be late; one that does not come is lost.
        while lost and time.perf_counter() - last < 20:
            time.sleep(0.01)
            if (left := sum(not future.done() for future in futures)) < lost:
                lost, last = left, time.perf_counter()
        taken = (last - start) * 1e3
        found.append(('1,000 requests of 50 clients at once, ROS', taken, f'{lost} lost'))
        # Each client is told of every answer to any of them, and drops those of others.
        for peer in peers:
            spinner.executor.create_task(node.destroy_client, peer)
        client.batch([])
        flood = subprocess.Popen([sys.executable, '-c', FLOOD], stdout=subprocess.PIPE, text=True)
        assert flood.stdout is not None
        flood.stdout.readline()
        beside = percentile(ask, seconds)
        flood.kill()
        flood.wait()
        name = 'a query beside 1,000 malformed a second: p99'
        found.append((name, beside, f'{beside / idle:.1f} x idle'))
        other = ArmorClient(node, 'other', 'large', timeout=120.0)
        large = str(Path(folder.name) / 'large.nt')
        for what, work in {
            'LOAD': lambda: other.utils.load_ref_from_file(large, IRI),
            'SAVE': lambda: other.utils.save('saved.nt'),
            'a schema change': lambda: other.manipulation.add_class('NEW', 'C1'),
        }.items():
            busy = threading.Thread(target=work)
            busy.start()
            beside = percentile(ask, 60.0, busy.is_alive)
            busy.join()
            name = f'a query beside {what} of {axioms} axioms: p99'
            found.append((name, beside, f'{beside / idle:.1f} x idle'))
    finally:
        spinner.stop()
        node.destroy_node()
        rclpy.try_shutdown()
        server.kill()
        server.wait()
        folder.cleanup()
    return found


FIELDS = (
    'client_name',
    'reference_name',
    'command',
    'primary_command_spec',
    'secondary_command_spec',
)


def percentile(
    call: Callable[[], Any], seconds: float, go_on: Callable[[], bool] = lambda: True
) -> float:
    """Return the 99th percentile of a call's milliseconds, called every 2 ms."""
    taken = []
    end = time.perf_counter() + seconds
    while time.perf_counter() < end and go_on():
        start = time.perf_counter()
        call()
        taken.append(time.perf_counter() - start)
        time.sleep(0.002)
    return sorted(taken)[int(len(taken) * 0.99)] * 1e3


def write_large(path: Path, axioms: int) -> None:
    """Write an ontology of 200 classes and so many axioms."""
    rdf = 'http://www.w3.org/1999/02/22-rdf-syntax-ns#'
    xsd, owl = 'http://www.w3.org/2001/XMLSchema#', 'http://www.w3.org/2002/07/owl#'
    below = 'http://www.w3.org/2000/01/rdf-schema#subClassOf'
    with path.open('w') as file:
        file.write(f'<{IRI}#p> <{rdf}type> <{owl}ObjectProperty> .\n')
        file.write(f'<{IRI}#d> <{rdf}type> <{owl}DatatypeProperty> .\n')
        for c in range(1, 200):
            file.write(f'<{IRI}#C{c}> <{below}> <{IRI}#C{c // 3}> .\n')
        for i in range(axioms // 3):
            file.write(f'<{IRI}#i{i}> <{rdf}type> <{IRI}#C{i % 200}> .\n')
            file.write(f'<{IRI}#i{i}> <{IRI}#p> <{IRI}#i{i * 7 % (axioms // 3)}> .\n')
            file.write(f'<{IRI}#i{i}> <{IRI}#d> "{i}"^^<{xsd}long> .\n')


def large(axioms: int, rounds: int) -> list[Row]:
    """Call inside the server on a large ontology."""
    from armor_service import ArmorClient, ArmorService, InProcessTransport, Settings

    def resident() -> float:
        return int(Path('/proc/self/statm').read_text().split()[1]) * 4096 / 1e6

    found: list[Row] = []
    with tempfile.TemporaryDirectory() as folder:
        write_large(Path(folder) / 'large.nt', axioms)
        service = ArmorService(Settings(folder))
        client = ArmorClient('benchmark', 'large', InProcessTransport(service))
        change, numbers = client.manipulation, iter(range(10**6, 10**7))

        def once(call: Callable[[], Any]) -> float:
            start = time.perf_counter()
            call()
            return (time.perf_counter() - start) * 1e3

        def ask_after_change() -> None:
            number = next(numbers)
            change.replace_one_dataprop_b2_ind('d', 'i5', 'LONG', str(number))
            assert client.query.sparql(f'SELECT ?x {{ ?x <{IRI}#d> {number} }}')

        before = resident()
        found.append(
            (
                f'LOAD of {axioms} axioms',
                once(lambda: client.utils.load_ref_from_file('large.nt', IRI)),
                '',
            )
        )
        found.append(('first SPARQL', once(ask_after_change), ''))
        found += [
            (f'{name}, {axioms} axioms', ms, '')
            for name, ms in medians(
                {
                    'SPARQL after a change': ask_after_change,
                    'ADD CLASS': lambda: change.add_class(f'N{next(numbers)}'),
                    'RENAME IND': lambda: change.rename_ind(
                        f'i{next(numbers) - 10**6 + 10}', f'j{next(numbers)}'
                    ),
                },
                rounds,
            ).items()
        ]
        found += [
            (f'{name}, {axioms} axioms', ms, '')
            for name, ms in medians(
                {
                    'ADD CLASS CLASS': lambda: change.add_class(f'N{next(numbers)}', 'C1'),
                    'RENAME CLASS': lambda: change.rename_class('C100', 'D100'),
                },
                2,
            ).items()
        ]
        held = resident() - before
        client.utils.drop_ref()
        time.sleep(2.0)
        left = resident() - before
        found.append(('DROP', 0.0, f'{held:.0f} MB held before, {left:.0f} MB after'))
        service.close()
    return found


def rows(size: Size) -> list[Row]:
    """Return all rows of the table."""
    return [
        *inside(size.of(2000, 200, 5)),
        *through_ros(size.of(2000, 200, 5)),
        *under_load(size.of(20.0, 2.0, 0.2), size.of(100_000, 10_000, 1_000)),
        *large(size.of(100_000, 10_000, 1_000), size.of(20, 5, 1)),
    ]


def main() -> None:
    """Print the table."""
    options = sized_parser(__doc__, quick='fewer calls').parse_args()
    print(f'{"call (seven rooms)":48}{"median":>12}')
    for name, milliseconds, comparison in rows(options.size):
        print(f'{name:48}{milliseconds:9.3f} ms  {comparison}')


if __name__ == '__main__':
    main()
