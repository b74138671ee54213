"""How simulated time passes beside real time."""

from __future__ import annotations

import math

import pytest

from surveillance_simulation.clock_rate import LOOKED_OVER, OBEYS_WITHIN, ClockRate, ClockRateModel


def run(model: ClockRateModel, real: float, tick: float, *, moving: bool = True) -> float:
    """Return the simulated seconds that pass while the steady clock runs for `real` seconds."""
    rate, simulated = ClockRate(model, 0.0), 0.0
    for number in range(1, round(real / tick) + 1):
        simulated += rate.due(simulated, number * tick, moving=moving)
    return simulated


@pytest.mark.parametrize('speed', [0.5, 1.0, 10.0])
def test_time_goes_at_the_wanted_speed(speed: float) -> None:
    assert run(ClockRateModel(speed=speed), 10.0, 0.004) == pytest.approx(10.0 * speed, abs=0.11)


def test_a_late_machine_catches_up_without_bound_on_none() -> None:
    rate = ClockRate(ClockRateModel(speed=1.0, step=0.1), 0.0)
    assert rate.due(0.0, 60.0, moving=True) == pytest.approx(0.1)
    caught_up = sum(rate.due(0.0, 60.0, moving=True) for _ in range(100))
    assert caught_up == pytest.approx(0.4)


def test_as_fast_as_possible_ends_at_the_ceiling() -> None:
    model = ClockRateModel(speed=0.0, ceiling=50.0)
    assert run(model, 2.0, 0.0005) == pytest.approx(100.0, abs=0.2)
    assert run(model, 2.0, 0.0005, moving=False) == pytest.approx(100.0, abs=0.3)


def test_time_waits_for_the_next_command_of_a_controller_at_work() -> None:
    rate = ClockRate(ClockRateModel(speed=0.0, step=0.1, window=0.15, patience=0.2), 0.0)
    rate.robots[0].command(True, 0.0)
    passed = [rate.due(0.1 * count, 0.01 * count, moving=True) for count in range(1, 6)]
    assert passed == pytest.approx([0.1, 0.0, 0.0, 0.0, 0.0])
    assert rate.is_waiting
    rate.robots[0].command(True, 0.2)
    # At once: what was owed while it waited is not lost.
    assert rate.due(0.2, 0.05, moving=True) == pytest.approx(0.1)
    assert not rate.is_waiting


def test_time_waits_for_a_robot_that_works_out_where_it_is() -> None:
    rate = ClockRate(ClockRateModel(speed=0.0, estimate_window=0.45), 0.0)
    assert rate.due(0.5, 0.01, moving=False) > 0.0  # Nobody has told a pose yet.
    rate.robots[0].estimate(0.5)
    assert rate.due(0.5, 0.02, moving=False) > 0.0
    assert rate.due(1.0, 0.03, moving=False) == 0.0
    assert rate.is_waiting
    rate.robots[0].estimate(1.0)
    assert rate.due(1.0, 0.04, moving=False) > 0.0


def test_a_silent_program_is_given_up_until_it_answers_again() -> None:
    rate = ClockRate(ClockRateModel(speed=0.0, patience=0.2), 0.0)
    rate.robots[0].command(True, 0.0)
    assert rate.due(1.0, 5.0, moving=True) == 0.0  # A machine that stood still is no silence.
    assert rate.due(1.0, 5.1, moving=True) == 0.0
    assert rate.due(1.0, 5.25, moving=True) > 0.0
    assert rate.due(1.1, 5.26, moving=True) > 0.0
    rate.robots[0].command(True, 1.2)
    assert rate.due(1.4, 5.27, moving=True) == 0.0


def test_nothing_waits_when_the_base_was_told_to_stand() -> None:
    rate = ClockRate(ClockRateModel(speed=0.0), 0.0)
    rate.robots[0].command(True, 0.0)
    rate.robots[0].command(False, 0.1)
    assert rate.due(1.0, 0.01, moving=False) > 0.0


