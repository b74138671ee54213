"""A full disk and a clock that was set are incidents, each once."""

from __future__ import annotations

from pathlib import Path

import pytest

from surveillance_operator.notify.machine_watch import MachineWatch
from surveillance_runtime.alarms import DISK_LOW, DISK_WELL, alarm_kind
from surveillance_runtime.incidents import IncidentPhase, Incidents, IncidentUpdate, Severity

pytestmark = pytest.mark.unit


class Machine:
    """A machine whose disk and clocks the test owns."""

    def __init__(self) -> None:
        self.now, self.set_by, self.free = 0.0, 1.7e9, 1e12
        self.told: list[IncidentUpdate] = []
        self.incidents = Incidents(self.told.append, steady=lambda: self.now)
        self.watch = MachineWatch(
            *(self.incidents, Path('/runs/one'), lambda _: self.free),
            wall=lambda: self.now + self.set_by,
            steady=lambda: self.now,
        )

    def passes(self, seconds: int) -> list[IncidentUpdate]:
        """Let time pass; return what is told meanwhile."""
        before = len(self.told)
        for _ in range(seconds):
            self.now += 1.0
            self.watch.look()
            self.incidents.advance()
        return self.told[before:]


def test_a_full_disk_is_told_once_and_over_when_there_is_room_for_a_while() -> None:
    machine = Machine()
    assert not machine.passes(10)
    machine.free = DISK_LOW / 2
    (begun,) = machine.passes(60)
    assert begun.severity is Severity.ALARM
    assert 'the disk of /runs/one is almost full' in begun.text
    machine.free = (DISK_LOW + DISK_WELL) / 2
    assert not machine.passes(600), 'between the bounds nothing changes'
    machine.free = 2 * DISK_WELL
    (ended,) = machine.passes(600)
    assert ended.phase is IncidentPhase.END


def test_a_clock_that_was_set_is_told_with_both_times() -> None:
    machine = Machine()
    assert not machine.passes(10)
    machine.set_by += 3600.0
    (begun,) = machine.passes(10)
    assert begun.severity is Severity.WARNING
    assert 'was set by +3600 s' in begun.text
    machine.set_by -= 3600.0
    (again,) = machine.passes(10)
    assert again.phase is IncidentPhase.UPDATE
    assert 'was set by -3600 s' in again.text
    (ended,) = machine.passes(int(alarm_kind('clock', 'machine').off_delay) + 10)
    assert ended.phase is IncidentPhase.END


def test_a_clock_that_is_slewed_was_not_set() -> None:
    machine = Machine()
    for _ in range(1000):
        machine.set_by += 0.0005
        assert not machine.passes(1)
