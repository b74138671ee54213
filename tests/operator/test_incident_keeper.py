"""The keeper of a run's incidents: called, kept in the log, and taken up after a restart."""

from __future__ import annotations

from pathlib import Path

import pytest

from surveillance_operator.notify.incident_keeper import IncidentKeeper
from surveillance_operator.run_entries import entries_of_run, incidents_of
from surveillance_runtime.event_log import RECORD, EventLog, read
from surveillance_runtime.incidents import (
    FIRST_AGAIN,
    SETTLED,
    TOLD_AGAIN,
    Cause,
    IncidentCall,
    IncidentPhase,
    IncidentUpdate,
    SeenThing,
    Severity,
)

pytestmark = pytest.mark.unit


class Robot:
    """A run whose time passes by hand, with keepers that follow each other."""

    def __init__(self, folder: Path) -> None:
        self.folder, self.now, self.date = folder, 5000.0, 1.7e9
        self.calls: list[str] = []
        self.keeper = self.start()

    def start(self) -> IncidentKeeper:
        """Start a keeper, as one that was killed is."""
        return IncidentKeeper(
            self._call,
            self.folder,
            lambda: self.now,
            lambda: self.now,
            lambda: self.date + self.now,
        )

    def _call(self, call: IncidentCall) -> None:
        self.calls.append(call.text)

    def tell(
        self, *, over: bool = False, robot: str = '', number: str = 'a1', node: str = 'observer'
    ) -> None:
        """Tell of a door that is ajar."""
        self.keeper.hear(
            IncidentUpdate(
                *(
                    IncidentPhase.END if over else IncidentPhase.BEGIN,
                    Cause('event', '3'),
                    Severity.ALARM,
                ),
                *('3: door D1 is ajar', number if node == 'observer' else 'b1'),
                robot=robot,
                node=node,
                finding=SeenThing(3, 'door', 'ajar', 'D1', (1.0, 2.0)),
            )
        )

    def wait(self, seconds: float) -> None:
        """Let time pass."""
        self.now += seconds
        self.keeper.advance()


def test_an_incident_is_called_kept_and_cleared(tmp_path: Path) -> None:
    robot = Robot(tmp_path)
    robot.tell()
    robot.wait(20.0)
    robot.tell(over=True)
    robot.wait(SETTLED)
    assert robot.calls == ['3: door D1 is ajar', 'all clear after 20 s: 3: door D1 is ajar']
    assert [each.text('phase') for each in read(tmp_path / RECORD)] == ['begin', 'call', 'end']
    (kept,) = incidents_of(entries_of_run(tmp_path).entries)
    assert (kept.cause, kept.lasted, kept.calls) == ('event 3', 20.0, 1)


def test_a_keeper_that_is_started_again_calls_nobody_twice(tmp_path: Path) -> None:
    robot = Robot(tmp_path)
    robot.tell()
    robot.now += 100.0
    robot.keeper = robot.start()
    robot.tell()  # latched
    robot.wait(FIRST_AGAIN - 101.0)
    assert robot.calls == ['3: door D1 is ajar']
    robot.wait(1.5)
    assert robot.calls[1:] == ['3: door D1 is ajar (for 4 min now)']
    robot.tell(over=True)
    robot.wait(SETTLED)
    assert robot.calls[2:] == ['all clear after 4 min: 3: door D1 is ajar']
    assert len(incidents_of(entries_of_run(tmp_path).entries)) == 1


def test_what_was_over_at_the_end_of_the_run_is_told_by_then(tmp_path: Path) -> None:
    robot = Robot(tmp_path)
    robot.tell()
    robot.wait(60.0)
    robot.tell(over=True)
    robot.now += 2.0
    robot.keeper.close()
    assert robot.calls[1:] == ['all clear after 60 s: 3: door D1 is ajar']


def test_what_ended_while_nobody_kept_the_book_is_told_after_the_next_start(tmp_path: Path) -> None:
    robot = Robot(tmp_path)
    robot.tell()
    robot.keeper = robot.start()
    robot.wait(TOLD_AGAIN)
    (clear,) = robot.calls[1:]
    assert clear.startswith('all clear')


