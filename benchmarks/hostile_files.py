#!/usr/bin/env python3
"""Changes and cuts the files that are read back: what is said, and what goes on without them.

    .venv/bin/python benchmarks/hostile_files.py [--quick] [--seed N] [--run FOLDER] [--missions N]

Each file of a run (recording, record, state files, place, profile, map, stop file, outbox, the
observer's state) is damaged again and again: one byte changed, some bytes, a part cut out or
doubled, the end cut off, the whole emptied or filled with zeros as a machine that loses power
leaves it. Then whoever reads it back does so. It may refuse the file in one line that names it, or
go on without what is damaged. It is a fault if anything else is raised, if it takes longer than
`PATIENCE`, and if what must go on does not: a recording beside a damaged one is written and read, a
record is continued, another run is found, a robot whose stop cannot be read stays stopped.

The files are made by the project's writers, or taken from the `--run` that a mission left.
`--missions N` resumes N missions whose folder has three damaged files each, and waits for a
decision.
"""

from __future__ import annotations

import contextlib
import dataclasses
import io
import json
import math
import os
import shutil
import signal
import subprocess
import sys
import tempfile
import time
import traceback
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

import numpy as np

CHECKOUT = Path(__file__).resolve().parent.parent
sys.path.insert(0, str(CHECKOUT))

from rclpy.serialization import serialize_message
from std_msgs.msg import String

from benchmarks.sizes import Size, sized_parser
from benchmarks.tables import table
from floor_plans import read_place
from floor_plans.occupancy_map import read_map, write_map
from indoor_watch.demo import Demo
from indoor_watch.watch_rules import read_watch_file
from launcher import run_folder, run_mission
from strict_files.files import FileError, KeptFile
from surveillance_behaviour.learned_times import LearnedTimes
from surveillance_behaviour.mission.mission_log import MissionRecord
from surveillance_ontology.map_keeper import MapKeeper, Reports, Source
from surveillance_operator import day_report, report
from surveillance_operator.mission_state import MissionState
from surveillance_operator.notify.incident_keeper import IncidentKeeper
from surveillance_operator.notify.notification import Notification
from surveillance_operator.notify.outbox import Outbox
from surveillance_operator.notify.sinks import read_notify_file
from surveillance_operator.recording import bag
from surveillance_operator.recording.reading import Messages
from surveillance_operator.recording.runs import find_run, robots_of
from surveillance_operator.recording.schemas import definition
from surveillance_operator.recording.timeline import Timeline, TimelineWriter
from surveillance_operator.run_entries import entries_of_run, marks_of
from surveillance_perception.finding_teller import findings_of
from surveillance_runtime.event_log import read_all
from surveillance_runtime.incidents import (
    Cause,
    IncidentPhase,
    IncidentUpdate,
    Severity,
)
from surveillance_runtime.profile.reading import read_profile
from surveillance_runtime.stop_request import StopFile, StopRequest
from surveillance_simulation.staging import read_script

PATIENCE = 20.0
"""Seconds that reading a damaged file may take; a busy machine takes many times as long."""
LONG = '25'
"""Seconds of a mission: enough for the first decision on a busy machine."""
TOPIC = '/words'
PLACES = ('C1', 'C2', 'E')


class Fault(AssertionError):  # noqa: N818 - a finding of this campaign
    """What must go on without the file does not."""


# --- the files ---


