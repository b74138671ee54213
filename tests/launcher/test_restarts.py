"""The pauses before restarts, and when somebody is called, by the deaths of one program."""

from __future__ import annotations

from launcher.process_watch import SILENT_START
from launcher.restarts import (
    LONGEST_AFTER_WORK,
    MOST_HITS,
    PAUSES,
    REMIND_AFTER,
    STEADY_AFTER,
    TROUBLE_DEATHS,
    TROUBLE_PERIOD,
    Restarts,
)

START = 1.5


def pauses(number: int, *, worked: bool, lived: float = START) -> list[float]:
    """Return the pauses of a program that dies so often, always the same way."""
    restarts, now, found = Restarts(), 0.0, []
    for _ in range(number):
        now += lived
        found.append(restarts.died(now, lived, worked=worked))
        now += found[-1]
    return found


def test_a_program_that_dies_in_its_start_gets_the_growing_pauses():
    assert pauses(len(PAUSES) + 2, worked=False) == [*PAUSES, PAUSES[-1], PAUSES[-1]]


def test_a_program_that_dies_in_a_slow_start_gets_them_too():
    assert pauses(len(PAUSES), worked=False, lived=2 * STEADY_AFTER) == list(PAUSES)


def test_one_that_worked_is_back_soon_however_often_it_is_hit():
    assert max(pauses(MOST_HITS, worked=True, lived=5.0)) == LONGEST_AFTER_WORK
    assert set(pauses(100, worked=True, lived=STEADY_AFTER)) == {0.0}


def test_one_that_dies_soon_after_each_ready_start_gets_growing_pauses_in_the_end():
    found = pauses(MOST_HITS + len(PAUSES) + 1, worked=True)
    assert found[MOST_HITS:] == [2.0, 2.0, 2.0, 2.0, *PAUSES[4:], PAUSES[-1]]


def test_one_that_ran_well_again_is_back_at_once():
    restarts = Restarts()
    for second in range(100):
        restarts.died(float(second), START, worked=True)
    assert restarts.died(200.0, STEADY_AFTER, worked=True) == 0.0


def test_one_failed_start_of_a_program_that_was_hit_often_costs_no_long_pause():
    restarts = Restarts()
    for second in range(10):
        restarts.died(float(second), START, worked=True)
    assert restarts.died(11.0, START, worked=False) == PAUSES[0]


def test_somebody_is_called_when_each_start_hangs():
    restarts, now = Restarts(), 0.0
    for _ in range(TROUBLE_DEATHS):
        now += SILENT_START + 5.0  # on a busy machine
        now += restarts.died(now, SILENT_START, worked=False)
    assert restarts.trouble(now)


def told(*deaths: float) -> list[str]:
    restarts, found = Restarts(), []
    for now in deaths:
        restarts.died(now, STEADY_AFTER, worked=True)
        found.append(restarts.trouble(now))
    return found


def test_somebody_is_called_once_while_it_goes_on():
    step = TROUBLE_PERIOD / (TROUBLE_DEATHS + 1)
    found = told(*(number * step for number in range(50)))
    assert [number for number, text in enumerate(found) if text] == [TROUBLE_DEATHS - 1]
    assert found[TROUBLE_DEATHS - 1] == 'died 5 times in 400 s'


def test_somebody_is_reminded_while_it_goes_on_for_days():
    restarts, now, calls = Restarts(), 0.0, 0
    while now < 10 * REMIND_AFTER:
        now += START + restarts.died(now, START, worked=True)
        calls += bool(restarts.trouble(now))
    assert calls == 10


def test_somebody_is_called_again_after_a_quiet_period():
    first = [float(number) for number in range(TROUBLE_DEATHS)]
    second = [now + first[-1] + TROUBLE_PERIOD for now in first]
    assert sum(map(bool, told(*first, *second))) == 2


def test_rare_deaths_call_nobody():
    assert not any(told(*(number * TROUBLE_PERIOD / 4 for number in range(20))))
