"""What is remembered between two decisions, and beyond the process that decides."""

from __future__ import annotations

import json
import math
import os
import threading
from collections.abc import Callable, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest

from floor_plans import PatrolRules
from patrol_policy.decision import REQUEST, DecisionSettings, NowhereToGoError
from state_machines import Interrupt
from surveillance_behaviour.decision_maker import DecisionMaker
from surveillance_behaviour.learned_times import LearnedTimes
from surveillance_behaviour.mission.mission_log import MissionRecord
from surveillance_ontology.robot_ontology import Snapshot

from .scripted_world import World

NOBODY = Interrupt()


def decision_maker(world: World, record: Path) -> DecisionMaker:
    learned = LearnedTimes.of_record(str(record))
    assert not learned.problem
    return DecisionMaker(DecisionSettings(), world, world, world.battery, learned)


def test_a_robot_between_two_places_visits_none(tmp_path: Path) -> None:
    world = World()
    model = decision_maker(world, tmp_path / 'events.jsonl')
    model.begin(1.0, NOBODY)
    world.seen_at = 2_500_000_000
    model.decide(4.0, NOBODY)
    assert model.learned.visited_at == {'E': 2.5}
    world.seen_at = 0
    model.decide(5.0, NOBODY)
    world.seen_at = 2_500_000_000
    model.decide(6.0, NOBODY)
    assert model.learned.visited_at == {'E': 5.0}, 'it was there then'
    model.request('E')
    model.decide(7.0, NOBODY)
    assert model.learned.requested == 'E', 'it is not there'


def test_a_request_outlives_the_node_that_took_it(tmp_path: Path) -> None:
    world, record = World(), tmp_path / 'events.jsonl'
    first = decision_maker(world, record)
    first.begin(1.0, NOBODY)
    assert 'goes to R4' in first.request('R4')
    decision = decision_maker(world, record).decide(2.0, NOBODY)
    assert (decision.rule, decision.place) == (REQUEST, 'R4')


@pytest.mark.parametrize('avoided', [frozenset[str](), frozenset({'R4'})])
def test_a_request_ends_when_the_robot_has_been_there_or_cannot_go(
    tmp_path: Path, avoided: frozenset[str]
) -> None:
    world, record = World(), tmp_path / 'events.jsonl'
    first = decision_maker(world, record)
    first.begin(1.0, NOBODY)
    first.request('R4')
    if not avoided:
        world.is_in = 'R4'
    assert first.decide(2.0, NOBODY, avoided).rule != REQUEST
    assert decision_maker(world, record).decide(3.0, NOBODY).rule != REQUEST


def test_a_request_behind_a_door_that_closed_is_said_and_the_patrol_goes_on() -> None:
    world, said = World(), list[str]()
    told = DecisionMaker(DecisionSettings(), world, world, world.battery, warn=said.append)
    told.begin(1.0, NOBODY)
    told.request('R4')
    world.closed.update(world.rooms['R4'])
    assert told.decide(2.0, NOBODY).rule != REQUEST
    assert told.decide(3.0, NOBODY).rule != REQUEST
    words = 'R4, as requested, cannot be reached from E: continuing without it'
    assert [each for each in said if 'R4' in each] == [words]


def test_a_request_waits_while_no_charging_place_can_be_reached() -> None:
    world, said = World(start_place='C1'), list[str]()
    told = DecisionMaker(DecisionSettings(), world, world, world.battery, warn=said.append)
    told.begin(1.0, NOBODY)
    told.request('R1')
    world.battery.set_level(1.0)
    world.closed.update(world.rooms['E'])
    with pytest.raises(NowhereToGoError, match='no charging place'):
        told.decide(2.0, NOBODY)
    assert not [each for each in said if 'continuing without' in each]
    world.battery.set_level(100.0)
    assert told.decide(3.0, NOBODY).place == 'R1'


def test_the_ontology_knows_until_when_the_robot_was_in_a_place() -> None:
    world = World()
    told = DecisionMaker(DecisionSettings(), world, world, world.battery)
    told.begin(1.0, NOBODY)
    told.decide(20.0, NOBODY)
    assert world.visited_at['E'] == 20.0


