"""Both machines as plain Python: the seeds' ways through them, and every fault at every state."""

from __future__ import annotations

import itertools
import math
import resource
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest

import surveillance_fsm as fsm
from surveillance_behaviour.decision import DecisionSettings
from surveillance_behaviour.machines import MACHINES
from surveillance_behaviour.mission.mission import Mission, MissionSettings
from surveillance_behaviour.mission.mission_log import (
    CutOff,
    MissionRecord,
    cut_off,
    read,
    summarize,
)
from surveillance_behaviour.peers.ports import AwayError, PeerError, Point
from surveillance_behaviour.world_model import Experience
from surveillance_fsm.testing import watching

from .scripted_world import POSITIONS, SEVEN_ROOMS, World, fails

CALLS = {
    'surveillance': [
        'wait_until_built',
        'set_urgency_threshold',
        'snapshot',
        'position',
        'plan',
        'follow',
    ],
    'patrol': [
        'start',
        'wait_until_built',
        'set_urgency_threshold',
        'snapshot',
        'position',
        'reason',
        'plan',
        'control',
        'recharge',
    ],
}
Transition = tuple[str, str, str]


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
        cut_off: CutOff | None = None,
        experience: Experience | None = None,
    ) -> None:
        self.world = world
        self.mission: Mission = world.mission(
            mission_settings or settings(), record, cut_off, machine, experience
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


@pytest.fixture(params=list(MACHINES))
def machine(request: pytest.FixtureRequest) -> str:
    return str(request.param)


def visited(world: World, since: float = 0.0) -> set[str]:
    return {place for time, place in world.arrivals if time >= since}


def test_an_hour_of_patrol_reaches_all_places_and_charges_in_time(machine: str) -> None:
    world = World(draw=0.8)
    run = Run(machine, world, settings(policy='tour')).until(3600.0)
    assert visited(world) == set(SEVEN_ROOMS)
    assert world.stranded == 0
    assert sum(decision.rule == 'recharge' for decision in world.decisions) >= 5
    assert not world.cries
    assert run.mission.failure is None


WAYS = {
    'surveillance': [
        ('INITIALIZATION', 'initialized'),
        ('CHOOSE_ROOM_TASK', 'explore'),
        ('EXPLORE_TASK', 'explored'),
        ('PERFORM_ROOM_TASKS', 'explored'),
        ('CHOOSE_NEXT_ROOM', 'chosen'),
        ('MOVE_TO_NEXT_ROOM', 'moved'),
        ('CHOOSE_ROOM_TASK', 'explore'),
    ],
    'patrol': [
        ('Initial', 'start'),
        ('Reasoning', 'reasoned'),
        ('Pointing', 'pointed'),
        ('Controlling', 'reached'),
        ('Moving', 'reached'),
        ('Reasoning', 'reasoned'),
    ],
}
WAYS_TO_CHARGE = {
    'surveillance': [
        ('CHOOSE_NEXT_ROOM', 'chosen'),
        ('MOVE_TO_NEXT_ROOM', 'moved'),
        ('CHOOSE_ROOM_TASK', 'recharge'),
        ('RECHARGE_TASK', 'recharged'),
        ('PERFORM_ROOM_TASKS', 'recharged'),
        ('CHOOSE_NEXT_ROOM', 'chosen'),
    ],
    'patrol': [
        ('Controlling', 'battery_low'),
        ('Moving', 'battery_low'),
        ('Recharge', 'not_at_dock'),
        ('Pointing', 'pointed'),
        ('Controlling', 'reached'),
        ('Moving', 'reached'),
        ('Recharge', 'battery_full'),
        ('RechargeRoutine', 'battery_full'),
        ('Reasoning', 'reasoned'),
    ],
}


def test_the_machine_takes_the_seeds_way(machine: str) -> None:
    run = Run(machine, World()).until(40.0)
    way = WAYS[machine]
    assert [(left, outcome) for _, left, outcome, _ in run.transitions][: len(way)] == way


def test_a_low_battery_takes_the_seeds_way_to_the_dock(machine: str) -> None:
    world = World()
    began: list[int] = []

    def fall(call: str) -> None:
        if world.clock.time > 30.0 and call in ('follow', 'control') and not began:
            began.append(1)
            world.clock.after(0.5, lambda: world.set_level(10.0))

    world.faults = fall
    run = Run(machine, world).until(300.0)
    taken = [(left, outcome) for _, left, outcome, _ in run.transitions]
    way = WAYS_TO_CHARGE[machine]
    assert any(taken[start : start + len(way)] == way for start in range(len(taken)))


@pytest.mark.parametrize('times', [2, 20])
@pytest.mark.parametrize(('name', 'call'), [(m, c) for m, calls in CALLS.items() for c in calls])
def test_a_peer_that_fails_is_got_over(name: str, call: str, times: int) -> None:
    world = World(draw=0.4)
    world.faults = fails(call, times)
    run = Run(name, world).until(1800.0)
    assert any('scripted fault' in text for text in world.said)
    assert visited(world, since=1100.0) == set(SEVEN_ROOMS)
    assert world.stranded == 0
    assert run.mission.failure is None


@pytest.mark.parametrize(('name', 'call'), [(m, c) for m, calls in CALLS.items() for c in calls])
def test_a_peer_that_stays_away_is_cried_about_and_waited_for(name: str, call: str) -> None:
    world = World()

    def begin() -> None:
        world.faults = fails(call)
        world.set_level(10.0)

    world.clock.after(100.0, begin)
    Run(name, world).until(2000.0)
    if call in ('start', 'wait_until_built', 'set_urgency_threshold'):
        assert not world.cries, 'asked at the start only'
        return
    assert any('scripted fault' in cry for cry in world.cries)
    assert world.cries.count('') >= 3, 'it goes on trying'


@pytest.mark.parametrize(('name', 'call'), [(m, c) for m, calls in CALLS.items() for c in calls])
def test_a_battery_that_falls_during_any_call_is_charged_next(name: str, call: str) -> None:
    world = World()
    seen: list[float] = []

    def fall(called: str) -> None:
        if called == call and world.clock.time > 60.0 and not seen:
            seen.append(world.clock.time)
            world.set_level(12.0)

    world.faults = fall
    run = Run(name, world).until(900.0)
    if not seen:
        return  # A call of the start only.
    after = [decision for decision in world.decisions if decision.time >= seen[0]]
    assert any(decision.rule == 'recharge' for decision in after[:2])
    assert world.level > 12.0
    assert run.mission.failure is None


@pytest.mark.parametrize(('name', 'call'), [(m, c) for m, calls in CALLS.items() for c in calls])
def test_a_preempt_during_any_call_ends_the_machine(name: str, call: str) -> None:
    world = World()
    run = Run(name, world)
    world.faults = lambda called: run.machine.request_preempt() if called == call else None
    run.world.set_level(10.0)
    assert run.machine.execute() == 'preempted'
    assert world.clock.time < 200.0


def test_a_peer_that_is_away_is_waited_for_at_once(machine: str) -> None:
    world = World()
    world.faults = fails('plan', 3, 'no server', AwayError)
    Run(machine, world).until(60.0)
    assert len([cry for cry in world.cries if 'no server' in cry]) == 3
    assert not any('another' in text for text in world.said)
    assert world.arrivals


WRONG_PATHS: list[tuple[list[Point], str]] = [
    ([], 'the path has no points'),
    ([(math.nan, 0.0, 0.0)], 'a point that is not finite'),
    ([(90.0, 90.0, 0.0)], 'from the goal, expected at most 1 m'),
]


@pytest.mark.parametrize(('path', 'words'), WRONG_PATHS)
def test_a_wrong_path_is_asked_for_again(machine: str, path: list[Point], words: str) -> None:
    world = World()
    right = world.plan_path
    wrong = iter([path] * 2)
    world.plan_path = lambda start, goal, interrupt: (
        next(  # type: ignore[method-assign]
            wrong, None
        )
        or ([] if path == [] and next(wrong, None) == [] else right(start, goal, interrupt))
    )
    Run(machine, world).until(600.0)
    assert any(words in text for text in world.said)
    assert visited(world) == set(SEVEN_ROOMS)
    assert all(math.isfinite(value) for value in world.at)


def test_a_robot_that_stops_short_tries_again(machine: str) -> None:
    world = World()
    right = world._drive
    times = [0]

    def stops_short(path: list[Point], interrupt: fsm.Interrupt) -> Point:
        times[0] += 1
        return right(path[:-1] if times[0] % 5 == 0 and len(path) > 2 else path, interrupt)

    world._drive = stops_short  # type: ignore[method-assign, assignment]
    run = Run(machine, world).until(1800.0)
    assert any('stopped' in text and 'short' in text for text in world.said)
    assert visited(world, since=1000.0) == set(SEVEN_ROOMS)
    assert run.mission.place == world.is_in


def test_a_blocked_door_is_gone_around(machine: str) -> None:
    if machine == 'patrol':
        pytest.skip('the planner goes round there')
    world = World()
    right = world.plan_path
    blocked = {POSITIONS['E'], POSITIONS['C1']}

    def plan(start: Point, goal: Point, interrupt: fsm.Interrupt) -> list[Point]:
        if {start, goal} == blocked:
            raise PeerError('compute_path', 'a closed door is in the way')
        return right(start, goal, interrupt)

    world.plan_path = plan  # type: ignore[method-assign]
    Run(machine, world).until(900.0)
    assert any('trying the way round: E - C2 - C1' in text for text in world.said)
    assert visited(world) == set(SEVEN_ROOMS)
    assert not world.cries


def test_a_place_that_disappears_is_left_out(machine: str) -> None:
    world = World()

    def vanish() -> None:
        del world.rooms['R3']
        del world.positions['R3']

    world.clock.after(100.0, vanish)
    Run(machine, world).until(900.0)
    assert visited(world, since=500.0) == set(SEVEN_ROOMS) - {'R3'}


def test_a_closed_door_leaves_the_rest_and_an_opened_one_brings_it_back(machine: str) -> None:
    world = World()
    world.clock.after(100.0, lambda: world.closed.add('D4'))
    world.clock.after(700.0, world.closed.clear)
    Run(machine, world).until(1500.0)
    between = {place for time, place in world.arrivals if 150.0 < time < 690.0}
    assert between == set(SEVEN_ROOMS) - {'R4'}
    assert 'R4' in visited(world, since=700.0)


def test_a_robot_that_is_shut_in_cries_for_help_and_goes_on_when_freed(machine: str) -> None:
    world = World()
    world.clock.after(100.0, lambda: world.closed.update(f'D{n}' for n in range(1, 8)))
    world.clock.after(400.0, world.closed.clear)
    Run(machine, world).until(1500.0)
    assert any('nothing can be reached' in cry for cry in world.cries)
    assert visited(world, since=500.0) == set(SEVEN_ROOMS)


def test_an_ontology_that_lost_the_robot_is_waited_for(machine: str) -> None:
    world = World()
    right = world.snapshot

    def snapshot(*args: object) -> object:
        if 100.0 < world.clock.time < 130.0:
            raise PeerError('armor', 'ontology map has Robot1 in no place')
        return right(*args)  # type: ignore[arg-type]

    world.snapshot = snapshot  # type: ignore[method-assign, assignment]
    Run(machine, world).until(600.0)
    assert any('in no place' in text for text in world.said)
    assert visited(world, since=200.0) == set(SEVEN_ROOMS)


@pytest.mark.parametrize('kind', [PeerError, AwayError])
def test_a_visit_that_could_not_be_told_is_told_later(
    kind: type[PeerError], machine: str, tmp_path: Path
) -> None:
    world = World()
    right = world.snapshot
    away: list[float] = []

    def snapshot(*args: object) -> object:
        if world.clock.time > 60.0 and len(away) < 7:
            away.append(world.clock.time)
            raise kind('armor', 'scripted fault')
        return right(*args)  # type: ignore[arg-type]

    world.snapshot = snapshot  # type: ignore[method-assign, assignment]
    with MissionRecord(tmp_path / 'record') as record:
        Run(machine, world, settings(), record).until(300.0)
    assert len(away) == 7
    visits = [event for event in read(tmp_path / 'record') if event.name == 'visit']
    assert [visit.text('place') for visit in visits] == [place for _, place in world.arrivals]
    last = {visit.text('place'): visit.time for visit in visits[:-1]}
    assert all(world.visited_at[place] >= int(time) for place, time in last.items())


def test_an_ontology_built_anew_is_told_of_the_visits(machine: str) -> None:
    world = World()

    def rebuild() -> None:
        before.update(world.visited_at)
        world.visited_at = dict.fromkeys(world.rooms, 0.0)

    before: dict[str, float] = {}
    world.clock.after(200.0, rebuild)
    Run(machine, world).until(212.0)
    assert all(world.visited_at[place] >= int(time) for place, time in before.items())
    unchanged = [place for place in before if int(world.visited_at[place]) == int(before[place])]
    assert len(unchanged) >= 4


def test_visits_are_known_to_a_process_that_starts_again(machine: str, tmp_path: Path) -> None:
    world, path = World(), str(tmp_path / 'record')
    Run(machine, world, experience=Experience.of_record(path)).until(200.0)
    before = dict(world.visited_at)
    # Ontology and behaviour are gone at once; nothing may count as visited that was not.
    world.visited_at = dict.fromkeys(world.rooms, 0.0)
    again = Experience.of_record(path)
    assert again.leg_times.drives
    Run(machine, world, experience=again).until(212.0)
    assert all(world.visited_at[place] >= int(time) - 4 for place, time in before.items())
    assert sum(int(world.visited_at[place]) == int(before[place]) for place in before) >= 3


def test_a_robot_that_came_to_charge_charges_enough(machine: str) -> None:
    world = World(draw=0.9, low_below=5.0)
    Run(machine, world, settings(urgency_threshold=90.0)).until(1200.0)
    times = [decision.time for decision in world.decisions if decision.rule == 'recharge']
    assert len(times) > 3
    assert min(later - sooner for sooner, later in itertools.pairwise(times)) > 40.0
    assert world.stranded == 0


def test_a_station_that_does_not_charge_is_driven_to_again_and_cried_about(machine: str) -> None:
    world = World(charge=0.0)
    world.clock.after(50.0, lambda: world.set_level(10.0))
    world.clock.after(900.0, lambda: setattr(world, 'charge', 2.0))
    run = Run(machine, world).until(2000.0)
    assert any('10 %' in cry for cry in world.cries)
    assert run.mission.battery.level != 10.0
    assert visited(world, since=1200.0) == set(SEVEN_ROOMS)


def test_the_record_holds_what_happened(machine: str, tmp_path: Path) -> None:
    world = World(draw=0.4)
    path = tmp_path / 'mission.jsonl'
    with MissionRecord(path) as record:
        Run(machine, world, record=record).until(1800.0)
    events = read(path)
    summary = summarize(events)
    assert sum(summary.visits.values()) == len(world.arrivals)
    assert set(summary.visits) == set(SEVEN_ROOMS)
    assert summary.recharges >= 2
    assert summary.distance > 900.0
    assert [event.text('place') for event in events if event.name == 'visit'] == [
        place for _, place in world.arrivals
    ]


def test_a_robot_pushed_off_its_station_goes_back_to_it_at_once(machine: str) -> None:
    world = World(draw=0.5, charge=0.5)
    pushed: list[float] = []
    run = Run(machine, world, settings(policy='tour'))
    charging = {'surveillance': 'PERFORM_ROOM_TASKS', 'patrol': 'RechargeRoutine'}[machine]

    def push() -> None:
        states = run.machine[charging].get_active_states()
        if not pushed and states in (['RECHARGE_TASK'], ['Recharge']) and world.level > 50.0:
            pushed.append(world.clock.time)
            world.push('C1')
        world.clock.after(1.0, push)

    push()
    run.until(900.0)
    assert pushed
    back = [place for time, place in world.arrivals if 0.0 < time - pushed[0] < 10.0]
    assert back == ['E']
    assert not world.cries


class Killed:
    """A mission that was killed and started again with what its record says."""

    def __init__(self, machine: str, world: World, path: Path, **choice: object) -> None:
        self.machine, self.world, self.path, self.choice = machine, world, path, choice

    def run(self, until: float) -> Run:
        left_at = cut_off(read(self.path)) if self.path.exists() else None
        with MissionRecord(self.path) as record:
            return Run(self.machine, self.world, settings(**self.choice), record, left_at).until(
                until
            )


@pytest.mark.parametrize(('killed', 'again'), [(20.0, 25.0), (29.9, 29.9), (30.0, 80.0)])
def test_a_half_finished_exploration_goes_on_after_a_kill(
    killed: float, again: float, tmp_path: Path
) -> None:
    world = World()
    mission = Killed('surveillance', world, tmp_path / 'record', exploration_seconds=30.0)
    mission.run(killed)
    world.clock.time += 100.0  # somebody starts it again
    mission.run(killed + 100.0 + 2.0)
    world.clock.time += 100.0
    mission.run(300.0)
    first = world.decisions[0]
    assert first.from_place == 'E'
    # Of each stretch at most the second since the last note is explored anew.
    lost = 0.0 if killed == 30.0 else 2.0
    assert first.time <= 200.0 + 30.0 + lost + 1.0


def test_a_place_whose_exploration_was_done_is_not_explored_again(tmp_path: Path) -> None:
    world = World()
    mission = Killed('surveillance', world, tmp_path / 'record', exploration_seconds=30.0)
    mission.run(32.0)
    assert len(world.decisions) == 1
    assert not world.arrivals
    mission.run(33.0)
    assert world.decisions[1].time == 32.0


def test_a_robot_killed_on_its_way_to_charge_still_goes_to_charge(
    machine: str, tmp_path: Path
) -> None:
    world = World()
    mission = Killed(machine, world, tmp_path / 'record')
    mission.run(100.0)
    world.set_level(15.0)
    mission.run(103.0)
    assert world.decisions[-1].rule == 'recharge'
    world.set_level(50.0)  # more than it must have, less than what it was sent to charge for
    mission.run(160.0)
    assert summarize(read(tmp_path / 'record')).recharges == 1


def test_places_that_come_and_go_on_the_way_are_counted(machine: str, tmp_path: Path) -> None:
    world = World()
    late = {room: world.rooms.pop(room) for room in ('R3', 'R4')}
    world.clock.after(60.0, lambda: world.rooms.update(R3=late['R3']))
    world.closed.add('D3')
    path = tmp_path / 'record'
    with MissionRecord(path) as record:
        Run(machine, world, settings(), record).until(200.0)
    summary = summarize(read(path))
    assert set(summary.visits) == set(SEVEN_ROOMS) - {'R4'}
    assert '5 of 6 places visited' in str(summary)
    assert summary.unvisited['R3'] < 140.0


def test_a_record_that_cannot_be_written_does_not_end_the_mission(
    machine: str, tmp_path: Path
) -> None:
    path = tmp_path / 'record'
    world = World()
    with MissionRecord(path) as record:
        run = Run(machine, world, settings(), record)
        run.until(100.0)
        limits = resource.getrlimit(resource.RLIMIT_FSIZE)
        resource.setrlimit(resource.RLIMIT_FSIZE, (path.stat().st_size + 10, limits[1]))
        try:
            run.until(200.0)
        finally:
            resource.setrlimit(resource.RLIMIT_FSIZE, limits)
        run.until(300.0)
    assert sum('cannot write the mission record' in text for text in world.said) == 1
    times = [event.time for event in read(path)]
    assert not [time for time in times if 100.0 < time < 200.0]
    assert [time for time in times if time > 200.0]


def test_settings_changed_on_the_way_count_from_the_next_choice(machine: str) -> None:
    world = World()
    mission_settings = settings()
    run = Run(machine, world, mission_settings)

    def change() -> None:
        mission_settings.choice.urgency_threshold = 500.0
        mission_settings.choice.policy = 'oldest'

    world.clock.after(200.0, change)
    run.until(500.0)
    assert world.threshold == 500.0
    assert world.decisions[-1].policy == 'oldest'
    assert {place for time, place in world.arrivals if time > 220.0} == {'C1', 'C2', 'E'}


def test_a_threshold_that_nobody_can_keep_to_is_warned_of_once(machine: str) -> None:
    world = World()
    late = world.rooms.pop('R4')
    mission_settings = settings(urgency_threshold=65.0)
    run = Run(machine, world, mission_settings)

    def lower() -> None:
        mission_settings.choice.urgency_threshold = 40.0

    world.clock.after(100.0, lambda: world.rooms.update(R4=late))
    world.clock.after(200.0, lower)
    run.until(300.0)
    warnings = [text for text in world.said if 'urgency_threshold' in text]
    assert [text.split(',')[0] for text in warnings] == [
        'urgency_threshold is 65 s',
        'urgency_threshold is 40 s',
    ]
    assert 'shortest tour of all places takes 69.6 s' in warnings[0]


@pytest.mark.parametrize('name', list(MACHINES))
def test_the_same_world_gives_the_same_mission(name: str) -> None:
    runs = [Run(name, World(draw=0.4)).until(900.0) for _ in range(2)]
    assert runs[0].transitions == runs[1].transitions
    assert runs[0].world.arrivals == runs[1].world.arrivals


def troubled(call: str, times: float, level: float, charge: float = 2.0) -> World:
    """A world in which calls fail at the start and again later, with a battery that falls."""
    world = World(charge=charge)
    world.faults = fails(call, 2.0)

    def trouble() -> None:
        world.set_level(level)
        world.faults = fails(call, times)

    world.clock.after(45.0, trouble)
    return world


def low_during(call: str) -> World:
    """A world in which the battery falls during a call."""
    world = World()

    def fall(called: str) -> None:
        if called == call and world.clock.time > 30.0 and world.level > 90.0:
            world.set_level(10.0)

    world.faults = fall
    return world


def troubled_worlds(name: str) -> Iterator[World]:
    """Worlds that together meet everything the recovery is for."""
    yield World(draw=0.5)
    yield World(draw=0.5, charge=0.0)
    for call in CALLS[name]:
        yield troubled(call, 12.0, 100.0)
        yield troubled(call, 9.0, 100.0)
        yield troubled(call, 3.0, 10.0)
        yield low_during(call)


def every_state(container: fsm.Container, path: str) -> Iterator[tuple[str, str, fsm.Container]]:
    for label, child in container.get_children().items():
        yield path, label, container
        if isinstance(child, fsm.Container):
            yield from every_state(child, f'{path}/{label}')


def test_every_transition_is_taken(machine: str) -> None:
    untaken: set[tuple[str, str, str]] | None = None
    for world in troubled_worlds(machine):
        run = Run(machine, world).until(500.0)
        untaken = run.untaken if untaken is None else untaken & run.untaken
        assert world.stranded == 0
    assert untaken is not None
    assert not {edge for edge in untaken if edge[2] != 'preempted'}


def test_a_preempt_is_heeded_in_every_state(machine: str) -> None:
    states = [
        (path, label)
        for path, label, _ in every_state(
            MACHINES[machine](World().mission(machine=machine)), machine
        )
    ]
    left = set(states)
    for number in range(len(list(troubled_worlds(machine)))):
        for wanted in sorted(left):
            world = next(itertools.islice(troubled_worlds(machine), number, None))
            run = Run(machine, world)
            for path, label, container in every_state(run.machine, machine):
                if (path, label) == wanted:
                    on_entry(container, label, run.machine.request_preempt)
            run.until(300.0)
            if (*wanted, 'preempted') not in run.untaken:
                left.discard(wanted)
    assert not left


def on_entry(container: fsm.Container, label: str, action: Callable[[], None]) -> None:
    def entered(_data: object, active: list[str]) -> None:
        if active == [label]:
            action()

    container.register_start_cb(entered)
    container.register_transition_cb(entered)
