"""The battery in a robot: way, turn and arm drain it; it charges at the station only."""

from __future__ import annotations

import math

import pytest

from floor_plans import Station
from surveillance_controllers.battery import BatteryInUse, BatteryModel, BatteryParameters
from surveillance_runtime.robot_arm import TrajectoryPoint

PARAMETERS = BatteryParameters(
    capacity=1.0,
    rest_power=0.0,
    joules_per_metre=36.0,
    joules_per_radian=18.0,
    equipment_power=36.0,
    charging_power=36.0,
)


def in_use(level: float = 50.0) -> tuple[BatteryModel, BatteryInUse]:
    battery = BatteryModel(PARAMETERS, level)
    return battery, BatteryInUse(battery, {'E': Station((1.0, 0.0, 0.0))}, 0.5, since=0.0)


def move_arm(use: BatteryInUse, seconds: float, now: float, pan: float = 1.0) -> None:
    use.move_arm(['arm_pan'], [TrajectoryPoint(seconds, (pan,))], now)


def test_way_and_turn_are_paid_for() -> None:
    battery, use = in_use()
    for step in range(11):
        use.see_pose((3.0 + 0.1 * step, 0.0, 0.1 * step), now=0.2 * step)
    use.advance(2.0)
    assert battery.energy == pytest.approx(0.5 - (36 * 1.0 + 18 * 1.0) / 3600)


def test_a_correction_of_the_estimate_is_no_way_driven() -> None:
    battery, use = in_use()
    use.see_pose((3.0, 0.0, 0.0), 0.0)
    use.see_pose((8.0, 0.0, math.pi), 0.1)
    use.advance(0.1)
    assert battery.energy == pytest.approx(0.5 - (36 * 0.2 + 18 * 0.3) / 3600)
    use.advance(0.2)
    assert battery.energy == pytest.approx(0.5 - (36 * 0.2 + 18 * 0.3) / 3600)


def test_the_arm_is_paid_for_while_it_moves() -> None:
    battery, use = in_use()
    use.advance(1.0)
    assert battery.energy == 0.5
    move_arm(use, 5.0, now=1.0)
    use.advance(2.0)
    assert battery.energy == pytest.approx(0.49)
    move_arm(use, 0.5, now=2.5)
    use.advance(4.0)
    assert battery.energy == pytest.approx(0.48)
    use.advance(5.0)
    assert battery.energy == pytest.approx(0.48)


def test_a_trajectory_that_the_arm_refuses_costs_nothing_and_stops_nothing() -> None:
    battery, use = in_use()
    use.advance(1.0)
    move_arm(use, 5.0, now=1.0, pan=9.0)
    use.advance(2.0)
    assert battery.energy == 0.5
    move_arm(use, 2.0, now=2.0)
    use.move_arm(['elbow'], [], now=2.5)
    use.advance(6.0)
    assert battery.energy == pytest.approx(0.48)
    move_arm(use, 5.0, now=6.0)
    use.move_arm([], [], now=7.0)
    use.advance(9.0)
    assert battery.energy == pytest.approx(0.47)


def test_a_trajectory_without_an_end_does_not_drain_the_battery() -> None:
    battery, use = in_use()
    use.advance(0.0)
    move_arm(use, 2.0**31, now=0.0)
    use.advance(600.0)
    drawn = 0.5 - battery.energy
    move_arm(use, 20.0, now=600.0)
    use.advance(1200.0)
    assert 0.5 - battery.energy == pytest.approx(2.0 * drawn)


def test_it_charges_at_the_station_only_and_says_why_not_elsewhere() -> None:
    battery, use = in_use()
    assert use.why_not_charging() == ('where the robot is is not known (nothing came on amcl_pose)')
    use.see_pose((3.0, 0.0, 0.0), now=0.0)
    use.advance(10.0)
    assert battery.level == 50
    assert use.why_not_charging() == 'the robot is at (3.00, 0.00), not at the station (1.00, 0.00)'
    _, docked = in_use()
    docked.see_pose((1.3, 0.3, 2.0), now=0.0)
    assert docked.why_not_charging() is None
    docked.advance(10.0)
    assert docked.docked


