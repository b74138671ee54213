"""The model of a battery, and a battery in a robot that drives; plain Python."""

from surveillance_controllers.battery.model import Battery, BatteryParameters
from surveillance_controllers.battery.use import BatteryInUse

__all__ = ['Battery', 'BatteryInUse', 'BatteryParameters']
