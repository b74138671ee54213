"""The battery model: bounds, energy balance, and the charging curve in closed form."""

from __future__ import annotations

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from surveillance_controllers.battery import BatteryModel, BatteryParameters

LEVELS = st.floats(0, 100)
TIMES = st.floats(0, 100_000)


def test_an_hour_at_rest_takes_the_rest_power_as_watt_hours() -> None:
    battery = BatteryModel(BatteryParameters(capacity=50, rest_power=10))
    assert battery.draw(3600) == pytest.approx(10)
    assert battery.level == pytest.approx(80)


def test_driving_turning_and_equipment_each_add_their_own_energy() -> None:
    parameters = BatteryParameters(
        capacity=1, rest_power=0, joules_per_metre=36, joules_per_radian=18, equipment_power=3.6
    )
    battery = BatteryModel(parameters)
    assert battery.draw(1, metres=1) == pytest.approx(0.01)
    assert battery.draw(1, radians=1) == pytest.approx(0.005)
    assert battery.draw(10, equipment_seconds=10) == pytest.approx(0.01)


def test_percent_says_100_only_when_full_and_0_in_the_last_percent() -> None:
    battery = BatteryModel(BatteryParameters(), 99.9)
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
    battery = BatteryModel(BatteryParameters(), level)
    before = battery.energy
    taken = battery.draw(seconds, metres, radians)
    assert battery.energy >= 0
    assert taken == pytest.approx(before - battery.energy)


@given(level=LEVELS, first=TIMES, second=TIMES)
@settings(max_examples=60)
def test_charging_in_two_steps_is_charging_in_one(
    level: float, first: float, second: float
) -> None:
    twice, once = BatteryModel(BatteryParameters(), level), BatteryModel(BatteryParameters(), level)
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

    battery = BatteryModel(BatteryParameters(), 0)
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
    battery = BatteryModel(BatteryParameters())
    with pytest.raises(ValueError, match='negative amount'):
        battery.draw(-1)
    with pytest.raises(ValueError, match='expected 0 or more'):
        battery.charge(-1)


def integrated(
    level: float, seconds: float, parameters: BatteryParameters, rate: float | None = None
) -> float:
    """Return the level after charging in steps of a second, as the module describes its course."""
    p, charge = parameters, level / 100
    full = p.charging_power if rate is None else rate / 100 * p.capacity * 60
    for _ in range(round(seconds)):
        missing = (1 - charge) / (1 - p.taper_from)
        power = full * (1.0 if charge < p.taper_from else max(p.taper_floor, missing))
        charge = min(1.0, charge + power / 3600 / p.capacity)
    return 100 * charge


@pytest.mark.parametrize('rate', [None, 20.0])
@pytest.mark.parametrize(
    ('level', 'seconds'),
    [(0, 60), (70, 60), (70, 400), (90, 120), (90, 900), (97.5, 60), (99.5, 60), (100, 60)],
)
def test_the_closed_form_is_the_course_that_small_steps_take(
    level: float, seconds: float, rate: float | None
) -> None:
    parameters = BatteryParameters(capacity=20.0, charging_power=300.0, taper_from=0.8)
    battery = BatteryModel(parameters, level)
    battery.charge(seconds, rate)
    expected = integrated(level, seconds, parameters, rate)
    assert battery.level == pytest.approx(expected, abs=0.15)
    assert (battery.level == 100) == (expected == 100)


def test_the_station_gives_less_as_the_battery_fills() -> None:
    battery = BatteryModel(BatteryParameters(charging_power=600.0, taper_from=0.8, taper_floor=0.1))
    powers = []
    for level in (0, 79.9, 80, 90, 97, 98, 99.9, 100):
        battery.set_level(level)
        powers.append(battery.charging_power())
    assert powers == pytest.approx([600, 600, 600, 300, 90, 60, 60, 0])


def test_whole_percent_are_those_that_were_set() -> None:
    for capacity in (40.0, 7.3, 0.9):
        battery = BatteryModel(BatteryParameters(capacity=capacity))
        for level in range(101):
            battery.set_level(level)
            assert battery.percent == level
    battery.set_level(130)
    assert battery.level == 100
    battery.set_level(-4)
    assert battery.level == 0


def test_the_voltage_is_a_line_between_empty_and_full() -> None:
    battery = BatteryModel(BatteryParameters(empty_voltage=18.0, full_voltage=25.0), 0.0)
    assert battery.voltage == 18.0
    battery.set_level(50)
    assert battery.voltage == 21.5
    battery.set_level(100)
    assert battery.voltage == 25.0


def test_sizes_on_the_edge_are_taken_and_the_others_are_not() -> None:
    BatteryParameters(
        rest_power=0.0,
        joules_per_metre=0.0,
        joules_per_radian=0.0,
        equipment_power=0.0,
        taper_floor=1.0,
    )
    for values in (
        {'charging_power': 0.0},
        {'empty_voltage': 0.0},
        {'joules_per_metre': -0.1},
        {'joules_per_radian': -0.1},
        {'equipment_power': -0.1},
        {'taper_from': 0.0},
        {'taper_floor': 1.01},
        {'full_voltage': 18.0},
    ):
        with pytest.raises(ValueError, match=f'{next(iter(values))} is .*: expected '):
            BatteryParameters(**values)


def test_nothing_used_takes_nothing() -> None:
    battery = BatteryModel(BatteryParameters(), 50)
    assert battery.draw(0) == 0
    battery.charge(0)
    assert battery.level == 50
    for used in ({'metres': -1.0}, {'radians': -1.0}, {'equipment_seconds': -1.0}):
        with pytest.raises(ValueError, match='negative amount'):
            battery.draw(1, **used)