def write_sample(folder: Path) -> None:
    """Write one of each file, by the project's own writers, into an empty folder."""
    run = folder / 'runs' / '20260101-000000'
    other = folder / 'runs' / '20260102-000000'
    for number, each in enumerate((run, other)):
        each.mkdir(parents=True)
        run_folder.RunState(each, {'behaviour': 'surveillance', 'keep': 20.0}).end()
        _write_record(each / 'events.jsonl', number)
        _write_recording(each / 'recording', 6)
    shutil.copy(CHECKOUT / 'config' / 'seven_rooms.yaml', run / 'place.yaml')
    writer = TimelineWriter(run / 'timeline.jsonl')
    for second in range(20):
        writer.add(MissionState(now=float(second)), 1767222000.0 + second)
    writer.close()
    learned = LearnedTimes.of_record(str(run / 'events.jsonl'))
    learned.saw('C1', 1767222030.0)
    learned.save()
    keeper = _map_keeper(run / 'ontology_map_builder.json', [])
    keeper._keep(keeper.place, frozenset({'C1'}))  # type: ignore[arg-type]
    (run / 'battery_controller.json').write_text('{"level": 61.5, "time": 1767222031.5}\n')
    demo = Demo(say=None)
    demo.round('')
    kept = {**demo.monitor.state(), 'days': {}}
    (run / 'observer.json').write_text(json.dumps(kept))
    StopFile(folder / 'stop_0.json').keep(StopRequest('the guard', 'a visitor', 1767222000.0))
    box = Outbox(folder / 'outbox', {'office': lambda _: None})
    for key in ('a' * 24, 'b' * 24):
        box.put(Notification(key, 'D1 is shut', 'door', 'D1', 'observer', 'robot', False, 1.7e9))
    cells = np.zeros((40, 60), np.int8)
    cells[[0, -1], :] = 100
    for kind in ('png', 'pgm'):
        write_map(folder / f'map_{kind}.yaml', cells, 0.05, (0.0, 0.0, 0.0), kind)
    shutil.copy(CHECKOUT / 'config' / 'robots' / 'turtlebot4.yaml', folder / 'robot.yaml')
    (folder / 'notify.yaml').write_text(
        'sinks:\n  office: {webhook: https://example.org/hook}\n  lamp: {command: "true"}\n'
    )
    (folder / 'watch.yaml').write_text(
        'rules:\n  shut: {door: D1, is: closed, hours: mon-fri 08:00-18:00}\n'
        '  box: {object: none}\n'
    )
    (folder / 'stage.yaml').write_text('stage:\n  shut: {at: 20 s, do: door D1 closed}\n')


def _write_record(path: Path, number: int) -> None:
    with MissionRecord(path, segment_bytes=2000) as record:
        record.write('start', 1767222000.0, machine='surveillance', place='E', places=[*PLACES])
        for turn in range(16 + number):
            at, place = 1767222001.0 + 2 * turn, PLACES[turn % 3]
            record.write('decision', at, place=place, rule='URGENT', reason='it waits longest')
            record.write('visit', at + 1.0, place=place, distance=3.5, path=[[5, 10], [6, 10]])
    keeper = IncidentKeeper(lambda _: None, path.parent)
    cause = Cause('door', 'D1')
    told = IncidentUpdate(IncidentPhase.BEGIN, cause, Severity.ALARM, 'D1 is shut', 'ab12')
    keeper.hear(told)
    keeper.close()


def _write_recording(folder: Path, count: int) -> None:
    writer = bag.BagWriter(folder)
    kind = 'std_msgs/msg/String'
    writer.add_topic(bag.TopicType(TOPIC, kind, definition(kind)))
    for number in range(count):
        at = 10**18 + number * 10**8
        writer.write(TOPIC, serialize_message(String(data=f'word {number}')), at, at)
        writer.seal()
    writer.close()


def _map_keeper(path: Path, said: list[str]) -> MapKeeper:
    source = Source(state_file=str(path))
    reports = Reports(said.append, said.append, said.append, said.append)
    place = read_place(CHECKOUT / 'config' / 'seven_rooms.yaml').plan.place
    return MapKeeper(None, source, place, lambda: 0, lambda: True, reports, lambda: None)  # type: ignore[arg-type]


# --- who reads them ---


