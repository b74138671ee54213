"""What the robot's base can do: the simulator obeys it, and who commands the base counts on it."""

from __future__ import annotations

from surveillance_runtime.parameters import parameter

ROBOT_RADIUS = 0.22
"""Radius, metres: the default of the parameter `robot_radius`."""

ROBOT_DECELERATION = 2.5
"""With which the base brakes when it must, m/s^2: the default of `robot_deceleration`.

It is what Nav2's configurations give for a TurtleBot3. Ordinary drives brake gently, within their
own limits of acceleration and jerk.
"""


def robot_radius() -> float:
    """Return the field of a record that is the parameter `robot_radius`."""
    return parameter(ROBOT_RADIUS, 'Radius of the robot, m.', 0.01, 20.0, name='robot_radius')


def robot_deceleration() -> float:
    """Return the field of a record that is the parameter `robot_deceleration`."""
    text = 'With which the base brakes when it must, m/s^2.'
    return parameter(ROBOT_DECELERATION, text, 0.05, 20.0, name='robot_deceleration')
