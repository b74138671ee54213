"""Several robots in one world: they are moved on together, see, block and can touch each other."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence

from surveillance_simulation.robot.robot import PHYSICS_STEP, Robot


class Robots:
    """All robots of a world, and the people among them, who are the first robot's.

    Args:
        robots: At least one; all in one world, at the same time, each with its own name.
    """

    def __init__(self, robots: Sequence[Robot]) -> None:
        self.robots = tuple(robots)
        self.first = self.robots[0]
        self.world = self.first.world

    @property
    def time(self) -> float:
        """Seconds since the start."""
        return self.first.time

    @property
    def is_moving(self) -> bool:
        """Whether a robot moves or is told to, or people walk about."""
        return any(robot.is_moving for robot in self.robots)

    def advance(self, seconds: float) -> None:
        """Move all on in time, in steps so short that nothing is driven through."""
        if len(self.robots) == 1:
            self.first.advance(seconds)
            return
        steps = max(1, math.ceil(seconds / PHYSICS_STEP - 1e-9))
        for _ in range(steps):
            at = [robot.base.pose[:2] for robot in self.robots]
            self.first.move_people(seconds / steps, at)
            for robot in self.robots:
                robot.base.step(seconds / steps)
        for robot in self.robots:
            robot.time += seconds

    def state(self) -> dict[str, float | str]:
        """Return what must outlive a process, see `Robot.state`; names stand before the keys."""
        return {
            _key(robot, key): value for robot in self.robots for key, value in robot.state().items()
        }

    def restore(self, state: Mapping[str, float | str]) -> bool:
        """Take up a state; return whether it is one that this place and these robots can have."""
        before = [robot.state() for robot in self.robots]
        found = [
            {key: state[_key(robot, key)] for key in own if _key(robot, key) in state}
            for robot, own in zip(self.robots, before, strict=True)
        ]
        # One after the other: where one stood another may be now, so a second round may fit.
        fits = [robot.restore(own) for robot, own in zip(self.robots, found, strict=True)]
        fits = [
            fit or robot.restore(own)
            for fit, robot, own in zip(fits, self.robots, found, strict=True)
        ]
        if all(fits):
            return True
        for robot, own in zip(self.robots, before, strict=True):
            robot.restore(own)
        return False


def _key(robot: Robot, key: str) -> str:
    return f'{robot.name}.{key}' if robot.name else key