@pytest.mark.parametrize('after', [-3600.0, -5.0])
def test_a_clock_that_is_set_back_while_nobody_decides_empties_no_visit(
    tmp_path: Path, after: float
) -> None:
    world, path, date = World(), tmp_path / 'events.jsonl', 1.7e9
    with MissionRecord(path) as record:
        record.write('start', date, machine='surveillance', place='E', places=['C1', 'E'])
        record.write('visit', date + 10.0, place='C1', distance=0.0)
        record.write('visit', date + 30.0, place='E', distance=0.0)
    world.visited_at |= {'C1': date + 10.0, 'E': date + 30.0}
    told = decision_maker(world, path)
    now = date + 30.0 + after
    told.begin(now, NOBODY)
    assert told.learned.visited_at == {'C1': now - 20.0, 'E': now}


def test_a_decision_says_which_facts_clash_while_they_do(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    world = World()
    told = decision_maker(world, tmp_path / 'events.jsonl')
    told.begin(1.0, NOBODY)
    clash, right = 'ontology map is inconsistent because R4 is ROOM and R4 is DOOR', world.snapshot
    monkeypatch.setattr(world, 'snapshot', lambda *args: replace(right(*args), contradiction=clash))
    assert told.decide(2.0, NOBODY).reason.endswith('; ' + clash)
    monkeypatch.undo()
    assert 'inconsistent' not in told.decide(3.0, NOBODY).reason


def test_an_alert_is_urgent_at_once_though_its_place_has_a_longer_threshold(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    world, right = World(), World.snapshot
    rules = PatrolRules(thresholds={'R1': 86_400.0, 'R2': 86_400.0})
    told = DecisionMaker(DecisionSettings(), world, world, world.battery, rules=rules)

    def snapshot(self: World, now: float, classes: Sequence[str], *args: Any) -> Snapshot:
        assert 'ALERT' in classes
        found = right(self, now, classes, *args)
        # An ontology that knows one threshold for all, and something was noticed in R1.
        noticed = {
            'R1': frozenset({'ROOM', 'URGENT', 'ALERT'}),
            'R2': frozenset({'ROOM', 'URGENT'}),
        }
        return replace(found, classes={**found.classes, **noticed})

    monkeypatch.setattr(World, 'snapshot', snapshot)
    world.is_in = 'C1'
    decision = told.decide(2.0, NOBODY)
    assert (decision.place, decision.rule) == ('R1', 'URGENT')
    assert list(decision.scores) == ['R1']


@pytest.mark.parametrize(('seconds', 'is_urgent'), [(40.0, False), (50.0, False), (50.5, True)])
def test_a_place_is_urgent_beyond_its_own_threshold_and_not_at_it(
    monkeypatch: pytest.MonkeyPatch, seconds: float, is_urgent: bool
) -> None:
    world, right = World(), World.snapshot
    rules = PatrolRules(thresholds={'R2': 50.0})
    told = DecisionMaker(DecisionSettings(), world, world, world.battery, rules=rules)

    def snapshot(*args: Any) -> Snapshot:
        found = right(*args)
        rooms = {name: kinds - {'URGENT'} for name, kinds in found.classes.items()}
        rooms['R2'] = frozenset({'ROOM', 'URGENT'})
        return replace(found, classes=rooms, visited_at={**found.visited_at, 'R2': 100.0})

    monkeypatch.setattr(World, 'snapshot', snapshot)
    world.is_in = 'C1'
    assert (told.decide(100.0 + seconds, NOBODY).rule == 'URGENT') is is_urgent


def test_a_request_is_taken_while_somebody_looks(tmp_path: Path) -> None:
    world = World()
    told = decision_maker(world, tmp_path / 'events.jsonl')
    told.begin(1.0, NOBODY)
    answered, asked, right = threading.Event(), threading.Event(), world.snapshot

    def snapshot(*args: object) -> object:
        asked.set()
        assert answered.wait(60.0)
        return right(*args)  # type: ignore[arg-type]

    world.snapshot = snapshot  # type: ignore[method-assign, assignment]
    looking = threading.Thread(target=told.look, args=(2.0, NOBODY))
    looking.start()
    assert asked.wait(60.0)
    requesting = threading.Thread(target=told.request, args=('R4',))
    requesting.start()
    requesting.join(60.0)
    taken = not requesting.is_alive()
    answered.set()
    looking.join()
    assert taken, 'the request waits for an answer that its own thread would bring'


def test_the_shortest_tour_is_looked_for_when_the_map_changes_not_with_each_leg(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    world, lengths, warnings = World(), [], []  # type: ignore[var-annotated]

    def warning(tour: float, threshold: float) -> str:
        lengths.append(tour)
        return 'too short' if threshold < tour else ''

    monkeypatch.setattr('surveillance_behaviour.announcements.tour_warning', warning)
    settings = DecisionSettings(urgency_threshold=1e6)
    told = DecisionMaker(settings, world, world, world.battery, warn=warnings.append)
    told.begin(1.0, NOBODY)
    for drive in range(5):
        told.learned.leg_times.observe('E', 'C1', 8.0 + 0.1 * drive, 5.0, 5.0)
        told.look(2.0 + drive, NOBODY)
    assert len(lengths) <= 2, 'a tour for each leg that was learned'
    settings.urgency_threshold = 1.0
    told.look(10.0, NOBODY)
    told.look(11.0, NOBODY)
    assert warnings == ['too short']


NOT_FINITE = json.dumps(
    {
        'visits': {},
        'leg_times': {'legs': [], 'errors': []},
        'draw': [math.nan],
        'sent_to_charge': '',
    }
)


@pytest.mark.parametrize(
    'damage',
    [
        lambda path: path.write_text('[' * 9_000),
        lambda path: path.write_text(NOT_FINITE),
        os.mkfifo,
    ],
)
def test_what_was_learned_and_cannot_be_read_is_said(
    tmp_path: Path, damage: Callable[[Path], object]
) -> None:
    record = tmp_path / 'events.jsonl'
    damage(tmp_path / 'events.jsonl.experience.json')
    learned = LearnedTimes.of_record(str(record))
    assert 'what was learned before is not used' in learned.problem


def test_a_place_that_is_taken_while_somebody_looks_falsifies_no_leg() -> None:
    world = World()
    told = DecisionMaker(DecisionSettings(), world, world, world.battery)
    whole = told.look(1.0, NOBODY).graph.leg_seconds
    rules = PatrolRules(exploration={'R1': 60.0})

    def take(call: str) -> None:
        if call == 'position':
            told.take_rules(rules)

    told.take_rules(PatrolRules())
    world.faults = take
    assert told.look(2.0, NOBODY).graph.leg_seconds == whole
    world.faults = lambda call: None
    assert told.look(3.0, NOBODY).graph.own_exploration == {'R1': 60.0}


def test_who_is_sent_home_goes_to_the_station_that_is_next_from_where_the_robot_is_now() -> None:
    world = World()
    settings = DecisionSettings(recharge_rooms=('E', 'R4'))
    told = DecisionMaker(settings, world, world, world.battery)
    with pytest.raises(ValueError, match='the map is not known yet'):
        told.request('')
    told.begin(1.0, NOBODY)
    # Since that look it has come elsewhere.
    told.saw('C2', 2.0)
    assert told.request('') == 'the robot goes to R4 when it has ended what it is at'
    assert told.learned.requested == 'R4'
    told.saw('C1', 3.0)
    assert told.request('') == 'the robot goes to E when it has ended what it is at'
    told.saw('E', 4.0)
    assert told.request('') == 'the robot is in E already'
    assert told.learned.requested == ''
    told.place = ''
    assert told.request('') == 'the robot goes to E when it has ended what it is at'
    with pytest.raises(ValueError, match='R9'):
        told.request('R9')
