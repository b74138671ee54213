"""In no order of events does the robot strand, skip a low battery, break its rules or forget."""

from __future__ import annotations

import tempfile
import threading
from pathlib import Path

import pytest
from hypothesis import HealthCheck, settings
from hypothesis import strategies as st
from hypothesis.stateful import (
    RuleBasedStateMachine,
    initialize,
    invariant,
    rule,
    run_state_machine_as_test,
)

from patrol_policy.decision import DecisionSettings, energy_of
from patrol_policy.situation import Decision
from state_machines.exceptions import CallError, UnavailableError
from surveillance_behaviour.machines import MACHINES
from surveillance_behaviour.mission.mission import MissionSettings
from surveillance_behaviour.mission.mission_log import MissionRecord
from surveillance_runtime.event_log import read

from .scripted_world import World

pytestmark = pytest.mark.early

CALLS = [
    'snapshot',
    'position',
    'plan',
    'follow',
    'control',
    'reason',
    'recharge',
]
DOORS = [f'D{number}' for number in range(1, 8)]
THRESHOLD = 40.0


class CheckedWorld(World):
    """A world that holds each decision against what the ontology said and the battery showed."""

    def decided(self, decision: Decision) -> None:
        super().decided(decision)
        self.check(decision)

    def check(self, decision: Decision) -> None:
        """Note what is wrong with a decision made now."""
        if decision.rule == 'recharge':
            assert decision.place in self.stations
            return
        reachable = set(self.neighbours(self.is_in))
        allowed = reachable - self.avoided() or reachable
        world = self.decision_maker.world
        assert world is not None
        energy = energy_of(world, self.decision_maker.battery(), self.decision_maker.settings)
        if energy is not None:
            # A fall of the charge that is the only one yet tells of a small range.
            allowed = {place for place in allowed if energy.within_range[energy.index[place]]}
        assert decision.place in allowed, decision
        urgent = self.urgent() & allowed
        if urgent:
            assert decision.place in urgent, decision
        elif corridors := {place for place in allowed if len(self.rooms[place]) > 1}:
            assert decision.place in corridors, decision
        assert not self.battery.low, f'skipped a low battery: {decision}'