def _recording(path: Path) -> list[str]:
    """Repair it, read it, and record on beside it; look for what another run recorded."""
    folder = path.parent
    said = bag.repair(folder)
    with contextlib.suppress(FileError):
        messages = Messages(folder)
        list(messages.in_order())
        messages.before([TOPIC], 1e9 + 1.0, 100.0)
        messages.close()
    before = set(bag.segments(folder))
    _write_recording(folder, 3)
    (new,) = set(bag.segments(folder)) - before
    _expect(_words_in(new) == 3, 'what is recorded beside it is not read')
    other = folder.parent.parent / '20260102-000000' / 'recording'
    if other.is_dir():
        bag.prune(folder.parent.parent, 1e12)
        _expect(_words_in(other) == 6, 'the recording of another run is not read')
    return said


def _words_in(recording: Path) -> int:
    messages = Messages(recording)
    try:
        return sum(topic == TOPIC for topic, *_ in messages.in_order())
    finally:
        messages.close()


def _record(path: Path) -> list[str]:
    """Go on with it: the behaviour, the node `alarm`, the observer; report it."""
    folder = path.parent
    log = folder / 'events.jsonl'
    calls: list[Any] = []
    keeper = IncidentKeeper(calls.append, folder)
    keeper.close()
    findings_of(read_all(log))
    LearnedTimes.of_record(str(log))
    with MissionRecord(log) as record:
        _expect(not record.problem, f'it is not gone on with: {record.problem}')
        record.write('visit', 1767222100.0, place='E', distance=1.0)
        said = [record.left_out.words()]
    _expect(_last_visit(log) == 1767222100.0, 'what is written after it is not read')
    marks_of(log)
    entries_of_run(folder, whole=True)
    _expect('Mission' in run_mission.summary(log), 'it is not summed up')
    return [*said, *_report(folder)]


def _last_visit(log: Path) -> float:
    return [entry.time for entry in read_all(log) if entry.name == 'visit'][-1]


def _report(folder: Path) -> list[str]:
    path = report.write_report(folder)
    _expect('</html>' in path.read_text(), 'the report is torn')
    return []


def _timeline(path: Path) -> list[str]:
    said: list[str] = []
    line = Timeline(path, said.append)
    try:
        for at in (*line.times[::5], 0.0, 1e300):
            line.at(at)
            line.next_mark('decision', at)
    finally:
        line.close()
    return said


def _run_state(path: Path) -> list[str]:
    runs, other = path.parent.parent, path.parent.parent / '20260102-000000'
    found = run_folder.latest(runs)
    _expect(found is not None, 'no run is found any more')
    run_folder.look_into(path.parent)
    _expect(run_folder.look_into(other) is not None, 'the other run is not found')
    find_run('last', runs)
    robots_of(path.parent)
    run_folder.prune(runs, 1e12, other)
    fresh = run_folder.make_folder(runs)
    run_folder.RunState(fresh, {'behaviour': 'surveillance'}).end()
    newest = run_folder.latest(runs)
    _expect(newest is not None and newest.folder == fresh, 'a new run is not the last one')
    with contextlib.suppress(ValueError):
        run_folder.run_from((run_folder.find(runs, path.parent.name)).options)
    return []


def _kept(path: Path) -> list[str]:
    """As `StateFile` of a node reads it, and writes it anew."""
    taken: list[Any] = []
    kept = KeptFile(str(path), 'starting without it')
    said = kept.read(taken.append)
    _expect(not kept.write({'level': 50.0}), 'the state is not kept any more')
    return [said]


def _map_builder(path: Path) -> list[str]:
    said: list[str] = []
    keeper = _map_keeper(path, said)
    _expect(keeper.place is not None, 'there is no place any more')
    return said


def _experience(path: Path) -> list[str]:
    learned = LearnedTimes.of_record(str(path).removesuffix('.experience.json'))
    learned.saw('C2', 1767222040.0)
    learned.save()
    _expect(all(map(math.isfinite, learned.visited_at.values())), 'a visit at no time')
    return [learned.problem]


