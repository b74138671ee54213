"""Kill the directive service, fill its disk and hold its file while owlready2 programs write to it.

    python benchmarks/armor_worlds.py [--kills N] [--full N] [--seed S] [--quick] [--smoke]

Three programs of owlready2 open the World of a running service, add values and save, at once or
late. Meanwhile clients send directives and lists of directives. In each round the service gets
SIGKILL at a random moment; in some of them it may write no further byte to any file for a while
before. Started again, it must have what it answered and what the others saved, a list as a whole
or not at all, and nothing that nobody wrote. No ROS takes part: `armor_kills.py` kills over it.
"""

from __future__ import annotations

import json
import os
import random
import resource
import signal
import statistics
import subprocess
import sys
import tempfile
import threading
import time
from concurrent.futures import ThreadPoolExecutor
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
WRITER = f"""
import random, sys, time
import owlready2
world = owlready2.World(filename=sys.argv[1], exclusive=False)
world.save()
onto = world.get_ontology({IRI!r})
name, number = sys.argv[2], 0
draw = random.Random(name)
while True:
    try:
        with onto:
            onto.DOOR(f'{{name}}_{{number}}')
        if draw.random() < 0.2:
            time.sleep(draw.uniform(0.0, 0.4))
        world.save()
    except Exception as error:
        if 'locked' not in str(error):
            raise
        world.graph.db.rollback()
        continue
    print(number, flush=True)
    number += 1
    time.sleep(draw.uniform(0.0, 0.1))
"""


def serve(folder: Path) -> None:
    """Answer directives that come as lines, several at a time."""
    from armor_service.access import Settings
    from armor_service.protocol import DirectiveRequest
    from armor_service.service import ArmorService
    from armor_service.store.store import Store

    told = (folder / 'told.txt').open('a', buffering=1)

    def warn(text: str) -> None:
        told.write(f'{text}\n')

    service = ArmorService(Settings(folder / 'files'), print, warn, Store(folder / 'store'))
    lock = threading.Lock()

    def answer(line: str) -> None:
        number: int
        rows: list[list[str]]
        number, rows = json.loads(line)
        if rows and rows[0][0] == 'LIMIT':
            limits = resource.getrlimit(resource.RLIMIT_FSIZE)
            soft = int(rows[0][1]) if int(rows[0][1]) >= 0 else limits[1]
            resource.setrlimit(resource.RLIMIT_FSIZE, (soft, limits[1]))
            success, texts = True, []
        else:
            requests = []
            for words, *args in rows:
                command, primary, secondary, *_ = (*words.split(), '', '', '')
                requests.append(
                    DirectiveRequest('c', 'map', command, primary, secondary, tuple(args))
                )
            if len(requests) == 1:
                one = service.execute(requests[0])
                success, texts = one.success, one.queried_objects
            else:
                success, texts = service.execute_list(requests).success, []
        with lock:
            print(json.dumps([number, success, texts]), flush=True)

    with ThreadPoolExecutor(4) as pool:
        for line in sys.stdin:
            pool.submit(answer, line)


class Client:
    """Sends directives to a service in another process; several threads may."""

    def __init__(self, folder: Path) -> None:
        self.process = subprocess.Popen(
            [sys.executable, __file__, '--serve', str(folder)],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            text=True,
        )
        self._lock = threading.Lock()
        self._answers: dict[int, tuple[threading.Event, list[Any]]] = {}
        self._number = 0
        threading.Thread(target=self._read, daemon=True).start()

    def _read(self) -> None:
        assert self.process.stdout is not None
        for line in self.process.stdout:
            number, success, texts = json.loads(line)
            event, slot = self._answers[number]
            slot += [success, texts]
            event.set()
        for event, _ in list(self._answers.values()):
            event.set()

    def send(self, *rows: tuple[str, ...]) -> list[str] | None:
        """Return the texts of the answer; None: there was none."""
        event, slot = threading.Event(), list[Any]()
        with self._lock:
            self._number += 1
            self._answers[self._number] = event, slot
            try:
                assert self.process.stdin is not None
                self.process.stdin.write(f'{json.dumps([self._number, rows])}\n')
                self.process.stdin.flush()
            except (BrokenPipeError, ValueError):
                return None
        if self.process.poll() is not None:
            event.wait(1.0)
        else:
            while not event.wait(0.5) and self.process.poll() is None:
                pass
        if not slot:
            return None
        if not slot[0]:
            raise RuntimeError(f'refused: {rows}')
        return list(slot[1])

    def kill(self) -> None:
        """End the process at once."""
        self.process.send_signal(signal.SIGKILL)
        self.process.wait()


@dataclass
class Foreign:
    """A program of owlready2 that writes, and what it saved."""

    name: str
    process: subprocess.Popen[str]
    saved: set[int] = field(default_factory=set)

    def read(self) -> None:
        assert self.process.stdout is not None
        for line in self.process.stdout:
            self.saved.add(int(line))


