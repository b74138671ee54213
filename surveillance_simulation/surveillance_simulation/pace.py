"""How fast simulated time goes beside real time.

`speed` is simulated seconds per real second; 0 means as fast as the robot's programs keep up. Two
things hold time back then: a ceiling, so that a program's thinking does not cost the robot minutes;
and lockstep: while the base is under command, time waits for the next command, since a controller
that has not answered the last measurement yet is still at work on it. A controller that stays
silent for `patience` real seconds is given up, and time goes on.
"""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class PaceModel:
    """How time goes.

    Attributes:
        speed: Simulated seconds per real second; 0 as fast as possible.
        ceiling: Greatest simulated seconds per real second when `speed` is 0.
        step: Simulated seconds between two ticks of the clock.
        idle_step: The same while nothing moves and `speed` is 0.
        window: Simulated seconds that may pass after a command before the next one must come.
        patience: Real seconds that time waits for a command.
    """

    speed: float = 1.0
    ceiling: float = 100.0
    step: float = 0.1
    idle_step: float = 0.5
    window: float = 0.15
    patience: float = 0.2

    @property
    def period(self) -> float:
        """Real seconds between two ticks."""
        return self.step / (self.speed or self.ceiling)


class Pace:
    """Decides how much simulated time passes at each tick.

    Attributes:
        is_waiting: Whether time stands still until a command comes.
    """

    def __init__(self, model: PaceModel, steady: float) -> None:
        """Start at the given reading of the steady clock, seconds."""
        self._model = model
        self._last = steady
        self._owed = 0.0
        self._commanded: tuple[float, float] | None = None
        self.is_waiting = False

    def command(self, moving: bool, simulated: float, steady: float) -> None:
        """Note a command: whether it moves the base, and when it came by both clocks."""
        self._commanded = (simulated, steady) if moving else None

    def due(self, simulated: float, steady: float, *, moving: bool) -> float:
        """Return how many simulated seconds pass now; 0 to wait.

        Args:
            simulated: Simulated time, seconds.
            steady: Reading of the steady clock, seconds.
            moving: Whether base or arm move.
        """
        model = self._model
        elapsed, self._last = steady - self._last, steady
        step = model.step
        self.is_waiting = self._waits(simulated, steady)
        if self.is_waiting:
            # Ready to go on at once when the command comes.
            self._owed = min(self._owed + elapsed * model.ceiling, step)
            return 0.0
        if model.speed == 0.0:
            if not moving:
                step = model.idle_step
            self._owed = min(self._owed + elapsed * model.ceiling, step)
        else:
            # What a busy machine falls behind is caught up with, but not without bound.
            self._owed = min(self._owed + elapsed * model.speed, 5 * step)
        if self._owed < step - 1e-9:
            return 0.0
        self._owed -= step
        return step

    def _waits(self, simulated: float, steady: float) -> bool:
        if self._model.speed != 0.0 or self._commanded is None:
            return False
        commanded, since = self._commanded
        if simulated - commanded < self._model.window - 1e-9:
            return False
        if steady - since < self._model.patience:
            return True
        self._commanded = None
        return False