def _observer(path: Path) -> list[str]:
    fresh = Demo(say=None)
    kept = KeptFile(str(path), 'starting without it')
    said = kept.read(lambda found: fresh.monitor.restore(found))
    fresh.visit('hall')
    _expect(not kept.write(fresh.monitor.state()), 'the state is not kept any more')
    with contextlib.suppress(FileError):
        day_report.write_day(path.parent, 'last')
    return [said]


def _stop(path: Path) -> list[str]:
    request = StopFile(path).read()
    if path.exists():
        _expect(request is not None, 'a robot that was stopped is not any more')
        assert request is not None
        _expect(request.words().isprintable(), f'not one line: {request.words()!r}')
    return []


def _outbox(path: Path) -> list[str]:
    came: list[str] = []
    said: list[str] = []
    box = Outbox(path.parent.parent, {'office': lambda told: came.append(told.key)}, said.append)
    box.put(Notification('c' * 24, 'new', 'door', 'D2', 'observer', 'robot', False, time.time()))
    box.deliver_due('office')
    _expect('c' * 24 in came, 'what is told after it is not delivered')
    _expect(len(came) >= 2, 'the others that waited are not delivered')
    return said


def _known(path: Path) -> list[str]:
    return _outbox(path.parent / 'office' / path.name)


def _place(path: Path) -> list[str]:
    read_place(path)
    return []


def _map(path: Path) -> list[str]:
    read_map(path.parent / f'{path.stem}.yaml')
    return []


def _plain(read: Callable[[Path], object]) -> Callable[[Path], list[str]]:
    def reads(path: Path) -> list[str]:
        read(path)
        return []

    return reads


@dataclass(frozen=True)
class Reader:
    """Who reads a file back.

    Attributes:
        path: The file, below the sample's folder.
        read: Reads it; returns what it says, raises `FileError` to refuse it.
        named: Whether what is said must name the file; a picture is named by its map.
    """

    path: str
    read: Callable[[Path], list[str]]
    named: bool = True


RUN = 'runs/20260101-000000'
READERS = (
    Reader(f'{RUN}/recording/recording_0.mcap', _recording),
    Reader(f'{RUN}/recording/metadata.yaml', _recording),
    Reader(f'{RUN}/events.jsonl', _record),
    Reader(f'{RUN}/events.jsonl.0001.gz', _record),
    Reader(f'{RUN}/timeline.jsonl', _timeline),
    Reader(f'{RUN}/run.json', _run_state),
    Reader(f'{RUN}/battery_controller.json', _kept),
    Reader(f'{RUN}/ontology_map_builder.json', _map_builder),
    Reader(f'{RUN}/events.jsonl.experience.json', _experience),
    Reader(f'{RUN}/observer.json', _observer),
    Reader(f'{RUN}/place.yaml', _place),
    Reader('stop_0.json', _stop),
    Reader('outbox/office', _outbox),
    Reader('outbox/known.json', _known),
    Reader('map_png.yaml', _map),
    Reader('map_png.png', _map, named=False),
    Reader('map_pgm.pgm', _map, named=False),
    Reader('robot.yaml', _plain(read_profile)),
    Reader('notify.yaml', _plain(read_notify_file)),
    Reader('watch.yaml', _plain(read_watch_file)),
    Reader('stage.yaml', _plain(read_script)),
)


def _expect(holds: bool, what: str) -> None:
    if not holds:
        raise Fault(what)


# --- the damage ---

_TOKENS = (b'NaN', b'1e999', b'-1e300', b'null', b'[' * 3000, b'"\\ud800"', b'{}', b'\x1b[2J')