def test_a_clock_that_goes_back_takes_nothing() -> None:
    battery, use = in_use()
    use.see_pose((1.0, 0.0, 0.0), now=5.0)
    use.advance(5.0)
    before = battery.energy
    use.advance(2.0)
    assert battery.energy == before


def test_a_station_that_was_moved_charges_where_it_is_now() -> None:
    use = in_use()[1]
    use.see_pose((1.0, 0.0, 0.0), 0.0)
    assert use.docked
    use.take_stations({'C': Station((7.0, 0.0, 0.0))})
    assert not use.docked
    assert '(7.00, 0.00)' in (use.why_not_charging() or '')
    use.see_pose((7.0, 0.0, 0.0), 1.0)
    assert use.docked


def test_a_station_with_a_rate_charges_by_it() -> None:
    battery = BatteryModel(PARAMETERS, 10.0)
    stations = {'E': Station((1.0, 0.0, 0.0), 30.0), 'W': Station((9.0, 0.0, 0.0))}
    use = BatteryInUse(battery, stations, 0.5, since=0.0)
    use.see_pose((1.0, 0.5, 0.0), 0.0)
    use.advance(60.0)
    assert battery.level == pytest.approx(40.0)
    use.see_pose((1.0, 0.51, 0.0), 61.0)
    assert use.why_not_charging() == (
        'the robot is at (1.00, 0.51), not at a station (1.00, 0.00) or (9.00, 0.00)'
    )


def test_a_day_away_is_counted_and_a_longer_time_is_another_clock() -> None:
    parameters = BatteryParameters(capacity=100.0, rest_power=1.0)
    for passed, drawn in ((86_400.0, 24.0), (86_401.0, 0.0), (0.0, 0.0), (-1.0, 0.0)):
        battery = BatteryModel(parameters)
        BatteryInUse(battery, {}, 0.5, since=50.0).advance(50.0 + passed)
        assert battery.energy == pytest.approx(100.0 - drawn)
    battery = BatteryModel(parameters)
    use = BatteryInUse(battery, {}, 0.5, since=None)
    use.advance(5000.0)
    assert battery.level == 100, 'when time first passes nothing was drawn'
    use.advance(8600.0)
    assert battery.energy == pytest.approx(99.0)


def test_what_somebody_else_accounts_for_is_not_counted_again() -> None:
    battery, use = in_use()
    use.see_pose((3.0, 0.0, 0.0), 0.0)
    move_arm(use, 4.0, now=0.0)
    use.see_pose((4.0, 0.0, 1.0), 2.0)
    use.skip(2.0)
    use.advance(2.0)
    assert battery.energy == 0.5
    use.advance(5.0)
    assert battery.energy == pytest.approx(0.48), 'two of the four seconds of the arm'


def test_turns_over_the_half_circle_are_counted_the_short_way() -> None:
    battery, use = in_use()
    use.see_pose((3.0, 0.0, 3.0), 0.0)
    use.see_pose((3.0, 0.0, -3.0), 1.0)
    use.see_pose((3.0, 0.0, 3.0), 1.0)  # of the same time: no turn that could be driven
    use.see_pose((3.0, 0.0, 3.1), 2.0)
    use.advance(2.0)
    turned = math.tau - 6.0 + 0.1
    assert battery.energy == pytest.approx(0.5 - 18 * turned / 3600)


def test_the_arm_is_counted_for_20_s_at_the_most() -> None:
    battery, use = in_use()
    move_arm(use, 100.0, now=0.0)
    use.advance(100.0)
    assert battery.energy == pytest.approx(0.5 - 36 * 20 / 3600)
