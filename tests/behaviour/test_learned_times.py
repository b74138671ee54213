"""What the robot knows when the machine's clock is set."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from surveillance_behaviour.learned_times import LearnedTimes


class Clock:
    """A date that may be set, and the seconds that pass."""

    def __init__(self) -> None:
        self.passed = 500.0
        self.date = 1_800_000_000.0

    def go_on(self, seconds: float, step: float = 0.0) -> float:
        self.passed += seconds
        self.date += seconds + step
        return self.date


@pytest.mark.parametrize('step', [3600.0, -3600.0, 1.0, -1.0])
def test_no_visit_gets_older_or_younger_when_the_clock_is_set(step: float) -> None:
    clock = Clock()
    learned = LearnedTimes(elapsed=lambda: clock.passed)
    learned.saw('A', clock.date)
    learned.saw('B', clock.go_on(10.0))
    now = clock.go_on(30.0, step)
    assert learned.tell_time(now) == (step if abs(step) > 1.0 else 0.0)
    ages = {place: now - at for place, at in learned.visited_at.items()}
    assert ages == pytest.approx({'A': 40.0, 'B': 30.0}, abs=1.001)


def test_a_minute_without_a_look_is_no_step() -> None:
    clock = Clock()
    learned = LearnedTimes(elapsed=lambda: clock.passed)
    learned.saw('A', clock.date)
    assert learned.tell_time(clock.go_on(60.0)) == 0.0
    assert learned.visited_at['A'] == clock.date - 60.0


def test_what_was_learned_is_read_back_whole_or_not_at_all(tmp_path: Path) -> None:
    record = str(tmp_path / 'm.jsonl')
    first = LearnedTimes.of_record(record)
    first.visited_at = {'A': 12.3456, 'B': -1.0}
    first.leg_times.observe('A', 'B', 20.0, 8.0)
    first.draw.restore([0.1])
    first.charge.restore({'E': {'4': [0.1]}})
    first.sent_to_charge, first.requested = 'the battery is low', 'B'
    first.save()
    again = LearnedTimes.of_record(record)
    assert again.problem == ''
    assert again.visited_at == {'A': 12.346, 'B': -1.0}
    assert again.leg_times.to_json() == first.leg_times.to_json()
    assert again.draw == first.draw
    assert again.charge.curves() == first.charge.curves()
    assert (again.sent_to_charge, again.requested) == ('the battery is low', 'B')
    file = tmp_path / 'm.jsonl.experience.json'
    whole = json.loads(file.read_text())
    for key, wrong in (
        ('visits', {'A': 'never'}),
        ('leg_times', {}),
        ('draw', ['fast']),
        ('charge', {'E': {'99': [0.1]}}),
    ):
        file.write_text(json.dumps({**whole, key: wrong}))
        assert LearnedTimes.of_record(record).problem.endswith('learned before is not used')
    for key in whole:
        file.write_text(json.dumps({name: each for name, each in whole.items() if name != key}))
        found = LearnedTimes.of_record(record)
        assert f"expected '{key}' in it" in found.problem
        assert (found.visited_at, found.requested, found.sent_to_charge) == ({}, '', '')
        assert found.draw.to_json() == []
    whole['draw'] = [0.1, 99.0]
    file.write_text(json.dumps(whole))
    found = LearnedTimes.of_record(record)
    assert found.problem == '1 learned values that no robot can have are left out'
    assert found.draw.to_json() == [0.1]


def test_visits_of_another_simulation_or_of_later_are_no_visits_of_now() -> None:
    learned = LearnedTimes()
    learned.saw('A', 100.0)
    learned.saw('B', 130.0)
    assert learned.tell_time(129.5) == 0.0
    assert learned.visited_at == {'A': 100.0, 'B': 130.0}, 'threads differ by as much'
    assert learned.tell_time(120.0) == 0.0
    assert learned.visited_at == {'A': 100.0}, 'B is of another simulation'
    date = 1_800_000_000.0
    of_date = LearnedTimes()
    of_date.saw('A', date)
    of_date.saw('B', date + 30.0)
    of_date.tell_time(date + 29.5)
    assert of_date.visited_at == {'A': date, 'B': date + 30.0}
    of_date.tell_time(date - 3600.0)
    ages = {place: date - 3600.0 - at for place, at in of_date.visited_at.items()}
    assert ages['B'] >= 0.0
    assert ages['A'] - ages['B'] == pytest.approx(30.0)