class AnyOrder(RuleBasedStateMachine):
    """A machine whose thread runs for a while between any two events."""

    machine = ''

    @initialize()
    def begin(self) -> None:
        self.folder = tempfile.TemporaryDirectory()
        self.path = Path(self.folder.name) / 'events.jsonl'
        self.world = CheckedWorld(draw=0.1, low_below=20.0)
        self.faults: dict[str, tuple[int, type[CallError]]] = {}
        self.refused_when_low = False
        self.world.faults = self.fault
        self.record = MissionRecord(self.path)
        choice = DecisionSettings(urgency_threshold=THRESHOLD, policy='oldest')
        mission_settings = MissionSettings(choice=choice, settle_seconds=0.0)
        self.mission = self.world.mission(mission_settings, self.record, machine=self.machine)
        self.fsm = MACHINES[self.machine](self.mission)
        self.go, self.halted = threading.Semaphore(0), threading.Semaphore(0)
        self.ended = False
        self.error: BaseException | None = None
        self.world.clock.limit = 0.0
        self.world.clock.on_limit = self.halt
        self.thread = threading.Thread(target=self.run, daemon=True)
        self.thread.start()
        assert self.halted.acquire(timeout=60.0)

    def run(self) -> None:
        try:
            self.fsm.execute()
        except BaseException as error:
            self.error = error
        self.ended = True
        self.halted.release()

    def halt(self) -> None:
        """Hands over to the next event, in the machine's thread."""
        self.halted.release()
        assert self.go.acquire(timeout=60.0)

    def fault(self, call: str) -> None:
        times, kind = self.faults.get(call, (0, CallError))
        if times > 0:
            self.faults[call] = (times - 1, kind)
            self.refused_when_low |= self.world.battery.low
            raise kind(f'{call}: scripted fault')

    @rule(seconds=st.floats(1.0, 120.0))
    def time_passes(self, seconds: float) -> None:
        self.advance(seconds)

    def advance(self, seconds: float) -> None:
        self.world.clock.limit = self.world.clock.time + seconds
        self.go.release()
        assert self.halted.acquire(timeout=60.0), 'the machine hangs'

    @rule(
        call=st.sampled_from(CALLS),
        times=st.integers(1, 8),
        kind=st.sampled_from([CallError, UnavailableError]),
    )
    def calls_will_fail(self, call: str, times: int, kind: type[CallError]) -> None:
        self.faults[call] = (times, kind)

    @rule(drop=st.floats(0.0, 30.0))
    def battery_falls(self, drop: float) -> None:
        # What is left suffices for the way home: below that nobody can help.
        self.world.set_level(max(19.0, self.world.level - drop))

    @rule(door=st.sampled_from(DOORS))
    def door_closes(self, door: str) -> None:
        # Of the ring E, C1, C2 one door at a time, so that there is a way home; and nobody shuts
        # the robot in, which could only wait there until its battery is empty.
        rooms = {self.world.is_in, *(decision.place for decision in self.world.decisions[-1:])}
        ways_out = [self.world.rooms[room] for room in rooms]
        if [door] in map(list, ways_out):
            return
        if not (door in ('D5', 'D6', 'D7') and self.world.closed & {'D5', 'D6', 'D7'}):
            self.world.closed.add(door)

    @rule(door=st.sampled_from(DOORS))
    def door_opens(self, door: str) -> None:
        self.world.closed.discard(door)

    @rule(threshold=st.sampled_from([10.0, 40.0, 120.0]))
    def threshold_changes(self, threshold: float) -> None:
        self.mission.settings.choice.urgency_threshold = threshold

    @rule(policy=st.sampled_from(['tour', 'oldest', 'lookahead', 'seed']))
    def policy_changes(self, policy: str) -> None:
        self.mission.settings.choice.policy = policy

    @invariant()
    def goes_on(self) -> None:
        if hasattr(self, 'error'):
            assert self.error is None, self.error
            assert not self.ended, 'the mission ended though nobody told it to'

    @invariant()
    def never_strands(self) -> None:
        if hasattr(self, 'world'):
            # Whoever refuses a robot with a low battery may hold it until that is empty.
            assert self.world.stranded == 0 or self.refused_when_low

    @invariant()
    def forgets_no_visit(self) -> None:
        if hasattr(self, 'world'):
            kept = [event.text('place') for event in read(self.path) if event.name == 'visit']
            noted = [text.split()[-1] for text in self.world.said if text.startswith('arrived in')]
            back = [text.split()[-1] for text in self.world.said if text.startswith('back in')]
            assert sorted(kept) == sorted(noted + back)

    def teardown(self) -> None:
        if not hasattr(self, 'thread'):
            return
        self.faults.clear()
        self.world.closed.clear()
        before = len(self.world.arrivals)
        for _ in range(20):
            if len(self.world.arrivals) > before + 2 or self.error:
                break
            self.advance(60.0)
        assert self.error is None, self.error
        assert len(self.world.arrivals) > before, 'the robot does not go on when all is well again'
        self.fsm.request_preempt()
        self.world.clock.limit = float('inf')
        self.go.release()
        self.thread.join(60.0)
        assert self.ended
        self.record.close()
        self.folder.cleanup()


def search(machine: str) -> None:
    kind = type('AnyOrder_' + machine, (AnyOrder,), {'machine': machine})
    run_state_machine_as_test(
        kind,
        settings=settings(
            max_examples=20,
            stateful_step_count=25,
            suppress_health_check=list(HealthCheck),
        ),
    )


def test_surveillance_holds_in_any_order_of_events() -> None:
    search('surveillance')


def test_patrol_holds_in_any_order_of_events() -> None:
    search('patrol')