def damage(data: bytes, generator: np.random.Generator) -> tuple[bytes, str]:
    """Return a file's content after an accident, and which one."""
    size = len(data)
    at = int(generator.integers(size)) if size else 0
    kind = int(generator.integers(10))
    if kind <= 3 or not size:
        new = bytes([int(generator.integers(256))])
        return data[:at] + new + data[at + 1 :], f'byte {at} is {new!r}'
    if kind == 4:
        return data[:at], f'cut at {at}'
    if kind == 5:
        end = min(size, at + int(generator.integers(1, 600)))
        return data[:at] + data[end:], f'{at} to {end} cut out'
    if kind == 6:
        end = min(size, at + int(generator.integers(1, 600)))
        return data[:end] + data[at:], f'{at} to {end} doubled'
    if kind == 7:
        changed = bytearray(data)
        for _ in range(int(generator.integers(2, 20))):
            changed[int(generator.integers(size))] = int(generator.integers(256))
        return bytes(changed), 'some bytes changed'
    if kind == 8:
        token = _TOKENS[int(generator.integers(len(_TOKENS)))]
        # In place of a number or a word, as a program with a fault writes it.
        end = next((each for each in range(at, size) if data[each] in b' ,:}]\n"'), size)
        return data[:at] + token + data[end:], f'{at} to {end} is {token[:12]!r}'
    if generator.random() < 0.5:
        return data[:at] + bytes(size - at), f'zeros from {at}'
    return b'', 'empty'


@contextlib.contextmanager
def _patience() -> Iterator[None]:
    """End what takes too long with a `TimeoutError`."""

    def late(*_: object) -> None:
        raise TimeoutError(f'still reading after {PATIENCE:g} s')

    before = signal.signal(signal.SIGALRM, late)
    signal.setitimer(signal.ITIMER_REAL, PATIENCE)
    try:
        yield
    finally:
        signal.setitimer(signal.ITIMER_REAL, 0.0)
        signal.signal(signal.SIGALRM, before)


@dataclass
class Tally:
    """What became of one file's damages.

    Attributes:
        taken, told, refused: How often it was read as if nothing were, with a word, or refused.
        faults: What was wrong, with the damage and where.
        slowest: Seconds.
    """

    taken: int = 0
    told: int = 0
    refused: int = 0
    faults: list[str] = dataclasses.field(default_factory=list)
    slowest: float = 0.0


def attack(
    reader: Reader, sample: Path, work: Path, generator: np.random.Generator, count: int
) -> Tally:
    """Damage a file of the sample so many times, each in a fresh copy of all."""
    tally = Tally()
    for _ in range(count):
        folder = work / 'copy'
        shutil.rmtree(folder, ignore_errors=True)
        shutil.copytree(sample, folder)
        path = folder / reader.path
        if path.is_dir():
            path = sorted(path.iterdir())[0]
        data, what = damage(path.read_bytes(), generator)
        path.write_bytes(data)
        begun = time.perf_counter()
        try:
            with _patience(), contextlib.redirect_stderr(io.StringIO()):
                said = [each for each in reader.read(path) if each]
            problem = next((p for p in map(_unfit, said) if p), '')
            tally.told += bool(said)
            tally.taken += not said
        except FileError as error:
            tally.refused += 1
            problem = _unfit(str(error))
            if reader.named and path.name not in str(error) and path.stem not in str(error):
                problem = problem or f'does not name the file: {error}'
        except Exception as error:
            frame = traceback.extract_tb(error.__traceback__)[-1]
            where = f'{Path(frame.filename).name}:{frame.lineno}'
            problem = f'{type(error).__name__} in {where}: {error!s:.120}'
        tally.slowest = max(tally.slowest, time.perf_counter() - begun)
        if problem:
            tally.faults.append(f'{reader.path} ({what}): {problem}')
    return tally


def _unfit(line: str) -> str:
    """Return what is wrong with a line for a person; empty: nothing."""
    if not line.isprintable():
        return f'not one line of text: {line!r:.120}'
    return '' if len(line) < 1100 else f'{len(line)} letters: {line:.80}'


# --- missions ---


