#!/usr/bin/env python3
"""Let a robot patrol for thirty days without driving, and look at what that leaves.

    .venv/bin/python benchmarks/month.py
    .venv/bin/python benchmarks/month.py --quick

The mission's record and the ontology's store get what a patrol of seven rooms writes at the pace of
a real one (`benchmarks/campaign.py --network` counts 4.5 visits a minute): each visit with its
decision, the notes of exploring, the leg's path, now and then a failure and a recharge. The table
has one row a day: the disk that record and store take, the processor time to read both at the next
start, and the memory that the process holds. Logs are bounded by themselves
(`launcher.log_merge.LOG_BYTES`), recordings by `--keep`.
"""

from __future__ import annotations

import argparse
import gc
import multiprocessing
import random
import shutil
import sys
import tempfile
import time
from collections.abc import Iterator, Sequence
from concurrent.futures import ProcessPoolExecutor
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
if str(ROOT) not in sys.path:
    sys.path.insert(0, str(ROOT))

from armor_service.access import Settings
from armor_service.client import ArmorClient, InProcessTransport
from armor_service.service import ArmorService
from armor_service.store.store import Store
from benchmarks.sizes import sized_parser
from floor_plans import read_place
from surveillance_behaviour.mission import mission_log
from surveillance_ontology.map_ontology import MapOntology
from surveillance_ontology.patrol_vocabulary import DATA
from surveillance_ontology.robot_ontology import RobotOntology
from surveillance_runtime import event_log

DAY = 86400.0
LEG = 13.3
"""Seconds from one visit to the next."""
REFERENCE = 'surveillance'
START = 1_700_000_000.0
REASON = (
    '(last visit 42.0 s ago) from 2 reachable CORRIDOR places; it is on the way to R3 '
    '(last visit 230.4 s ago); the longest wait on this round is 260 s'
)
CLASSES = ('URGENT', 'CORRIDOR', 'ROOM')


class Month:
    """The record and the ontology of one mission.

    Args:
        folder: Where they are kept.
        seed: Of the places visited.
    """

    def __init__(self, folder: Path, seed: int) -> None:
        self.folder = folder
        self._chance = random.Random(seed)
        self._place = read_place(ROOT / 'config' / 'seven_rooms.yaml').place
        self._service = ArmorService(Settings(), store=Store(folder / 'armor_store'))
        client = ArmorClient('month', REFERENCE, InProcessTransport(self._service))
        self._map, self._ontology = MapOntology(client), RobotOntology(client)
        self.record = mission_log.MissionRecord(folder / 'events.jsonl')

    def begin(self) -> None:
        """Build the map and begin the record."""
        uri = 'http://bnc/exp-rob-lab/2022-23'
        self._map.build(self._place, str(DATA / 'surveillance.owl'), uri, int(START))
        names = sorted(self._place.positions)
        self.record.write('start', START, machine='surveillance', place=names[0], places=names)

    def legs(self, seconds: float) -> Iterator[float]:
        """Patrol for so many seconds; yield the time after each leg."""
        names, now = sorted(self._place.positions), START
        while now < START + seconds:
            now += LEG
            place = self._chance.choice(names)
            self.record.write(
                'decision',
                now - 11.0,
                place=place,
                rule='CORRIDOR',
                reason=f'tour chose {place} {REASON}',
            )
            path = [[round(self._chance.uniform(0, 20), 2) for _ in range(2)] for _ in range(20)]
            self.record.write('visit', now, place=place, distance=5.5, path=path)
            for noted in (1.0, 2.0):
                self.record.write('exploring', now + noted, place=place, seconds=noted)
            if self._chance.random() < 0.01:
                self.record.write(
                    'failure', now + 2.0, what='moving', reason='compute_path: no answer in time'
                )
            if self._chance.random() < 0.005:
                self.record.write('recharge', now + 2.0, place=place, seconds=120.0)
            self._ontology.record_place(place, int(now * 1e9))
            self._ontology.snapshot(now, CLASSES, visits={place: now})
            yield now

    def close(self) -> None:
        """End as a killed process does: nothing is written any more."""
        self.record.close()
        self._service.close()


def reads(folder: Path) -> tuple[float, float, str]:
    """Return processor seconds to read record and store at a start, and where the record ends."""
    began = time.process_time()
    with mission_log.MissionRecord(folder / 'events.jsonl'):
        events = event_log.read(folder / 'events.jsonl')
    cut_off = mission_log.cut_off(events)
    middle = time.process_time()
    service = ArmorService(Settings(), store=Store(folder / 'armor_store'))
    end = time.process_time()
    service.close()
    return middle - began, end - middle, cut_off.place if cut_off else 'nowhere'


def _resident() -> float:
    gc.collect()
    for line in Path('/proc/self/status').read_text().splitlines():
        if line.startswith('VmRSS'):
            return int(line.split()[1]) / 1024
    return 0.0


def _size(path: Path) -> float:
    return sum(each.stat().st_size for each in path.rglob('*') if each.is_file()) / 1e6


def look(month: Month, day: float) -> str:
    """Return a row of the table: what the mission leaves and holds now."""
    folder = month.folder
    with tempfile.TemporaryDirectory() as scratch:
        copy = shutil.copytree(folder, Path(scratch) / 'copy')
        # In a process of its own: what reading leaves in memory is not the mission's.
        with ProcessPoolExecutor(1, multiprocessing.get_context('spawn')) as fresh:
            record, store, place = fresh.submit(reads, copy).result()
    in_store = _size(folder / 'armor_store')
    return (
        f'{day:5.1f} {_size(folder) - in_store:9.1f} {in_store:9.1f} {record:9.2f} {store:9.2f} '
        f'{_resident():9.1f}  {place}'
    )


def main(words: Sequence[str] | None = None) -> int:
    """Run it, print the table, return the exit code."""
    parser = sized_parser(
        __doc__,
        quick='half a day',
        description=__doc__,
        formatter_class=argparse.RawTextHelpFormatter,
    )
    parser.add_argument('--days', type=float, default=30.0)
    parser.add_argument('--minutes', type=float, default=1e9, help='of this machine, at most')
    parser.add_argument('--seed', type=int, default=1)
    chosen = parser.parse_args(words)
    days = chosen.size.of(chosen.days, 0.5, 0.005)
    end = time.monotonic() + 60.0 * chosen.minutes
    print('  day record MB  store MB  read, s  build, s  held, MB  ends in', flush=True)
    with tempfile.TemporaryDirectory() as scratch:
        month = Month(Path(scratch), chosen.seed)
        month.begin()
        looked = 0.0
        for now in month.legs(days * DAY):
            day = (now - START) / DAY
            over = time.monotonic() >= end
            if over or day >= min(days, looked + 1.0):
                print(look(month, day), flush=True)
                looked = day
            if over:
                break
        month.close()
    return 0


if __name__ == '__main__':
    sys.exit(main())