def test_nothing_is_waited_for_at_a_set_speed() -> None:
    rate = ClockRate(ClockRateModel(speed=1.0), 0.0)
    rate.robots[0].command(True, 0.0)
    rate.robots[0].estimate(0.0)
    assert rate.due(5.0, 5.0, moving=True) > 0.0
    assert not rate.is_waiting


def test_a_command_ends_an_idle_step_that_may_go_no_faster() -> None:
    rate = ClockRate(ClockRateModel(speed=0.0, ceiling=1.0, idle_step=5.0), 0.0)
    assert rate.due(0.0, 0.01, moving=False) == 0.0
    assert rate.pause is not None
    assert rate.pause <= OBEYS_WITHIN, 'the command waits for the end of the idle step'
    assert rate.due(0.0, 0.2, moving=True) == 0.1


def test_time_stands_at_the_end_of_the_mission_s_wait_until_it_waits_again() -> None:
    rate = ClockRate(ClockRateModel(speed=0.0, idle_step=0.5), 0.0)
    rate.robots[0].mission_waits(10.2)
    assert rate.due(10.0, 0.01, moving=False) == pytest.approx(0.2)
    assert rate.due(10.2, 0.02, moving=False) == 0.0
    assert rate.is_waiting
    rate.robots[0].mission_waits(12.2)
    assert rate.due(10.2, 0.03, moving=False) > 0.0


def test_a_drive_takes_time_and_a_plan_takes_none() -> None:
    rate = ClockRate(ClockRateModel(speed=0.0), 0.0)
    rate.robots[0].mission_waits(1.0)
    rate.robots[0].goals('compute_path', 1.0, executed=True)
    assert rate.due(1.0, 0.01, moving=False) == 0.0
    rate.robots[0].goals('compute_path', 1.0, executed=False)
    rate.robots[0].goals('follow_path', 1.0, executed=True)
    assert rate.due(1.0, 0.02, moving=False) == pytest.approx(0.1)
    rate.robots[0].command(True, 1.1)
    rate.robots[0].goals('follow_path', 1.1, executed=False)
    assert rate.due(1.1, 0.03, moving=False) == 0.0


def test_a_drive_whose_goal_is_told_again_still_waits_for_its_command() -> None:
    """The status of an action's goals comes once more with each new goal."""
    rate = ClockRate(ClockRateModel(speed=0.0), 0.0)
    rate.robots[0].goals('follow_path', 0.0, executed=True)
    assert rate.due(0.0, 0.01, moving=False) > 0.0
    rate.robots[0].goals('follow_path', 0.1, executed=True)
    rate.robots[0].goals('compute_path', 0.1, executed=True)
    rate.robots[0].goals('compute_path', 0.1, executed=False)
    assert rate.due(0.1, 0.02, moving=False) == 0.0


def test_a_drive_has_its_command_at_every_step_also_while_the_robot_stands() -> None:
    rate = ClockRate(ClockRateModel(speed=0.0), 0.0)
    rate.robots[0].goals('follow_path', 0.0, executed=True)
    assert rate.due(0.0, 0.01, moving=False) > 0.0
    assert rate.due(0.1, 0.02, moving=False) == 0.0, 'the first command is waited for'
    rate.robots[0].command(False, 0.1)
    assert rate.due(0.1, 0.03, moving=False) > 0.0
    assert rate.due(0.2, 0.04, moving=False) == 0.0, 'the robot is told to stand, and again'
    rate.robots[0].command(False, 0.2)
    rate.robots[0].goals('follow_path', 0.2, executed=False)
    assert rate.due(0.2, 0.05, moving=False) > 0.0
    assert rate.due(0.7, 0.06, moving=False) > 0.0, 'nobody drives'


