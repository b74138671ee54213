"""How fast simulated time goes beside real time.

`speed` is simulated seconds per real second; 0 means as fast as the robot's programs keep up. Two
things hold time back then: a ceiling, so that a program's thinking does not cost the robot minutes;
and lockstep: time waits while a program that has not answered the last measurement yet is still at
work on it. While the base is under command the answer is the next command; from a robot that
estimates where it is, it is the next estimate. A program that stays silent for `patience` real
seconds is given up until it answers again, and time goes on.
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
        estimate_window: Likewise after the measurement that an estimate of the pose answers.
        patience: Real seconds that time waits for either.
    """

    speed: float = 1.0
    ceiling: float = 100.0
    step: float = 0.1
    idle_step: float = 0.5
    window: float = 0.15
    estimate_window: float = 0.45
    patience: float = 1.0

    @property
    def period(self) -> float:
        """Real seconds between two ticks."""
        return self.step / (self.speed or self.ceiling)


class Answers:
    """The answers of a program that works in step with the measurements.

    Args:
        window: Simulated seconds that may pass after what was answered last.
        patience: Real seconds after which a late answer is not waited for any more.
    """

    def __init__(self, window: float, patience: float) -> None:
        self._window = window
        self._patience = patience
        self._answered: float | None = None
        self._late_since: float | None = None

    def note(self, answered: float) -> None:
        """Note an answer to what was measured at this simulated time, seconds."""
        self._answered, self._late_since = answered, None

    def end(self) -> None:
        """Expect no further answer until one comes."""
        self._answered = self._late_since = None

    def are_late(self, simulated: float, steady: float) -> bool:
        """Return whether time must wait for the next answer."""
        if self._answered is None or simulated - self._answered < self._window - 1e-9:
            return False
        if self._late_since is None:
            self._late_since = steady
        if steady - self._late_since < self._patience:
            return True
        self.end()
        return False


class Pace:
    """Decides how much simulated time passes at each tick.

    Attributes:
        is_waiting: Whether time stands still until a command or an estimate comes.
    """

    def __init__(self, model: PaceModel, steady: float) -> None:
        """Start at the given reading of the steady clock, seconds."""
        self._model = model
        self._last = steady
        self._owed = 0.0
        self._commands = Answers(model.window, model.patience)
        self._estimates = Answers(model.estimate_window, model.patience)
        self.is_waiting = False

    def command(self, moving: bool, simulated: float) -> None:
        """Note a command: whether it moves the base, and the simulated time when it came."""
        if moving:
            self._commands.note(simulated)
        else:
            self._commands.end()

    def estimate(self, measured: float) -> None:
        """Note an estimate of the pose from what was measured at this simulated time, seconds."""
        self._estimates.note(measured)

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
        late = [
            answers.are_late(simulated, steady) for answers in (self._commands, self._estimates)
        ]
        self.is_waiting = model.speed == 0.0 and any(late)
        if self.is_waiting:
            # Ready to go on at once when the answer comes.
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
