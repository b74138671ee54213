"""The rate of simulated time: the real-time factor, and lockstep with the robot's programs.

`speed` is simulated seconds per real second; 0 means as fast as the robot's programs keep up, with
a ceiling. Whatever the speed, but the real one: time stands still while a program is at work on its
answer, so that a busy machine is slower and no robot loses what it would not lose in real time:

- a controller on the next command, while the base is under command or a drive is executed: each
  measurement has its command before the next one is made;
- a localisation on the next estimate of the pose;
- who moves the arm, until it is seen to rest at the end of its trajectory, and then the marker
  detector on the next picture, while somebody may look through the camera there;
- whoever writes the robot's place into the ontology, while a place was told and not written;
- a planner on a path, while one of its goals is executed;
- the mission on its next step: it says until which simulated time it waits, and time does not
  pass that moment until it says so again. While a drive is executed, it waits for the drive.

So a mission takes as many simulated seconds at full speed as in real time. A program that stays
silent for `patience` real seconds is given up until it answers again, and time goes on.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

from strict_files.settings import parameter

PLANNING = ('compute_path', 'motion/planner')
"""Actions that take no simulated time: it stands still while one of their goals is executed."""
DRIVING = ('follow_path', 'motion/controller')
"""Actions during which the mission waits for the robot."""
LOOKING = 3.0
"""Simulated seconds that a program looks through the camera where the arm has come to rest."""
MIN_STEP = 0.001
"""The shortest step of time, seconds."""
OBEYS_WITHIN = 0.02
"""At a set speed of time the base is moved on this often, real seconds: a command is obeyed then,
not with the next measurement. At full speed no sleep is longer: a command may end the idle step."""
LONGEST_DEBT = 0.5
"""What a busy machine falls behind by more than this is not caught up with, simulated seconds."""
LOOKED_OVER = 20.0
"""Over this time it is looked whether the machine keeps up, real seconds;"""
TOO_SLOW = 0.7
"""it does not if less than this share of the speed is reached."""


@dataclass(frozen=True)
class ClockRateModel:
    """How time goes.

    Attributes:
        window: Simulated seconds that may pass after a command before the next one must come.
        estimate_window: Likewise after the measurement that an estimate of the pose answers.
        look_window: Likewise after the arm's trajectory, its rest, or a picture that was read.
        patience: Real seconds that time waits for any of them.
    """

    speed: float = parameter(
        1.0, 'Simulated seconds per real second; 0: as fast as the nodes keep up.', 0.0, 1000.0
    )
    ceiling: float = parameter(
        100.0,
        'Simulated seconds per real second at most when speed is 0.',
        1.0,
        10000.0,
        name='top_speed',
    )
    step: float = parameter(
        0.1, 'Simulated seconds between two messages on clock, odom and scan.', 0.005, 0.5
    )
    idle_step: float = parameter(
        0.5, 'The same while nothing moves, nobody looks and speed is 0.', 0.005, 5.0
    )
    window: float = 0.05
    estimate_window: float = 0.45
    look_window: float = 0.2
    patience: float = 3.0

    @property
    def period(self) -> float:
        """Real seconds between two ticks."""
        return self.step / (self.speed or self.ceiling)


class Awaited:
    """A program that time waits for while its answer is late.

    Args:
        patience: Real seconds after which it is given up until it answers again.

    Attributes:
        answered: The simulated time that it answered last; None while it is not waited for.
    """

    def __init__(self, patience: float) -> None:
        self._patience = patience
        self._late_since: float | None = None
        self.answered: float | None = None

    def note(self, answered: float) -> None:
        """Note an answer, to a moment of simulated time, seconds."""
        self.answered, self._late_since = answered, None

    def end(self) -> None:
        """Expect no further answer until one comes."""
        self.answered = self._late_since = None

    def since(self, simulated: float) -> float:
        """Return the seconds from its last answer to a simulated time; -inf: none is waited for."""
        return -math.inf if self.answered is None else simulated - self.answered

    def holds_time(self, is_late: bool, steady: float) -> bool:
        """Return whether time must wait for the next answer, by whether that is late now."""
        if self.answered is None or not is_late:
            self._late_since = None
            return False
        if self._late_since is None:
            self._late_since = steady
        if steady - self._late_since < self._patience:
            return True
        self.end()
        return False


class Lockstep:
    """The programs of one robot that time waits for.

    Attributes:
        awaits_picture: Whether, when last asked, one was late that reads a picture, or sees that
            the arm rests.
    """

    def __init__(self, model: ClockRateModel) -> None:
        self._model = model
        self._commands = Awaited(model.patience)
        self._estimates = Awaited(model.patience)
        self._looks = Awaited(model.patience)
        self._look_from, self._look_until = math.inf, math.inf
        # It answers until when it waits.
        self._mission = Awaited(model.patience)
        self._executed: dict[str, bool] = {}
        self._places_written = Awaited(model.patience)
        self._place_told = -1.0
        self.awaits_picture = False

    def mission_waits(self, until: float) -> None:
        """Note that the mission waits until this simulated time, seconds; inf: for an event."""
        self._mission.note(until)

    def place_told(self, seen: float) -> None:
        """Note that the robot was seen in another place at this simulated time, seconds."""
        self._place_told = seen

    def place_written(self, seen: float) -> None:
        """Note that the ontology has the place in which the robot was seen at this time."""
        self._places_written.note(seen)

    def goals(self, action: str, simulated: float, *, executed: bool) -> None:
        """Note whether an action's goal is executed at a simulated time, seconds.

        Those of `PLANNING` and `DRIVING` count.
        """
        if executed and action in DRIVING and not self._is_driving:
            self._commands.note(simulated)
        was_driving = self._is_driving
        self._executed[action] = executed
        if was_driving and not self._is_driving:
            self._commands.end()

    @property
    def is_executing(self) -> bool:
        """Whether a goal is executed."""
        return any(self._executed.values())

    @property
    def waits_until(self) -> float:
        """Until when the mission waits, simulated seconds; inf: for an event or a goal."""
        answered = self._mission.answered
        return math.inf if answered is None or self.is_executing else answered

    def is_looking(self, simulated: float) -> bool:
        """Return whether somebody may look through the camera at a simulated time, seconds."""
        return self._look_from <= simulated <= self._look_until

    @property
    def _is_driving(self) -> bool:
        return any(self._executed.get(action) for action in DRIVING)

    @property
    def _is_planning(self) -> bool:
        return any(self._executed.get(action) for action in PLANNING)

    def command(self, moving: bool, simulated: float) -> None:
        """Note a command: whether it moves the base, and the simulated time when it came."""
        if moving or self._is_driving:
            self._commands.note(simulated)
        else:
            self._commands.end()

    def estimate(self, measured: float) -> None:
        """Note an estimate of the pose from what was measured at this simulated time, seconds."""
        self._estimates.note(measured)

    def arm_moves(self, until: float) -> None:
        """Note that the arm follows a trajectory that ends at this simulated time, seconds."""
        self._looks.note(until)
        self._look_from, self._look_until = math.inf, math.inf

    def arm_rests(self, simulated: float) -> None:
        """Note that whoever moves the arm has seen at this simulated time that it rests."""
        self._looks.note(simulated)
        self._look_from, self._look_until = simulated, simulated + LOOKING

    def picture_read(self, taken: float) -> None:
        """Note that a picture taken at this simulated time, seconds, has been read."""
        if self._look_from <= taken <= self._look_until:
            self._looks.note(taken)

    def is_late(self, simulated: float, steady: float) -> bool:
        """Return whether time is to stand still until a program answers; times as for `due`."""
        if simulated > self._look_until:
            self._looks.end()
        model, just = self._model, 1e-9
        look_is_late = self._looks.since(simulated) >= model.look_window - just
        command_is_late = self._commands.since(simulated) >= model.window - just
        estimate_is_late = self._estimates.since(simulated) >= model.estimate_window - just
        step_is_late = not self._is_driving and self._mission.since(simulated) >= -just
        place_is_late = self._places_written.since(self._place_told) > 0.0
        self.awaits_picture = self._looks.holds_time(look_is_late, steady)
        late = (
            self.awaits_picture,
            self._commands.holds_time(command_is_late, steady),
            self._estimates.holds_time(estimate_is_late, steady),
            self._mission.holds_time(self._is_planning or step_is_late, steady),
            self._places_written.holds_time(place_is_late, steady),
        )
        return any(late)


class ClockRate:
    """Decides how much simulated time passes at each tick.

    Attributes:
        robots: The programs of each robot; all share one time.
        is_waiting: Whether time stood still, when last asked, until a program answers.
        pause: At full speed, real seconds from the last `due` until it is to be asked again.
    """

    def __init__(self, model: ClockRateModel, steady: float, robots: int = 1) -> None:
        """Start at the given reading of the steady clock, seconds."""
        self._model = model
        self._last = steady
        self._owed = 0.0
        self.pause: float | None = None
        self.robots = tuple(Lockstep(model) for _ in range(robots))
        self.is_waiting = False
        self._looked = steady, 0.0
        self._passed = 0.0

    @property
    def awaits_picture(self) -> bool:
        """Whether, when last asked, somebody was late who reads a picture or sees the arm rest."""
        return any(robot.awaits_picture for robot in self.robots)

    def waits(self, simulated: float, steady: float) -> bool:
        """Return whether time stands still until a program answers; times as for `due`."""
        late = [robot.is_late(simulated, steady) for robot in self.robots]
        self.is_waiting = self._model.speed != 1.0 and any(late)
        return self.is_waiting

    def too_slow(self, steady: float) -> float | None:
        """Return the speed that is reached where the machine does not keep up; None: it does, or
        it is too early to tell.

        Args:
            steady: Reading of the steady clock, seconds.
        """
        since, before = self._looked
        if self._model.speed == 0.0 or steady - since < LOOKED_OVER:
            return None
        reached = (self._passed - before) / (steady - since)
        self._looked = steady, self._passed
        return reached if reached < TOO_SLOW * self._model.speed else None

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
        if self.waits(simulated, steady):
            # Ready to go on at once when the answer comes.
            self._owed = min(self._owed + elapsed * (model.speed or model.ceiling), step)
            return 0.0
        if model.speed == 0.0:
            busy = any(each.is_looking(simulated) or each.is_executing for each in self.robots)
            if not (moving or busy):
                step = model.idle_step
            until = min(each.waits_until for each in self.robots)
            step = min(step, max(until - simulated, MIN_STEP))
            self._owed = min(self._owed + elapsed * model.ceiling, step)
        else:
            # What a busy machine falls behind is caught up with, but not without bound.
            self._owed = min(self._owed + elapsed * model.speed, max(LONGEST_DEBT, step))
        passed = 0.0
        if self._owed >= step - 1e-9:
            self._owed -= step
            self._passed += step
            passed = step
        if model.speed == 0.0:
            self.pause = min(max(step - self._owed, MIN_STEP) / model.ceiling, OBEYS_WITHIN)
        return passed