def resumed_missions(count: int, generator: np.random.Generator) -> list[str]:
    """Resume missions with damaged folders; return what was wrong."""
    faults = []
    with tempfile.TemporaryDirectory(prefix='hostile-') as name:
        runs = Path(name, 'runs')
        own = {'XDG_STATE_HOME': str(Path(name, 'state')), 'XDG_RUNTIME_DIR': name}
        environ = {**os.environ, **own}
        _launch(runs, environ, ['--for', LONG])
        (first,) = runs.iterdir()
        keep = Path(name, 'keep')
        shutil.copytree(first, keep)
        for turn in range(count):
            shutil.rmtree(runs)
            shutil.copytree(keep, first)
            files = sorted(
                path
                for path in first.rglob('*')
                if path.is_file() and path.suffix != '.html' and path.parent.name != 'parameters'
            )
            names = []
            for number in generator.choice(len(files), 3, replace=False):
                data, what = damage(files[number].read_bytes(), generator)
                files[number].write_bytes(data)
                names.append(f'{files[number].relative_to(first)} ({what})')
            said = _launch(runs, environ, ['--for', LONG, '--resume', first.name])
            newest = max(runs.iterdir(), key=lambda each: (each / 'launch.log').stat().st_mtime)
            problem = ''
            if 'Traceback' in said:
                problem = said[said.index('Traceback') :][:1500]
            elif 'no run in' in said or 'not of a run' in said:
                said = _launch(runs, environ, ['--for', LONG])
                newest = max(runs.iterdir(), key=lambda each: each.stat().st_mtime)
            if not problem and '| decision ' not in said:
                problem = f'no decision: {said[-600:]}'
            if not problem and not any((newest / 'recording').glob('*.mcap')):
                problem = 'nothing was recorded'
            print(f'  mission {turn + 1}: {", ".join(names)}: {problem or "goes on"}', flush=True)
            faults += [f'{", ".join(names)}: {problem}'] if problem else []
    return faults


def _launch(runs: Path, environ: dict[str, str], words: list[str]) -> str:
    command = [sys.executable, str(CHECKOUT / 'launch.py'), '--record', str(runs), '--domain', '98']
    done = subprocess.run(
        [*command, *words],
        env=environ,
        cwd=CHECKOUT,
        stdin=subprocess.DEVNULL,
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
        text=True,
    )
    return done.stdout


def main() -> int:
    """Run the campaign and print its table; the exit code is 1 where there was a fault."""
    parser = sized_parser(__doc__, quick='50 damages of each file')
    parser.add_argument('--seed', type=int, help='default: drawn')
    parser.add_argument('--run', type=Path, help='take the files of this run')
    parser.add_argument('--only', default='', help='files whose path holds this')
    parser.add_argument('--missions', type=int, default=0, help='resume so many missions as well')
    options = parser.parse_args()
    size: Size = options.size
    seed = options.seed if options.seed is not None else int.from_bytes(os.urandom(4), 'big')
    generator = np.random.default_rng(seed)
    count = size.of(250, 50, 4)
    rows: list[tuple[str, ...]] = [
        ('file', 'damages', 'as it is', 'told', 'refused', 'slowest, s', 'faults')
    ]
    faults: list[str] = []
    with tempfile.TemporaryDirectory(prefix='hostile-') as name:
        sample, work = Path(name, 'sample'), Path(name, 'work')
        sample.mkdir()
        work.mkdir()
        write_sample(sample)
        if options.run is not None:
            shutil.copytree(options.run, sample / RUN, dirs_exist_ok=True)
        for reader in READERS:
            if options.only not in reader.path:
                continue
            found = attack(reader, sample, work, generator, count)
            faults += found.faults
            counts = (count, found.taken, found.told, found.refused)
            rows.append(
                (
                    reader.path.removeprefix(f'{RUN}/'),
                    *map(str, counts),
                    f'{found.slowest:.2f}',
                    str(len(found.faults)),
                )
            )
    print(f'{datetime.now(UTC):%Y-%m-%d}, seed {seed}')
    print(table(rows))
    if options.missions:
        faults += resumed_missions(options.missions, generator)
    for fault in faults[:60]:
        print(f'fault: {fault}')
    print(f'{(len(rows) - 1) * count} damages, {len(faults)} faults')
    return 1 if faults else 0


if __name__ == '__main__':
    sys.exit(main())