def test_each_robot_has_its_incidents_in_its_own_log(tmp_path: Path) -> None:
    (tmp_path / 'anna').mkdir()
    robot = Robot(tmp_path)
    robot.tell(robot='anna')
    robot.tell(robot='site')
    assert [each.text('robot') for each in read(tmp_path / 'anna' / RECORD)] == ['anna', 'anna']
    assert [each.text('robot') for each in read(tmp_path / RECORD)] == ['site', 'site']
    robot.keeper = robot.start()
    assert {each.told.owner for each in robot.keeper.book.open()} == {
        *('anna/observer', 'site/observer')
    }


def test_what_was_over_before_a_restart_is_not_called_again(tmp_path: Path) -> None:
    robot = Robot(tmp_path)
    robot.tell()
    robot.wait(20.0)
    robot.tell(over=True)
    robot.tell(number='a2')  # again, within moments
    robot.tell(over=True, number='a2')
    robot.wait(SETTLED)
    robot.keeper = robot.start()
    for number in ('a1', 'a2'):  # latched
        robot.tell(number=number)
        robot.tell(over=True, number=number)
    robot.wait(SETTLED)
    assert robot.calls == ['3: door D1 is ajar', 'all clear after 20 s: 3: door D1 is ajar']
    robot.tell(number='a3')
    assert robot.calls[2:] == ['3: door D1 is ajar']


def test_an_end_is_heard_also_where_the_beginning_is_not_told_again(tmp_path: Path) -> None:
    robot = Robot(tmp_path)
    robot.tell()
    robot.wait(10.0)
    robot.keeper = robot.start()
    robot.tell(over=True)
    robot.wait(SETTLED)
    assert robot.calls[1:] == ['all clear after 10 s: 3: door D1 is ajar']


@pytest.mark.parametrize('name', ['../..', '..', '{}', 'a' * 900, 'x/y', '.'])
def test_a_robot_s_name_is_no_path(tmp_path: Path, name: str) -> None:
    run, other = tmp_path / 'runs' / 'run', tmp_path / 'other'
    run.mkdir(parents=True)
    other.mkdir()
    robot = Robot(run)
    robot.tell(robot=name.format(other))
    robot.keeper.write('parameter', name.format(other), node='n', name='x', value='1')
    assert [each for each in tmp_path.rglob('*') if each.is_file()] == [run / RECORD]
    assert len(read(run / RECORD)) == 3


def test_an_incident_without_words_is_kept(tmp_path: Path) -> None:
    robot = Robot(tmp_path)
    robot.keeper.hear(IncidentUpdate(IncidentPhase.BEGIN, Cause('door', ''), Severity.WARNING, ''))
    assert [each.text('phase') for each in read(tmp_path / RECORD)] == ['begin']


def test_what_goes_on_is_known_after_its_beginning_was_packed_away(tmp_path: Path) -> None:
    robot = Robot(tmp_path)
    robot.tell()
    with EventLog(tmp_path / RECORD) as mission:
        mission.begin_segment(mission.entry('snapshot', 1.0, account={}))
    robot.wait(20.0)
    robot.keeper = robot.start()
    robot.tell()  # latched
    robot.tell(over=True)
    robot.wait(SETTLED)
    assert robot.calls == ['3: door D1 is ajar', 'all clear after 20 s: 3: door D1 is ajar']


def test_a_clock_that_was_set_changes_no_distance_between_calls(tmp_path: Path) -> None:
    robot = Robot(tmp_path)
    robot.tell()
    robot.wait(10.0)
    robot.date += 86400.0
    robot.keeper = robot.start()
    robot.tell()  # latched
    robot.wait(10.0)
    robot.tell(over=True)
    robot.wait(SETTLED)
    assert robot.calls == ['3: door D1 is ajar', 'all clear after 20 s: 3: door D1 is ajar']


@pytest.mark.parametrize('value', [0x00, 0x0A, 0x22, 0x2C, 0x30, 0x65, 0x7B, 0x80])
def test_a_damaged_byte_of_the_log_ends_no_keeper_and_hides_no_other_incident(
    tmp_path: Path, value: int
) -> None:
    robot = Robot(tmp_path)
    robot.tell()
    robot.tell(node='other')
    path = tmp_path / RECORD
    whole = path.read_bytes()
    second = whole.index(b'"node": "other"')
    for place in range(whole.rindex(b'\n', 0, second)):
        path.write_bytes(whole[:place] + bytes([value]) + whole[place + 1 :])
        robot.keeper = robot.start()
        assert 'other' in [each.told.node for each in robot.keeper.book.open()]
        robot.wait(TOLD_AGAIN + FIRST_AGAIN)
        robot.keeper.close()
