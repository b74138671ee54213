"""How simulated time passes beside real time."""

from __future__ import annotations

import pytest

from surveillance_simulation.pace import Pace, PaceModel


def run(model: PaceModel, real: float, tick: float, *, moving: bool = True) -> float:
    """Return the simulated seconds that pass while the steady clock runs for `real` seconds."""
    pace, simulated = Pace(model, 0.0), 0.0
    for number in range(1, round(real / tick) + 1):
        simulated += pace.due(simulated, number * tick, moving=moving)
    return simulated


@pytest.mark.parametrize('speed', [0.5, 1.0, 10.0])
def test_time_goes_at_the_wanted_speed(speed: float) -> None:
    assert run(PaceModel(speed=speed), 10.0, 0.004) == pytest.approx(10.0 * speed, abs=0.11)


def test_a_late_machine_catches_up_without_bound_on_none() -> None:
    pace = Pace(PaceModel(speed=1.0, step=0.1), 0.0)
    assert pace.due(0.0, 60.0, moving=True) == pytest.approx(0.1)
    caught_up = sum(pace.due(0.0, 60.0, moving=True) for _ in range(100))
    assert caught_up == pytest.approx(0.4)


def test_as_fast_as_possible_ends_at_the_ceiling() -> None:
    model = PaceModel(speed=0.0, ceiling=50.0)
    assert run(model, 2.0, 0.0005) == pytest.approx(100.0, abs=0.2)
    assert run(model, 2.0, 0.0005, moving=False) == pytest.approx(100.0, abs=0.3)


def test_time_waits_for_the_next_command_of_a_controller_at_work() -> None:
    pace = Pace(PaceModel(speed=0.0, step=0.1, window=0.15, patience=0.2), 0.0)
    pace.command(True, 0.0)
    passed = [pace.due(0.1 * count, 0.01 * count, moving=True) for count in range(1, 6)]
    assert passed == pytest.approx([0.1, 0.0, 0.0, 0.0, 0.0])
    assert pace.is_waiting
    pace.command(True, 0.2)
    # At once: what was owed while it waited is not lost.
    assert pace.due(0.2, 0.05, moving=True) == pytest.approx(0.1)
    assert not pace.is_waiting


def test_time_waits_for_a_robot_that_works_out_where_it_is() -> None:
    pace = Pace(PaceModel(speed=0.0, estimate_window=0.45), 0.0)
    assert pace.due(0.5, 0.01, moving=False) > 0.0  # Nobody has told a pose yet.
    pace.estimate(0.5)
    assert pace.due(0.5, 0.02, moving=False) > 0.0
    assert pace.due(1.0, 0.03, moving=False) == 0.0
    assert pace.is_waiting
    pace.estimate(1.0)
    assert pace.due(1.0, 0.04, moving=False) > 0.0


def test_a_silent_program_is_given_up_until_it_answers_again() -> None:
    pace = Pace(PaceModel(speed=0.0, patience=0.2), 0.0)
    pace.command(True, 0.0)
    assert pace.due(1.0, 5.0, moving=True) == 0.0  # A machine that stood still is no silence.
    assert pace.due(1.0, 5.1, moving=True) == 0.0
    assert pace.due(1.0, 5.25, moving=True) > 0.0
    assert pace.due(1.1, 5.26, moving=True) > 0.0
    pace.command(True, 1.2)
    assert pace.due(1.4, 5.27, moving=True) == 0.0


def test_nothing_waits_when_the_base_was_told_to_stand() -> None:
    pace = Pace(PaceModel(speed=0.0), 0.0)
    pace.command(True, 0.0)
    pace.command(False, 0.1)
    assert pace.due(1.0, 0.01, moving=False) > 0.0


def test_nothing_is_waited_for_at_a_set_speed() -> None:
    pace = Pace(PaceModel(speed=1.0), 0.0)
    pace.command(True, 0.0)
    pace.estimate(0.0)
    assert pace.due(5.0, 5.0, moving=True) > 0.0
    assert not pace.is_waiting
