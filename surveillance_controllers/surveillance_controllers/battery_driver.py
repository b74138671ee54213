"""What the driver of a real battery says: a charge in percent, from messages of several habits.

`sensor_msgs/BatteryState` has a `percentage` from 0 to 1, NaN where it is not measured; many
drivers fill it from 0 to 100, others tell the voltage alone and leave the percentage NaN, or at the
0 that a message begins with. Which it is stands in the robot's profile.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from strict_files.settings import parameter
from surveillance_runtime.profile.record import BATTERY_SOURCES, BatterySource, voltage_curve
from surveillance_runtime.profile.truth_check import battery_doubt

_SLACK = 1.2
"""A gauge may say more than full: a TurtleBot3 tells its voltage as a part of the nominal one."""
CONTACT_SECONDS = 10.0
"""A dock may take this long until it charges, s."""


@dataclass(frozen=True)
class DriverSettings:
    """Where the charge comes from in ROBOT mode; units as declared."""

    source: str = parameter(
        BatterySource.source,
        'ROBOT: topic: battery_state of a driver; model: computed from the way driven.',
        choices=BATTERY_SOURCES,
    )
    full: float = parameter(
        BatterySource.full,
        "What the driver's percentage holds when full: 1, or 100 of many.",
        0.01,
        1000.0,
    )
    voltages: tuple[float, ...] = parameter(
        (),
        'Voltage, V, and the percent that it stands for, pairs that rise: of a driver whose '
        'percentage is none. It is not looked at then.',
        of=float,
        check=voltage_curve,
    )
    timeout: float = parameter(
        BatterySource.timeout, 'The driver is silent after this, s.', 1.0, 3600.0
    )


def level_from(
    percentage: float, voltage: float, settings: DriverSettings, *, present: bool = False
) -> float:
    """Return the charge that a driver's message tells, percent.

    Args:
        percentage: As the message has it.
        voltage: As the message has it, V.
        settings: The driver's habits.
        present: Whether the message says that there is a battery; many drivers leave that out.

    Raises:
        ValueError: It tells none.
    """
    if settings.voltages:
        if not (math.isfinite(voltage) and voltage > 0.0):
            raise ValueError(f'voltage is {voltage:g}: expected V, for battery.voltages')
        return float(np.interp(voltage, settings.voltages[::2], settings.voltages[1::2]))
    if not math.isfinite(percentage):
        raise ValueError(
            'percentage is not a number: expected one, or battery.voltages in the profile'
        )
    if percentage == 0.0 and not voltage > 0.0 and not present:
        raise ValueError(
            f'percentage is 0 and voltage {voltage:g}, as in a message that nobody filled: '
            'expected a charge'
        )
    share = percentage / settings.full
    if not 0.0 <= share <= _SLACK:
        hint = (
            '; battery.full: 100 in the profile fits it'
            if settings.full == 1.0 and 0.0 <= percentage <= 100.0 * _SLACK
            else ''
        )
        raise ValueError(f'percentage {percentage:g}: expected 0 to {settings.full:g}{hint}')
    # Six percent are less than 0.06 as the message's 32 bits have it.
    return round(min(100.0, 100.0 * share), 3)


def doubt(percentage: float, settings: DriverSettings) -> str:
    """Return what speaks against how a percentage is taken; empty: nothing does."""
    if settings.voltages or settings.full <= 1.0 or not 0.0 < percentage <= 1.0:
        return ''
    return (
        f'percentage {percentage:.3g} is taken for {100.0 * percentage / settings.full:.3g} %, for '
        f'battery.full is {settings.full:g} in the profile: expected 1 there where the driver '
        'tells a share from 0 to 1'
    )


class DrivenBattery:
    """What a driver said last, and whether it still speaks.

    Args:
        settings: Its habits.

    Attributes:
        level: The charge, percent; None until it said one.
        charging: Whether it charges; None where it does not say.
    """

    def __init__(self, settings: DriverSettings) -> None:
        self._settings = settings
        self.level: float | None = None
        self.charging: bool | None = None
        self._heard = -math.inf
        self._most = 0.0
        self._not_charging_since: float | None = None

    def hear(
        self,
        percentage: float,
        voltage: float,
        charging: bool | None,
        now: float,
        *,
        present: bool = False,
    ) -> None:
        """Take a message that came at `now`, seconds; see `level_from`.

        Raises:
            ValueError: It tells no charge.
        """
        self._most = max(self._most, percentage if math.isfinite(percentage) else 0.0)
        if not self._settings.voltages and (
            why := battery_doubt(percentage, self._settings.full, most=self._most, voltage=voltage)
        ):
            raise ValueError(f'{why}: battery.full in the profile is {self._settings.full:g}')
        self.level = level_from(percentage, voltage, self._settings, present=present)
        self._heard = now
        self.charging = charging
        if charging is not False:
            self._not_charging_since = None
        elif self._not_charging_since is None:
            self._not_charging_since = now

    def speaks(self, now: float) -> bool:
        """Tell whether the driver was heard within its timeout."""
        return now - self._heard <= self._settings.timeout

    def why_not_charging(self, asked_at: float, now: float) -> str | None:
        """Say why the battery does not charge, which was asked for at a time; None while it may."""
        since = self._not_charging_since
        if since is None or now - max(since, asked_at) < CONTACT_SECONDS:
            return None
        return f'the driver of the battery says for {CONTACT_SECONDS:g} s that it does not charge'
