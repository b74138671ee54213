"""Kill the armor server again and again while clients write to it over ROS; count what is lost.

    python benchmarks/armor_kills.py [--kills N] [--seed S] [--quick]

In each round one client sends single directives, one sends lists, and one writes to a reference
whose manipulations are buffered, so that they wait in its queue. At a random moment the server gets
SIGKILL and is started again with the same store. What was answered must be there, in the queue what
waited there; a list that was not answered must be there as a whole or not at all; nothing may be
there that was not sent. At the end all rounds are looked at once more.

"Back after" is the time from the kill to the first answer. Beside it, in the same round: how long
`import rclpy` takes in a process of its own, as a measure of the machine.
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
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

ROOT = Path(__file__).resolve().parents[1]
sys.path.insert(0, str(ROOT))

from benchmarks.sizes import sized_parser

IRI = 'http://bnc/exp-rob-lab/2022-23'
ONTOLOGY = ROOT / 'surveillance_ontology' / 'surveillance_ontology' / 'data' / 'surveillance.owl'
LIST = 5
"""Directives in a list."""
LONGEST = 60.0
"""Seconds after which a server that is not back counts as lost."""


@dataclass
class Round:
    """What was sent in one round.

    Attributes:
        answered: Numbers that were answered, for each individual.
        unanswered: Numbers whose answer did not come, likewise.
    """

    answered: dict[str, set[int]] = field(default_factory=dict)
    unanswered: dict[str, set[int]] = field(default_factory=dict)

    def losses(self, individual: str, found: set[int]) -> tuple[int, int, int]:
        """Count what was answered and is not there, came in parts, or was never sent."""
        answered, open_ones = self.answered[individual], self.unanswered[individual]
        halves = 0
        if individual.startswith('list'):
            halves = int(0 < len(found & open_ones) < len(open_ones))
        return len(answered - found), halves, len(found - answered - open_ones)


class Campaign:
    """The clients and the server that they write to.

    Args:
        store: The server's store.
        generator: Chooses the moments.
    """

    def __init__(self, store: Path, generator: random.Random) -> None:
        from surveillance_ontology.armor_client import ArmorClient
        from surveillance_runtime.node import PatrolNode

        self._store = store
        self._generator = generator
        self.node = PatrolNode('kills')
        self.rounds: list[Round] = []
        self.directives = 0
        make = ArmorClient
        self.plain = make(self.node, 'plain', 'plain', timeout=LONGEST)
        self.lists = make(self.node, 'lists', 'plain', timeout=LONGEST)
        self.waiting = make(self.node, 'waiting', 'waiting', timeout=LONGEST)
        self.server = self._start()

    def _start(self) -> subprocess.Popen[bytes]:
        module = 'surveillance_ontology.armor_server_node'
        options = ['--ros-args', '-p', f'store:={self._store}', '--log-level', 'error']
        # Without its cache of compiled modules Python takes twice as long to start.
        environ = {k: v for k, v in os.environ.items() if k != 'PYTHONDONTWRITEBYTECODE'}
        return subprocess.Popen([sys.executable, '-m', module, *options], env=environ)

    def load(self) -> None:
        """Load the two references."""
        self.plain.utils.load_ref_from_file(str(ONTOLOGY), IRI, False, 'PELLET', True)
        self.waiting.utils.load_ref_from_file(str(ONTOLOGY), IRI, True, 'PELLET', True)

    def kill(self) -> float:
        """Write, kill, start again; return the seconds until the server answers."""
        number, this = len(self.rounds), Round()
        self.rounds.append(this)
        writers = [
            threading.Thread(target=self._write, args=(this, f'{kind}{number}', send))
            for kind, send in (
                ('single', self._single),
                ('list', self._list),
                ('queue', self._queued),
            )
        ]
        for writer in writers:
            writer.start()
        time.sleep(self._generator.uniform(0.0, 0.3))
        self.server.kill()
        begin = time.monotonic()
        self.server.wait()
        self.server = self._start()
        self.ask(lambda: self.plain.query.dataprop_b2_ind('n', f'single{number}'))
        taken = time.monotonic() - begin
        for writer in writers:
            writer.join()
        return taken

    def _write(self, this: Round, individual: str, send: Callable[[str, int], set[int]]) -> None:
        from surveillance_ontology.armor_client import ArmorServiceCallError

        answered = this.answered.setdefault(individual, set())
        this.unanswered[individual] = set()
        number = 0
        while True:
            sent = set(range(number, number + LIST))
            try:
                sent = send(individual, number)
            except ArmorServiceCallError:
                one = individual.startswith('list')
                this.unanswered[individual] = sent if one else {number}
                return
            answered |= sent
            number += len(sent)
            self.directives += len(sent)

    def _single(self, individual: str, number: int) -> set[int]:
        self.plain.manipulation.add_dataprop_to_ind('n', individual, 'LONG', str(number))
        return {number}

    def _queued(self, individual: str, number: int) -> set[int]:
        self.waiting.manipulation.add_dataprop_to_ind('n', individual, 'LONG', str(number))
        return {number}

    def _list(self, individual: str, number: int) -> set[int]:
        numbers = range(number, number + LIST)
        add = 'ADD DATAPROP IND'
        self.lists.batch(
            [self.lists.request(add, 'n', individual, 'LONG', str(n)) for n in numbers]
        )
        return set(numbers)

    def ask(self, question: Callable[[], list[str]]) -> set[int]:
        """Ask until the server answers; return the numbers in the answer."""
        from surveillance_ontology.armor_client import ArmorServiceCallError, value_in

        end = time.monotonic() + LONGEST
        while True:
            try:
                return {int(value_in(text)) for text in question()}
            except ArmorServiceCallError:
                if time.monotonic() > end:
                    raise

    def check(self, number: int, *, apply: bool) -> tuple[int, int, int]:
        """Compare a round with what the server has; sums as of `Round.losses`.

        Args:
            number: Which round.
            apply: Its queue waits still: nothing of it may be visible before APPLY.
        """
        this, sums = self.rounds[number], [0, 0, 0]
        for kind, client in (
            ('single', self.plain),
            ('list', self.plain),
            ('queue', self.waiting),
        ):
            individual = f'{kind}{number}'

            def values(client: Any = client, individual: str = individual) -> list[str]:
                found: list[str] = client.query.dataprop_b2_ind('n', individual)
                return found

            if apply and kind == 'queue':
                sums[2] += len(self.ask(values))
                self.waiting.utils.apply_buffered_changes()
            for place, count in enumerate(this.losses(individual, self.ask(values))):
                sums[place] += count
        return sums[0], sums[1], sums[2]


@contextmanager
def campaign(seed: int) -> Iterator[Campaign]:
    """Provide the clients on a domain of their own, and the server."""
    import rclpy

    from surveillance_runtime.discovery import prefer_quick_discovery
    from surveillance_runtime.process import ExecutorThread
    from surveillance_runtime.testing import claim_domain

    os.environ['ROS_DOMAIN_ID'] = str(claim_domain())
    prefer_quick_discovery()
    rclpy.init()
    spinner = ExecutorThread()
    with tempfile.TemporaryDirectory() as folder:
        made = Campaign(Path(folder), random.Random(seed))
        spinner.executor.add_node(made.node)
        spinner.start()
        try:
            yield made
        finally:
            made.server.kill()
            made.server.wait()
            spinner.stop()
            made.node.destroy_node()
            rclpy.try_shutdown()


def import_seconds() -> float:
    """Return how long a process takes that imports rclpy and does nothing else."""
    begin = time.monotonic()
    subprocess.run([sys.executable, '-c', 'import rclpy'], check=True)
    return time.monotonic() - begin


def main() -> None:
    """Run the rounds and print the table."""
    parser = sized_parser(__doc__, quick='8 kills')
    parser.add_argument('--kills', type=int, default=100)
    parser.add_argument('--seed', type=int, default=1)
    options = parser.parse_args()
    kills = options.size.of(options.kills, 8, 1)
    back: list[float] = []
    bare: list[float] = []
    sums = [0, 0, 0]
    with campaign(options.seed) as made:
        made.load()
        for number in range(kills):
            back.append(made.kill())
            for place, count in enumerate(made.check(number, apply=True)):
                sums[place] += count
            bare.append(import_seconds())
        for number in range(kills):
            for place, count in enumerate(made.check(number, apply=False)):
                sums[place] += count
        directives = made.directives
    lost, halves, invented = sums
    print(f'{kills} SIGKILLs, {directives} directives answered, seed {options.seed}')
    print(f'answered and lost                {lost:8}')
    print(f'lists that are there in parts    {halves:8}')
    print(f'there and never sent, or early   {invented:8}')
    middle, machine = statistics.median(back), statistics.median(bare)
    print(
        f'back after: median               {middle:8.2f} s  {middle / machine:.1f} x import rclpy'
    )
    print(f'back after: longest              {max(back):8.2f} s')
    print(f'import rclpy: median             {machine:8.2f} s')
    sys.exit(1 if any(sums) else 0)


if __name__ == '__main__':
    main()
