"""What was true when, as far back as changes are kept, and over a restart."""

from __future__ import annotations

from pathlib import Path

import pytest

from armor_service.access import Settings
from armor_service.client import ArmorClient, InProcessTransport
from armor_service.service import ArmorService
from armor_service.store import Store

from .seven_rooms import asker, build_seven_rooms


class Patrol:
    """A service with a clock, and the seven rooms that were built at 100 s."""

    def __init__(self, folder: Path, history: int = 20_000, compact_from: int = 1 << 20) -> None:
        self.now = 100.0
        self._folder = folder
        self._history = history
        self._compact_from = compact_from
        self.start()
        build_seven_rooms(self.client, False, True)

    def start(self) -> None:
        self.service = ArmorService(
            Settings(self._folder, history=self._history),
            print,
            print,
            Store(self._folder / 'store', self._compact_from),
            lambda: self.now,
        )
        self.client = ArmorClient('patrol', 'map', InProcessTransport(self.service))

    def visit(self, time: float, place: str) -> None:
        self.now = time
        change = self.client.manipulation
        change.replace_one_objectprop_b2_ind('isIn', 'Robot1', place)
        change.replace_one_dataprop_b2_ind('visitedAt', place, 'LONG', str(1665579740 + int(time)))
        self.client.utils.sync_buffered_reasoner()

    def at(self, time: float, pattern: str) -> list[str]:
        return [str(fact) for fact in self.client.query.facts_at(time, pattern)]


@pytest.mark.parametrize('restarted', [False, True])
@pytest.mark.parametrize('compact_from', [1 << 20, 1])
def test_places_visits_and_what_followed_are_asked_at_a_time(
    tmp_path: Path, restarted: bool, compact_from: int
) -> None:
    patrol = Patrol(tmp_path, compact_from=compact_from)
    patrol.visit(200.0, 'C1')
    patrol.visit(300.0, 'R1')
    patrol.now = 400.0
    patrol.client.manipulation.remove_objectprop_from_ind('hasDoor', 'R1', 'D1')
    if restarted:
        patrol.service.close()
        patrol.start()
    patrol.now = 500.0
    where = 'isIn(Robot1, ?)'
    assert [patrol.at(t, where) for t in (150.0, 200.0, 299.9, 300.0, 500.0)] == [
        ['isIn(Robot1, E)'],
        ['isIn(Robot1, C1)'],
        ['isIn(Robot1, C1)'],
        ['isIn(Robot1, R1)'],
        ['isIn(Robot1, R1)'],
    ]
    assert patrol.at(250.0, 'visitedAt(C1, ?)') == ['visitedAt(C1, "1665579940"^^xsd:long)']
    assert patrol.at(150.0, 'visitedAt(C1, ?)') == ['visitedAt(C1, "1665579740"^^xsd:long)']
    assert patrol.at(399.0, 'hasDoor(R1, ?)') == ['hasDoor(R1, D1)']
    assert patrol.at(401.0, 'hasDoor(R1, ?)') == []
    assert patrol.at(150.0, 'canReach(Robot1, ?)') == [
        'canReach(Robot1, C1)',
        'canReach(Robot1, C2)',
    ]
    assert patrol.at(250.0, 'ROOM(?)') == ['ROOM(C1)', 'ROOM(C2)', 'ROOM(E)'] + [
        f'ROOM(R{n})' for n in (1, 2, 3, 4)
    ]
    answer = asker(patrol.service)('QUERY AT', '150', where, 'true')
    assert answer.queried_objects == ['isIn(Robot1, E)']
    patrol.service.close()


def test_asking_changes_nothing(tmp_path: Path) -> None:
    patrol = Patrol(tmp_path)
    patrol.visit(200.0, 'C1')
    patrol.at(150.0, 'isIn(?, ?)')
    assert patrol.client.query.objectprop_b2_ind('isIn', 'Robot1') == ['C1']
    patrol.service.close()


def test_the_past_has_a_bound_and_says_since_when_it_is_kept(tmp_path: Path) -> None:
    patrol = Patrol(tmp_path, history=10)
    for number in range(10):
        patrol.visit(200.0 + number, ('C1', 'E')[number % 2])
    ask = asker(patrol.service)
    early = ask('QUERY AT', '150', 'isIn(Robot1, ?)')
    assert (early.success, early.exit_code) == (False, 205)
    assert 'is before 207.000, since when changes are kept' in early.error_description
    assert patrol.at(208.0, 'isIn(Robot1, ?)') == ['isIn(Robot1, C1)']
    before = ask('QUERY AT', '50', 'isIn(Robot1, ?)')
    assert before.exit_code == 205
    patrol.service.close()


@pytest.mark.parametrize('compact_from', [1 << 20, 1])
def test_the_bound_holds_over_a_restart(tmp_path: Path, compact_from: int) -> None:
    patrol = Patrol(tmp_path, history=10, compact_from=compact_from)
    for number in range(10):
        patrol.visit(200.0 + number, ('C1', 'E')[number % 2])
    patrol.service.close()
    patrol.start()
    early = asker(patrol.service)('QUERY AT', '206.9', 'isIn(Robot1, ?)')
    assert 'is before 207.000, since when changes are kept' in early.error_description
    assert patrol.at(207.0, 'isIn(Robot1, ?)') == ['isIn(Robot1, E)']
    assert patrol.at(208.0, 'isIn(Robot1, ?)') == ['isIn(Robot1, C1)']
    patrol.service.close()


@pytest.mark.parametrize('restarted', [False, True])
def test_a_clock_that_is_set_back_mixes_up_nothing(tmp_path: Path, restarted: bool) -> None:
    patrol = Patrol(tmp_path)
    patrol.visit(200.0, 'C1')
    patrol.visit(20.0, 'R1')
    patrol.visit(30.0, 'C1')
    if restarted:
        patrol.service.close()
        patrol.start()
    where = 'isIn(Robot1, ?)'
    assert patrol.at(29.9, where) == ['isIn(Robot1, R1)']
    assert patrol.at(31.0, where) == ['isIn(Robot1, C1)']
    assert patrol.at(19.9, where) == ['isIn(Robot1, E)'], 'C1 is taken for 20.0'
    patrol.now = 5.0
    assert patrol.at(5.0, where) == ['isIn(Robot1, C1)']
    patrol.service.close()


def test_a_time_ahead_and_a_pattern_that_is_none_are_refused_in_one_line(tmp_path: Path) -> None:
    patrol = Patrol(tmp_path)
    ask = asker(patrol.service)
    for time, pattern, words in (
        ('1700000000', 'isIn(?, ?)', '1700000000.000 lies ahead of the server'),
        ('inf', 'isIn(?, ?)', 'inf lies ahead of the server, whose clock says 100.000'),
        ('100', 'isIn', "QUERY AT: argument pattern 'isIn': expected CLASS(individual)"),
        ('soon', 'isIn(?, ?)', "argument time 'soon': expected seconds since the epoch"),
    ):
        answer = ask('QUERY AT', time, pattern)
        assert (answer.success, answer.exit_code) == (False, 205)
        assert words in answer.error_description
    patrol.service.close()


@pytest.mark.parametrize('time', ['', 'yesterday', 'nan', '2022-11-01'])
def test_what_is_no_time_is_refused(tmp_path: Path, time: str) -> None:
    patrol = Patrol(tmp_path)
    answer = asker(patrol.service)('QUERY AT', time, 'isIn(?, ?)')
    assert (answer.success, answer.exit_code) == (False, 205)
    assert 'QUERY AT: argument time' in answer.error_description
    patrol.service.close()
