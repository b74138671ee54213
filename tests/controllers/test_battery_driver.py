"""What drivers of batteries say: up to where a value is taken, and when one speaks or charges."""

from __future__ import annotations

import math

import pytest

from surveillance_controllers.battery_driver import (
    DrivenBattery,
    DriverSettings,
    doubt,
    level_from,
)

SHARE = DriverSettings()
PERCENT = DriverSettings(full=100.0)
VOLTS = DriverSettings(voltages=(10.0, 0.0, 11.0, 20.0, 12.0, 100.0))


def test_a_gauge_may_say_a_fifth_more_than_full() -> None:
    assert level_from(1.2, 0.0, SHARE) == 100.0
    assert level_from(120.0, 0.0, PERCENT) == 100.0
    for said, settings, ending in (
        (1.21, SHARE, 'percentage 1.21: expected 0 to 1; battery.full: 100 in the profile fits it'),
        (120.0, SHARE, 'expected 0 to 1; battery.full: 100 in the profile fits it'),
        (121.0, SHARE, 'percentage 121: expected 0 to 1'),
        (121.0, PERCENT, 'percentage 121: expected 0 to 100'),
        (-0.01, SHARE, 'percentage -0.01: expected 0 to 1'),
    ):
        with pytest.raises(ValueError, match=r'.') as found:
            level_from(said, 10.0, settings)
        assert str(found.value).endswith(ending)


def test_a_message_that_nobody_filled_is_none_and_an_empty_battery_is_one() -> None:
    for voltage in (0.0, -1.0, math.nan):
        with pytest.raises(ValueError, match=f'percentage is 0 and voltage {voltage:g}, as in'):
            level_from(0.0, voltage, SHARE)
    assert level_from(0.0, 0.1, SHARE) == 0.0
    assert level_from(0.0, 0.0, SHARE, present=True) == 0.0
    assert level_from(0.001, 0.0, SHARE) == 0.1


def test_a_voltage_is_read_from_its_curve() -> None:
    found = [level_from(math.nan, volts, VOLTS) for volts in (9.0, 10.0, 10.5, 11.0, 11.5, 12.5)]
    assert found == [0.0, 0.0, 10.0, 20.0, 60.0, 100.0]
    for voltage in (0.0, -3.0, math.inf):
        with pytest.raises(ValueError, match=r'expected V, for battery\.voltages'):
            level_from(0.5, voltage, VOLTS)


def test_a_share_of_32_bits_is_whole_percent() -> None:
    assert level_from(0.05999999865889549, 0.0, SHARE) == 6.0
    assert level_from(0.123456, 0.0, SHARE) == 12.346


def test_a_share_is_doubted_where_percent_are_expected_only() -> None:
    assert doubt(0.8, PERCENT) == (
        'percentage 0.8 is taken for 0.8 %, for battery.full is 100 in the profile: '
        'expected 1 there where the driver tells a share from 0 to 1'
    )
    assert doubt(1.0, PERCENT)
    assert not doubt(1.01, PERCENT)
    assert not doubt(0.5, SHARE)
    assert doubt(0.5, DriverSettings(full=2.0)).startswith('percentage 0.5 is taken for 25 %')
    assert not doubt(0.5, DriverSettings(full=100.0, voltages=VOLTS.voltages))


def test_a_driver_speaks_until_its_timeout() -> None:
    battery = DrivenBattery(DriverSettings(timeout=5.0))
    assert not battery.speaks(0.0)
    assert (battery.level, battery.charging) == (None, None)
    battery.hear(0.5, 11.0, None, 100.0)
    assert (battery.level, battery.charging) == (50.0, None)
    assert battery.speaks(105.0)
    assert not battery.speaks(105.01)
    with pytest.raises(ValueError, match='not a number'):
        battery.hear(math.nan, 11.0, None, 200.0)
    assert not battery.speaks(200.0), 'what tells no charge is not heard'
    battery.hear(0.0, 0.0, True, 300.0, present=True)
    assert (battery.level, battery.charging) == (0.0, True)


def test_that_it_does_not_charge_is_told_once_the_dock_had_its_time() -> None:
    battery = DrivenBattery(SHARE)
    assert battery.why_not_charging(0.0, 1000.0) is None
    battery.hear(0.5, 11.0, False, 100.0)
    battery.hear(0.5, 11.0, False, 104.0)
    assert battery.why_not_charging(50.0, 109.9) is None
    assert battery.why_not_charging(50.0, 110.0) == (
        'the driver of the battery says for 10 s that it does not charge'
    )
    assert battery.why_not_charging(105.0, 114.9) is None, 'it was asked for later'
    assert battery.why_not_charging(105.0, 115.0)
    battery.hear(0.5, 11.0, None, 116.0)
    assert battery.why_not_charging(50.0, 116.0) is None, 'it does not say any more'
    battery.hear(0.5, 11.0, False, 120.0)
    assert battery.why_not_charging(50.0, 129.9) is None
    battery.hear(0.5, 11.0, True, 130.0)
    assert battery.why_not_charging(50.0, 200.0) is None


def test_a_full_battery_that_is_nearly_empty_by_its_voltage_is_not_believed() -> None:
    battery = DrivenBattery(DriverSettings())
    with pytest.raises(ValueError, match=r'says full, and 9.8 V say nearly empty'):
        battery.hear(1.0, 9.8, None, 0.0)
    battery.hear(1.0, 12.4, None, 1.0)
    assert battery.level == 100.0


def test_a_driver_that_counts_down_to_one_percent_is_not_full() -> None:
    battery = DrivenBattery(DriverSettings())
    for percentage in (3.0, 2.0):
        with pytest.raises(ValueError, match=r'battery.full: 100'):
            battery.hear(percentage, math.nan, None, 0.0)
    with pytest.raises(ValueError, match='has told 3 as well: it tells percent'):
        battery.hear(1.0, math.nan, None, 1.0)
    assert battery.level is None
