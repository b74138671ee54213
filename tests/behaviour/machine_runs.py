"""Runs of a machine in a scripted world, for the tests of this folder."""

from __future__ import annotations

from pathlib import Path

from patrol_policy.decision import DecisionSettings
from state_machines.testing import watching
from surveillance_behaviour.learned_times import LearnedTimes
from surveillance_behaviour.machines import MACHINES
from surveillance_behaviour.mission.mission import Mission, MissionSettings
from surveillance_behaviour.mission.mission_log import (
    MissionRecord,
)

from .scripted_world import World

CALLS = {
    'surveillance': [
        'wait_until_built',
        'snapshot',
        'position',
        'plan',
        'follow',
    ],
    'patrol': [
        'start',
        'wait_until_built',
        'snapshot',
        'position',
        'reason',
        'plan',
        'control',
        'recharge',
    ],
}


def settings(**choice: object) -> MissionSettings:
    values = {'urgency_threshold': 30.0, 'policy': 'lookahead', 'speed': 1.0, **choice}
    return MissionSettings(
        choice=DecisionSettings(**values),  # type: ignore[arg-type]
        settle_seconds=0.0,
        charge_stall_seconds=40.0,
    )


class Run:
    """One machine in one world, run for a while; the transitions it took are kept."""

    def __init__(
        self,
        machine: str,
        world: World,
        mission_settings: MissionSettings | None = None,
        record: MissionRecord | None = None,
        learned: LearnedTimes | None = None,
    ) -> None:
        self.world = world
        self.mission: Mission = world.mission(
            mission_settings or settings(), record, machine, learned
        )
        self.machine = MACHINES[machine](self.mission)
        self.untaken: set[tuple[str, str, str]] = set()
        self.transitions: list[tuple[str, str, str, str]] = []

    def until(self, time: float) -> Run:
        self.world.clock.limit = time
        self.world.clock.on_limit = self.machine.request_preempt
        with watching(self.machine) as watched:
            assert self.machine.execute() == 'preempted'
        self.transitions = watched.transitions
        self.untaken = set(watched.untaken())
        return self


def visited(world: World, since: float = 0.0) -> set[str]:
    return {place for time, place in world.arrivals if time >= since}


class Killed:
    """A mission that was killed and started again with what its record says."""

    def __init__(self, machine: str, world: World, path: Path, **choice: object) -> None:
        self.machine, self.world, self.path, self.choice = machine, world, path, choice

    def run(self, until: float) -> Run:
        with MissionRecord(self.path) as record:
            return Run(self.machine, self.world, settings(**self.choice), record).until(until)
