"""A battery as the simulated robot has it: what drains it, and how it charges at the station.

The charge is an energy in watt hours. Standing costs power over time; a metre driven and a radian
turned cost energy each, whatever the speed, which is what rolling resistance does; the arm and the
camera cost power while they are in use.

Charging follows the usual constant-current, constant-voltage course of a lithium-ion cell:
constant power up to `taper_from`, then a power that falls in proportion to what is missing, down
to `taper_floor` of the full power, so that the charge ends in a finite time. Both parts have a
closed form, so a step may be of any length.

A battery in a robot that moves is fed with what the robot reports. Poses come at any rate. A jump
that no drive could make is a correction of the estimate, not a way driven, so the counted way and
turn are held to what the robot's top speeds allow.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

from floor_plans import Station
from floor_plans.parameters import station_at
from lidar_navigation.geometry import Pose, angle_between
from strict_files.settings import parameter
from surveillance_runtime.robot_arm import ARM, TrajectoryPoint

SECONDS_PER_HOUR = 3600.0
LONGEST_AWAY = 86_400.0
"""A longer time between two steps is none, but a jump of the clock, seconds."""
LONGEST_MOTION = 20.0
"""No motion of the arm is counted for longer, seconds, whatever its trajectory says."""

TOP_SPEED, TOP_TURN = 2.0, 3.0
"""No robot is faster, m/s and rad/s: what is more is a correction of the estimate."""


@dataclass(frozen=True)
class BatteryParameters:
    """Sizes of the battery and of its consumers.

    Raises:
        ValueError: A value is out of range; the text names it.
    """

    capacity: float = parameter(40.0, 'Energy of a full battery, Wh.', 0.0)
    rest_power: float = parameter(15.0, 'Drawn all the time, W.', 0.0)
    joules_per_metre: float = parameter(60.0, 'Drawn by driving, J/m.', 0.0)
    joules_per_radian: float = parameter(6.0, 'Drawn by turning, J/rad.', 0.0)
    equipment_power: float = parameter(10.0, 'Drawn by arm and camera while the arm moves, W.', 0.0)
    charging_power: float = parameter(
        600.0, 'Given by the station while the battery is below taper_from, W.', 0.0
    )
    taper_from: float = parameter(
        0.8, 'State of charge from which charging slows down, between 0 and 1.', 0.0
    )
    taper_floor: float = parameter(0.1, 'Least charging power as a part of charging_power.', 0.0)
    empty_voltage: float = parameter(18.0, 'Voltage of an empty battery, V.', 0.0)
    full_voltage: float = parameter(25.2, 'Voltage of a full battery, V.', 0.0)

    def __post_init__(self) -> None:
        for name in ('capacity', 'charging_power', 'empty_voltage'):
            if not getattr(self, name) > 0:
                raise ValueError(f'{name} is {getattr(self, name)!r}: expected more than 0')
        for name in ('rest_power', 'joules_per_metre', 'joules_per_radian', 'equipment_power'):
            if not getattr(self, name) >= 0:
                raise ValueError(f'{name} is {getattr(self, name)!r}: expected 0 or more')
        if not 0 < self.taper_from < 1:
            raise ValueError(f'taper_from is {self.taper_from!r}: expected between 0 and 1')
        if not 0 < self.taper_floor <= 1:
            raise ValueError(f'taper_floor is {self.taper_floor!r}: expected above 0, at most 1')
        if not self.full_voltage > self.empty_voltage:
            raise ValueError(
                f'full_voltage is {self.full_voltage!r}: '
                f'expected above empty_voltage {self.empty_voltage!r}'
            )


class BatteryModel:
    """The charge of one battery.

    Args:
        parameters: Its sizes.
        level: Charge at the start, percent.
    """

    def __init__(self, parameters: BatteryParameters, level: float = 100.0) -> None:
        self.parameters = parameters
        self.energy = 0.0
        self.set_level(level)

    @property
    def state_of_charge(self) -> float:
        """The part of the capacity that is left, 0 to 1."""
        return self.energy / self.parameters.capacity

    @property
    def level(self) -> float:
        """The charge in percent, 0 to 100."""
        return 100.0 * self.state_of_charge

    @property
    def percent(self) -> int:
        """The charge in whole percent, rounded down: 0 only means empty within the last percent,
        100 only full."""
        return math.floor(self.level + 1e-9)

    @property
    def voltage(self) -> float:
        """Open-circuit voltage, V: a straight line between empty and full."""
        p = self.parameters
        return p.empty_voltage + (p.full_voltage - p.empty_voltage) * self.state_of_charge

    def set_level(self, level: float) -> None:
        """Set the charge, percent; held between 0 and 100."""
        self.energy = self.parameters.capacity * min(max(level, 0.0), 100.0) / 100.0

    def draw(
        self,
        seconds: float,
        metres: float = 0.0,
        radians: float = 0.0,
        equipment_seconds: float = 0.0,
    ) -> float:
        """Take what the robot used.

        Args:
            seconds: Time that passed.
            metres: Way driven in it, forwards or backwards (0 or more).
            radians: Angle turned in it, either way (0 or more).
            equipment_seconds: Time for which arm or camera worked.

        Returns:
            The energy taken, Wh; less than asked for when the battery is empty.

        Raises:
            ValueError: An amount is negative.
        """
        if min(seconds, metres, radians, equipment_seconds) < 0:
            raise ValueError(
                'a negative amount drawn: expected time, way and angle of 0 or more, got '
                f'{seconds} s, {metres} m, {radians} rad, {equipment_seconds} s of equipment'
            )
        p = self.parameters
        joules = (
            p.rest_power * seconds
            + p.joules_per_metre * metres
            + p.joules_per_radian * radians
            + p.equipment_power * equipment_seconds
        )
        taken = min(self.energy, joules / SECONDS_PER_HOUR)
        self.energy -= taken
        return taken

    def charging_power(self) -> float:
        """Return the power the station gives at the present charge, W; 0 when full."""
        p = self.parameters
        charge = self.state_of_charge
        if charge >= 1.0:
            return 0.0
        if charge < p.taper_from:
            return p.charging_power
        return p.charging_power * max(p.taper_floor, (1.0 - charge) / (1.0 - p.taper_from))

    def charge(self, seconds: float, rate: float | None = None) -> None:
        """Charge for some time at a station.

        Args:
            seconds: The time.
            rate: Percent a minute below `taper_from`; None: as `charging_power` gives.

        Raises:
            ValueError: The time is negative.
        """
        if seconds < 0:
            raise ValueError(f'charging for {seconds!r} s: expected 0 or more')
        p = self.parameters
        power = p.charging_power if rate is None else rate * 60.0 / 100.0 * p.capacity
        left = seconds / SECONDS_PER_HOUR
        bound = p.taper_from * p.capacity
        if self.energy < bound:
            hours = min(left, (bound - self.energy) / power)
            self.energy += hours * power
            left -= hours
        floor_from = p.capacity * (1.0 - p.taper_floor * (1.0 - p.taper_from))
        if left > 0 and self.energy < floor_from:
            decay = power / (p.capacity * (1.0 - p.taper_from))
            to_floor = math.log((p.capacity - self.energy) / (p.capacity - floor_from)) / decay
            hours = min(left, to_floor)
            self.energy = p.capacity - (p.capacity - self.energy) * math.exp(-decay * hours)
            left -= hours
        if left > 0:
            self.energy += left * p.taper_floor * power
        self.energy = min(self.energy, p.capacity)


class BatteryInUse:
    """A battery in a robot that drives, uses its arm, and charges at a station only.

    Args:
        battery: The battery.
        stations: The charging stations, by their rooms.
        dock_reach: Distance from a station within which the robot charges, metres.
        since: When the battery had its level, seconds; None: when time first passes.

    Attributes:
        pose: Where the robot was last; None until it reports.
    """

    def __init__(
        self,
        battery: BatteryModel,
        stations: Mapping[str, Station],
        dock_reach: float,
        since: float | None,
    ) -> None:
        self._battery = battery
        self._stations = stations
        self._dock_reach = dock_reach
        self._last = since
        self.pose: Pose | None = None
        self._seen_at = 0.0
        self._metres = self._radians = 0.0
        self._arm_seconds = 0.0
        # When the arm moves: since when that was not counted yet, and until when.
        self._arm_moves = 0.0, 0.0

    def take_stations(self, stations: Mapping[str, Station]) -> None:
        """Take where the stations are from now on."""
        self._stations = stations

    @property
    def docked(self) -> bool:
        """Whether the robot stands at a station."""
        return self._dock is not None

    @property
    def _dock(self) -> Station | None:
        if self.pose is None:
            return None
        return station_at(self.pose[:2], self._stations, self._dock_reach)

    def see_pose(self, pose: Pose, now: float) -> None:
        """Take where the robot is at `now` (seconds)."""
        if self.pose is not None and now > self._seen_at:
            passed = now - self._seen_at
            self._metres += min(math.dist(pose[:2], self.pose[:2]), TOP_SPEED * passed)
            turn = abs(angle_between(self.pose[2], pose[2]))
            self._radians += min(turn, TOP_TURN * passed)
        self.pose, self._seen_at = pose, now

    def move_arm(self, names: Sequence[str], points: Sequence[TrajectoryPoint], now: float) -> None:
        """Take that the arm follows a trajectory from `now` (seconds) on, instead of what it did
        before, unless it cannot follow that."""
        try:
            ARM.check(names, points)
        except ValueError:
            return  # Whoever moves the arm says so.
        self._count_arm(now)
        self._arm_moves = now, now + min(points[-1].time if points else 0.0, LONGEST_MOTION)

    def _count_arm(self, now: float) -> None:
        since, until = self._arm_moves
        self._arm_seconds += max(0.0, min(now, until) - since)
        self._arm_moves = now, until

    def advance(self, now: float) -> None:
        """Let time pass up to `now` (seconds): draw, and charge at a station."""
        passed = 0.0 if self._last is None else now - self._last
        self._last = now
        if not 0.0 <= passed <= LONGEST_AWAY:
            passed = 0.0  # Another clock.
        self._count_arm(now)
        self._battery.draw(passed, self._metres, self._radians, min(self._arm_seconds, passed))
        self._metres = self._radians = self._arm_seconds = 0.0
        if (dock := self._dock) is not None:
            self._battery.charge(passed, dock.rate)

    def skip(self, now: float) -> None:
        """Let time pass up to `now` (seconds) that somebody else accounts for."""
        self._last = now
        self._count_arm(now)
        self._metres = self._radians = self._arm_seconds = 0.0

    def why_not_charging(self) -> str | None:
        """Say why the battery cannot charge now; None when it can."""
        if self.docked:
            return None
        if self.pose is None:
            return 'where the robot is is not known (nothing came on amcl_pose)'
        x, y, _ = self.pose
        at = ' or '.join(f'({s.pose[0]:.2f}, {s.pose[1]:.2f})' for s in self._stations.values())
        which = 'the station' if len(self._stations) == 1 else 'a station'
        return f'the robot is at ({x:.2f}, {y:.2f}), not at {which} {at}'
