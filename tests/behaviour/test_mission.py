"""What a mission remembers, records, and takes up again."""

from __future__ import annotations

import resource
from pathlib import Path
from typing import Any

import pytest

from patrol_policy.rule_table import Priorities
from state_machines.exceptions import CallError, UnavailableError
from surveillance_behaviour.learned_times import LearnedTimes
from surveillance_behaviour.mission.mission_log import MissionRecord, summarize
from surveillance_runtime.event_log import read, read_all

from .machine_runs import Killed, Run, settings
from .scripted_world import SEVEN_ROOMS, World


@pytest.mark.parametrize('kind', [CallError, UnavailableError])
def test_a_visit_that_could_not_be_told_is_told_later(
    kind: type[CallError], machine: str, tmp_path: Path
) -> None:
    world = World()
    right = world.snapshot
    away: list[float] = []

    def snapshot(*args: object) -> object:
        if world.clock.time > 60.0 and len(away) < 7:
            away.append(world.clock.time)
            raise kind('armor: scripted fault')
        return right(*args)  # type: ignore[arg-type]

    world.snapshot = snapshot  # type: ignore[method-assign, assignment]
    with MissionRecord(tmp_path / 'record') as record:
        Run(machine, world, settings(), record).until(300.0)
    assert len(away) == 7
    visits = [event for event in read(tmp_path / 'record') if event.name == 'visit']
    assert [visit.text('place') for visit in visits] == [place for _, place in world.arrivals]
    last = {visit.text('place'): visit.time for visit in visits[:-1]}
    assert all(world.visited_at[place] >= int(time) for place, time in last.items())


def test_the_ontology_is_told_of_no_visit_that_the_record_lacks(
    machine: str, tmp_path: Path
) -> None:
    world = World()
    right = world.snapshot
    cut_short: list[tuple[float, str]] = []
    told: list[str] = []

    def faults(name: str) -> None:
        if name in ('follow', 'control') and world.clock.time > 60.0 and not cut_short:
            world.is_in = next(place for place in world.rooms if place != world.is_in)
            cut_short.append((world.clock.time, world.is_in))
            raise CallError(f'{name}: scripted fault')

    def snapshot(*args: Any) -> object:
        found = right(*args)
        for at, place in cut_short:
            if world.visited_at[place] >= at:
                told.append(place)
                events = read(tmp_path / 'record')
                visits = [e.text('place') for e in events if e.name == 'visit' and e.time >= at]
                assert place in visits
        return found

    world.snapshot = snapshot  # type: ignore[method-assign, assignment]
    world.faults = faults
    with MissionRecord(tmp_path / 'record') as record:
        Run(machine, world, settings(), record).until(100.0)
    assert told


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
    Run(machine, world, learned=LearnedTimes.of_record(path)).until(200.0)
    before = dict(world.visited_at)
    # Ontology and behaviour are gone at once; nothing may count as visited that was not.
    world.visited_at = dict.fromkeys(world.rooms, 0.0)
    again = LearnedTimes.of_record(path)
    assert again.leg_times.drives
    Run(machine, world, learned=again).until(212.0)
    assert all(world.visited_at[place] >= int(time) - 4 for place, time in before.items())
    assert sum(int(world.visited_at[place]) == int(before[place]) for place in before) >= 3


def test_the_record_holds_what_happened(machine: str, tmp_path: Path) -> None:
    world = World(draw=0.4)
    path = tmp_path / 'events.jsonl'
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
        limits = resource.getrlimit(resource.RLIMIT_FSIZE)
        for times, since in enumerate((100.0, 300.0), start=1):
            run.until(since)
            resource.setrlimit(resource.RLIMIT_FSIZE, (path.stat().st_size + 10, limits[1]))
            try:
                run.until(since + 100.0)
                assert max(event.time for event in read(path)) < since + 5.0
            finally:
                resource.setrlimit(resource.RLIMIT_FSIZE, limits)
            said = [each for each in world.said if 'cannot write the mission record' in each]
            assert len(said) == times
        run.until(500.0)
    arrivals = [round(at, 3) for at, _ in world.arrivals]
    assert [each.time for each in read(path) if each.name == 'visit'] == arrivals


def test_settings_changed_on_the_way_count_from_the_next_choice(
    machine: str, tmp_path: Path
) -> None:
    world = World()
    mission_settings = settings()
    record = MissionRecord(tmp_path / 'record', segment_bytes=20_000)
    run = Run(machine, world, mission_settings, record)

    def change() -> None:
        mission_settings.choice.urgency_threshold = 500.0
        mission_settings.choice.policy = 'oldest'

    world.clock.after(200.0, change)
    run.until(500.0)
    assert world.threshold == 500.0
    assert world.decisions[-1].policy == 'oldest'
    assert {place for time, place in world.arrivals if time > 220.0} == {'C1', 'C2', 'E'}
    told = [each for each in read_all(record.path) if 'urgency_threshold' in each.fields]
    assert [(each.name, each.number('urgency_threshold')) for each in told] == [
        ('start', 30.0),
        ('decision', 500.0),
    ]
    run.until(5000.0)
    assert read(record.path)[0].name == 'snapshot'
    assert summarize(read(record.path)).threshold == 500.0


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


def test_a_rule_of_a_class_that_the_ontology_does_not_have_is_told_once(machine: str) -> None:
    world = World()
    mission_settings = settings()
    mission_settings.choice.priorities = Priorities(('URGANT', 'CORRIDOR'))
    Run(machine, world, mission_settings).until(100.0)
    assert [text for text in world.said if 'rooms_priority' in text] == [
        "rooms_priority: the ontology has no class 'URGANT' of places, expected 'URGENT'; "
        'the rule applies once a place is in such a class'
    ]