def test_a_mission_that_died_does_not_stop_time_for_good() -> None:
    rate = ClockRate(ClockRateModel(speed=0.0, patience=0.2), 0.0)
    rate.robots[0].mission_waits(1.0)
    assert rate.due(1.0, 5.0, moving=False) == 0.0
    assert rate.due(1.0, 5.3, moving=False) > 0.0
    rate.robots[0].mission_waits(1.5)
    assert rate.due(1.5, 5.4, moving=False) == 0.0


def test_a_mission_that_waits_for_an_event_holds_nothing_back() -> None:
    rate = ClockRate(ClockRateModel(speed=0.0), 0.0)
    rate.robots[0].mission_waits(math.inf)
    assert rate.due(100.0, 0.01, moving=False) > 0.0


def test_time_waits_until_the_ontology_has_the_place_as_long_as_somebody_writes_it() -> None:
    rate = ClockRate(ClockRateModel(speed=0.0), 0.0)
    rate.robots[0].place_told(1.0)
    assert rate.due(1.0, 1.0, moving=True) > 0.0, 'nobody writes places'
    rate.robots[0].place_written(1.0)
    rate.robots[0].place_told(2.0)
    assert rate.due(2.0, 2.0, moving=True) == 0.0
    rate.robots[0].place_written(2.0)
    assert rate.due(2.0, 2.1, moving=True) > 0.0
    rate.robots[0].place_told(3.0)
    assert rate.due(3.0, 3.0, moving=True) == 0.0
    assert rate.due(3.0, 6.1, moving=True) > 0.0, 'given up after its patience'


def test_time_waits_for_who_looks_where_the_arm_has_come_to_rest() -> None:
    rate = ClockRate(ClockRateModel(speed=0.0, look_window=0.2), 0.0)
    assert not rate.waits(0.0, 0.0)
    rate.robots[0].arm_moves(2.0)
    assert not rate.waits(2.1, 0.1)
    assert rate.waits(2.2, 0.2)  # until its controller sees that it rests
    rate.robots[0].arm_rests(2.2)
    assert not rate.waits(2.3, 0.3)
    assert rate.waits(2.4, 0.4)  # until a picture of that view is read
    assert rate.awaits_picture
    rate.robots[0].picture_read(1.9)
    assert rate.waits(2.4, 0.5)
    rate.robots[0].picture_read(2.3)
    assert not rate.waits(2.4, 0.6)
    assert rate.waits(2.5, 0.7)
    assert not rate.waits(5.3, 0.8)  # nobody looks for so long
    rate.robots[0].picture_read(5.3)
    assert not rate.waits(9.0, 0.9)


def test_at_a_set_speed_time_waits_for_the_command_after_a_measurement() -> None:
    rate = ClockRate(ClockRateModel(speed=10.0, window=0.15, patience=1.0), 0.0)
    rate.robots[0].command(True, 0.0)
    passed = [rate.due(0.1 * count, 0.01 * count, moving=True) for count in range(1, 6)]
    assert passed == pytest.approx([0.1, 0.0, 0.0, 0.0, 0.0])
    rate.robots[0].command(True, 0.2)
    assert rate.due(0.2, 0.051, moving=True) == pytest.approx(0.1)
    # What passed while it waited is not caught up with in leaps.
    assert rate.due(0.3, 0.0511, moving=True) == 0.0


@pytest.mark.parametrize(('tick', 'is_slow'), [(0.005, False), (0.05, True)])
def test_a_machine_that_does_not_keep_up_is_told(tick: float, is_slow: bool) -> None:
    rate = ClockRate(ClockRateModel(speed=10.0), 0.0)
    simulated = now = 0.0
    while now < LOOKED_OVER:
        assert rate.too_slow(now) is None
        now += tick
        simulated += rate.due(simulated, now, moving=True)
    reached = rate.too_slow(now)
    assert (reached is not None) == is_slow
    assert reached is None or reached == pytest.approx(2.0, abs=0.1)
