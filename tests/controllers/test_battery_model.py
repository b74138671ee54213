"""The battery model: bounds, energy balance, and the charging curve in closed form."""

from __future__ import annotations

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from surveillance_controllers.battery import Battery, BatteryParameters

LEVELS = st.floats(0, 100)
TIMES = st.floats(0, 100_000)


def test_an_hour_at_rest_takes_the_rest_power_as_watt_hours() -> None:
    battery = Battery(BatteryParameters(capacity=50, rest_power=10))
    assert battery.draw(3600) == pytest.approx(10)
    assert battery.level == pytest.approx(80)


def test_driving_turning_and_equipment_each_add_their_own_energy() -> None:
    parameters = BatteryParameters(
        capacity=1, rest_power=0, joules_per_metre=36, joules_per_radian=18, equipment_power=3.6
    )
    battery = Battery(parameters)
    assert battery.draw(1, metres=1) == pytest.approx(0.01)
    assert battery.draw(1, radians=1) == pytest.approx(0.005)
    assert battery.draw(10, equipment_seconds=10) == pytest.approx(0.01)


def test_percent_says_100_only_when_full_and_0_in_the_last_percent() -> None:
    battery = Battery(BatteryParameters(), 99.9)
    assert battery.percent == 99
    battery.set_level(100)
    assert battery.percent == 100
    battery.set_level(0.9)
    assert battery.percent == 0


@given(level=LEVELS, seconds=TIMES, metres=st.floats(0, 1e5), radians=st.floats(0, 1e5))
@settings(max_examples=60)
def test_a_battery_never_gives_more_than_it_holds(
    level: float, seconds: float, metres: float, radians: float
) -> None:
    battery = Battery(BatteryParameters(), level)
    before = battery.energy
    taken = battery.draw(seconds, metres, radians)
    assert battery.energy >= 0
    assert taken == pytest.approx(before - battery.energy)


@given(level=LEVELS, first=TIMES, second=TIMES)
@settings(max_examples=60)
def test_charging_in_two_steps_is_charging_in_one(
    level: float, first: float, second: float
) -> None:
    twice, once = Battery(BatteryParameters(), level), Battery(BatteryParameters(), level)
    twice.charge(first)
    twice.charge(second)
    once.charge(first + second)
    assert twice.energy == pytest.approx(once.energy)
    assert once.energy <= once.parameters.capacity


def test_the_last_fifth_charges_slower_than_the_first() -> None:
    def seconds_to(level: float) -> int:
        seconds = 0
        while battery.level < level:
            battery.charge(1.0)
            seconds += 1
        return seconds

    battery = Battery(BatteryParameters(), 0)
    to_20 = seconds_to(20)
    battery.set_level(80)
    assert seconds_to(100) > 2 * to_20
    battery.set_level(80)
    assert battery.charging_power() == pytest.approx(battery.parameters.charging_power)
    battery.set_level(100)
    assert battery.charging_power() == 0


@pytest.mark.parametrize(
    ('values', 'text'),
    [
        ({'capacity': 0.0}, 'capacity is 0.0: expected more than 0'),
        ({'rest_power': -1.0}, 'rest_power is -1.0: expected 0 or more'),
        ({'taper_from': 1.0}, 'taper_from is 1.0: expected between 0 and 1'),
        ({'taper_floor': 0.0}, 'taper_floor is 0.0: expected above 0, at most 1'),
        ({'full_voltage': 1.0}, 'full_voltage is 1.0: expected above empty_voltage 18.0'),
    ],
)
def test_bad_sizes_are_named(values: dict[str, float], text: str) -> None:
    with pytest.raises(ValueError, match=text):
        BatteryParameters(**values)


def test_negative_amounts_are_refused() -> None:
    battery = Battery(BatteryParameters())
    with pytest.raises(ValueError, match='negative amount'):
        battery.draw(-1)
    with pytest.raises(ValueError, match='expected 0 or more'):
        battery.charge(-1)
