"""What the robot's base can do: the simulator obeys it, and who commands the base counts on it."""

from __future__ import annotations

ROBOT_RADIUS = 0.22
"""Radius, metres: the default of the parameter `robot_radius`."""

ROBOT_DECELERATION = 2.5
"""With which the base brakes when it must, m/s^2: the default of `robot_deceleration`.

It is what Nav2's configurations give for a TurtleBot3. Ordinary drives brake gently, within their
own limits of acceleration and jerk.
"""