class Campaign:
    """The service, who writes to it, and what was answered."""

    def __init__(self, folder: Path, seed: int) -> None:
        self.folder = folder
        self.draw = random.Random(seed)
        self.answered: set[str] = set()
        self.unanswered: set[str] = set()
        self.lists: list[set[str]] = []
        self.back: list[float] = []
        self.foreign: list[Foreign] = []
        (folder / 'files').mkdir()
        self.client = Client(folder)
        self.client.send(('LOAD FILE', str(ONTOLOGY), IRI, 'false', 'PELLET', 'true'))

    def start_writers(self) -> None:
        """Start the programs of owlready2."""
        path = self.folder / 'store' / 'worlds' / 'map.sqlite3'
        for name in 'abc':
            process = subprocess.Popen(
                [sys.executable, '-c', WRITER, str(path), name], stdout=subprocess.PIPE, text=True
            )
            foreign = Foreign(name, process)
            self.foreign.append(foreign)
            threading.Thread(target=foreign.read, daemon=True).start()

    def round(self, number: int, *, full: bool) -> None:
        """Write, perhaps without space, kill, start again, and ask."""
        client = self.client
        writers = [
            threading.Thread(target=self._write, args=(client, f'{kind}{number}', size))
            for kind, size in (('single', 1), ('list', LIST))
        ]
        for writer in writers:
            writer.start()
        time.sleep(self.draw.uniform(0.0, 0.3))
        if full:
            # No file may grow beyond it: neither the World and its log nor, often, the spill.
            log = next((self.folder / 'store' / 'worlds').glob('*-wal'), None)
            beyond = log.stat().st_size if log and self.draw.random() < 0.5 else 0
            client.send(('LIMIT', str(beyond + self.draw.randrange(8192))))
            time.sleep(self.draw.uniform(0.05, 0.3))
            client.send(('LIMIT', '-1'))
            # What waited in memory alone is written as soon as that is possible.
            time.sleep(0.5)
        client.kill()
        for writer in writers:
            writer.join()
        begin = time.monotonic()
        self.client = Client(self.folder)
        self.client.send(('QUERY IND CLASS', 'DOOR'))
        self.back.append(time.monotonic() - begin)

    def _write(self, client: Client, name: str, size: int) -> None:
        number = 0
        while True:
            sent = {f'{name}_{number + each}' for each in range(size)}
            if size > 1:
                self.lists.append(sent)
            rows: list[tuple[str, ...]] = [('ADD IND CLASS', one, 'DOOR') for one in sorted(sent)]
            if size > 1 and number % 2:
                rows.append(('REASON',))
            if client.send(*rows) is None:
                self.unanswered |= sent
                return
            self.answered |= sent
            number += size
            time.sleep(0.005)

    def check(self) -> tuple[int, int, int, int]:
        """Return what was answered and is lost, what others saved and is lost, lists that are there
        in part, and what nobody wrote.
        """
        saved = {f'{one.name}_{each}' for one in self.foreign for each in list(one.saved)}
        end = time.monotonic() + 10.0
        while True:
            texts = self.client.send(('QUERY IND CLASS', 'DOOR')) or []
            found = {text.partition('#')[2].rstrip('>') for text in texts}
            if saved <= found or time.monotonic() > end:
                break
            time.sleep(0.05)
        lost = len(self.answered - found)
        halves = sum(0 < len(one & found) < len(one) for one in self.lists)
        writers = tuple(f'{one.name}_' for one in self.foreign)
        own = {name for name in found if not name.startswith(writers)}
        return lost, len(saved - found), halves, len(own - self.answered - self.unanswered)

    def close(self) -> None:
        """End all programs."""
        for one in self.foreign:
            one.process.kill()
            one.process.wait()
        self.client.kill()


def main() -> None:
    """Run the rounds and print the table."""
    if sys.argv[1:2] == ['--serve']:
        serve(Path(sys.argv[2]))
        return
    parser = sized_parser(__doc__, quick='8 kills')
    parser.add_argument('--kills', type=int, default=1000)
    parser.add_argument('--full', type=int, default=100)
    parser.add_argument('--seed', type=int, default=1)
    options = parser.parse_args()
    kills = options.size.of(options.kills, 8, 2)
    full = options.size.of(options.full, 2, 1)
    with tempfile.TemporaryDirectory() as name:
        campaign = Campaign(Path(name), options.seed)
        try:
            campaign.start_writers()
            chosen = set(campaign.draw.sample(range(kills), min(full, kills)))
            for number in range(kills):
                campaign.round(number, full=number in chosen)
                if number % 50 == 49:
                    print(number + 1, *campaign.check(), flush=True)
            sums = campaign.check()
            foreign = sum(len(one.saved) for one in campaign.foreign)
            ended = sum(one.process.poll() is not None for one in campaign.foreign)
            notes = (Path(name) / 'told.txt').read_text().splitlines()
        finally:
            campaign.close()
    print(f'{kills} SIGKILLs, {len(chosen)} after a full disk, seed {options.seed}')
    print(f'directives answered              {len(campaign.answered):8}')
    print(f'saved by owlready2               {foreign:8}')
    print(f'answered and lost                {sums[0]:8}')
    print(f'saved by others and lost         {sums[1]:8}')
    print(f'lists that are there in parts    {sums[2]:8}')
    print(f'there and never written          {sums[3]:8}')
    print(f'programs of owlready2 that ended {ended:8}')
    print(f'back after: median, longest      {statistics.median(campaign.back):8.2f} s', end=' ')
    print(f'{max(campaign.back):.2f} s')
    for text, count in sorted(_kinds(notes).items()):
        print(f'told {count} times: {text}')
    sys.exit(1 if any(sums) or ended else 0)


def _kinds(notes: list[str]) -> dict[str, int]:
    found: dict[str, int] = {}
    for note in notes:
        text = note.partition('.sqlite3: ')[2] or note
        found[text[:120]] = found.get(text[:120], 0) + 1
    return found


if __name__ == '__main__':
    os.environ.setdefault('PYTHONUNBUFFERED', '1')
    main()
