"""One table says when an incident begins and is over; noise at a bound is one alarm."""

from __future__ import annotations

import ast
import itertools
import os
import random
from pathlib import Path
from types import SimpleNamespace

import pytest

from surveillance_behaviour.mission.mission_watchdog import MissionSight, MissionWatchdog
from surveillance_runtime.alarms import ALARMS, DISK_LOW, AlarmKind, alarm_kind, is_known, page
from surveillance_runtime.incidents import IncidentPhase, Incidents, IncidentUpdate
from surveillance_runtime.sensing.silence import SilenceWatch

pytestmark = pytest.mark.unit

ROOT = Path(__file__).resolve().parent.parent.parent
HOUR = 3600
TIMED = [each for each in ALARMS if each.off_delay]


class Told:
    """Incidents of an owner whose steady clock the test owns."""

    def __init__(self) -> None:
        self.now = 0.0
        self.updates: list[IncidentUpdate] = []
        self.incidents = Incidents(self.updates.append, steady=lambda: self.now)

    def phases(self) -> list[IncidentPhase]:
        return [each.phase for each in self.updates if each.phase is not IncidentPhase.UPDATE]


ONCE = [IncidentPhase.BEGIN, IncidentPhase.END]


@pytest.mark.parametrize('kind', TIMED, ids=lambda each: each.cause)
def test_an_hour_of_noise_at_a_bound_is_one_alarm_and_one_all_clear(kind: AlarmKind) -> None:
    seed = int.from_bytes(os.urandom(4), 'big')
    noise, told = random.Random(seed), Told()
    name, _, of = kind.cause.partition(' ')
    cause = name, of
    told.incidents.begin(cause, 'it is so')
    told.now = kind.on_delay
    told.incidents.advance()
    while told.now < HOUR:
        told.incidents.end(cause, 'it is not so')
        # It is never away for as long as the all-clear waits, and as often as not for a moment.
        told.now += noise.choice((1.0, 0.99 * kind.off_delay)) * noise.random()
        told.incidents.advance()
        told.incidents.begin(cause, 'it is so')
        told.now += noise.expovariate(1.0)
        told.incidents.advance()
    told.incidents.end(cause, 'it is not so')
    told.now += kind.off_delay
    told.incidents.advance()
    assert told.phases() == ONCE, f'seed {seed}'


def test_a_lidar_that_stammers_for_an_hour_is_one_alarm() -> None:
    seed = int.from_bytes(os.urandom(4), 'big')
    noise, told = random.Random(seed), Told()
    scan = SimpleNamespace(topic='/scan', came_at=0.0, heard_at=0.0, problem='')
    silence = SilenceWatch(told.incidents, (scan,))  # type: ignore[arg-type]
    comes_at = 20.0
    gaps = itertools.cycle([(1.0, 7.0), (1.0, 7.0), (10.0, 25.0)])
    for second in range(HOUR + 60):
        told.now = float(second)
        if (second >= comes_at and second < HOUR) or second > HOUR:
            scan.came_at = scan.heard_at = told.now
            # It never comes for as long as the all-clear waits: after two short gaps one is long.
            comes_at = second + noise.uniform(*next(gaps))
        silence.look(told.now)
        told.incidents.advance()
    assert told.phases() == ONCE, f'seed {seed}'


def test_a_held_robot_s_charge_at_its_bound_is_one_alarm() -> None:
    seed = int.from_bytes(os.urandom(4), 'big')
    noise, told = random.Random(seed), Told()
    watchdog = MissionWatchdog(told.incidents, lambda _state: 1e9)
    for second in range(2 * HOUR):
        told.now = float(second)
        low = noise.gauss(0.0, 1.0) < (0.0 if second < HOUR else -9.0) or second < 10
        seen = MissionSight(
            *(told.now, 'STOPPED'), level=30.0, held='paused', must_charge='low' if low else ''
        )
        watchdog.look(seen)
        told.incidents.advance()
    assert told.phases() == ONCE, f'seed {seed}'


def test_what_holds_for_a_moment_only_is_not_told() -> None:
    told = Told()
    for second in range(0, 100, 5):
        told.now = float(second)
        told.incidents.begin(('disk', 'runs'), 'full')
        told.now += 3.0
        told.incidents.end(('disk', 'runs'), 'room')
        told.incidents.advance()
    assert not told.updates


def test_an_owner_that_ends_tells_what_is_away() -> None:
    told = Told()
    told.incidents.begin(('topic', '/scan'), 'silent')
    told.incidents.end(('topic', '/scan'), 'it speaks')
    assert told.phases() == [IncidentPhase.BEGIN]
    assert not told.incidents.open()
    assert [each.text for each in told.incidents.updates()] == ['silent']
    told.incidents.close()
    assert told.phases() == ONCE


def test_severity_and_what_to_do_are_the_table_s() -> None:
    told = Told()
    told.incidents.begin(('node', 'observer'), 'it dies')
    (update,) = told.updates
    kind = alarm_kind('node', 'observer')
    assert (update.severity, update.action) == (kind.severity, kind.action)
    assert alarm_kind('station', 'E') is alarm_kind('station', 'station')
    assert alarm_kind('robot', 'purpose') is not alarm_kind('robot', 'robot2')
    assert f'{DISK_LOW / 1e6:g} MB' in alarm_kind('disk', 'runs').begins


def test_every_cause_in_the_code_is_in_the_table() -> None:
    found: set[str] = set()
    for path in [*ROOT.glob('surveillance_*/surveillance_*/**/*.py'), *ROOT.glob('launcher/*.py')]:
        tree = ast.parse(path.read_text('utf-8'))
        named = {
            target.id: each.value
            for each in tree.body
            if isinstance(each, ast.Assign)
            for target in each.targets
            if isinstance(target, ast.Name)
        }
        for call in ast.walk(tree):
            if (
                isinstance(call, ast.Call)
                and isinstance(call.func, ast.Attribute)
                and call.func.attr == 'begin'
                and 'incidents' in ast.unparse(call.func.value)
            ):
                cause: ast.expr | None = call.args[0]
                if isinstance(cause, ast.Name):
                    cause = named.get(cause.id)
                if isinstance(cause, ast.Tuple) and isinstance(cause.elts[0], ast.Constant):
                    found.add(str(cause.elts[0].value))
    assert len(found) >= 6
    assert [kind for kind in sorted(found) if not is_known(kind)] == []


def test_the_page_of_alarms_is_written_from_the_table() -> None:
    hint = 'write it anew: python3 launch.py params --write'
    assert page() == (ROOT / 'docs' / 'reference' / 'alarms.md').read_text(), hint
