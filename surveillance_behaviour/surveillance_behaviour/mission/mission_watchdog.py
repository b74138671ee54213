"""A watchdog for the mission's purpose: it tells when the robot does nothing, and why that is so.

Processes that live are no proof that a mission goes on. Once a second `MissionWatchdog` is given
what there is to be seen of it, and begins and ends incidents:

- the robot waits for help, with the cause of the failure;
- it is paused, stopped or waiting while its charge falls below what takes it home;
- it decides nothing, moves nowhere, explores nothing, does not charge and says nothing for longer
  than what it is about explains.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

from surveillance_behaviour.mission.recovery import Failure
from surveillance_runtime.incidents import Incidents

PATIENCE = 10.0
"""How much longer than its plan explains a mission may be silent, seconds."""
LEAST_LOOKS = 10
"""Nothing must have changed over so many looks, which are a second of real time apart: in fast
simulated time the patience holds on both clocks, since a decision takes the computer's time."""
MOVED = 0.05
"""A robot that is further than this from where it was, metres, or has turned by so many rad,
moves."""
DRIVE_RECOVERY = 30.0
"""What a drive does on its own account before it fails or goes on: wait, back up, look around,
seconds."""
CHARGE, PURPOSE = ('battery', 'charge'), ('robot', 'purpose')
HELP = ('robot', 'help')


@dataclass(frozen=True)
class MissionSight:
    """What is to be seen of a mission at one moment.

    Attributes:
        now: Seconds as they pass on the mission's clock.
        state: Path of the machine's active state; empty: it does not run yet.
        steps: How many transitions and words there were.
        text: What was said last.
        pose: Where the robot is, x, y, yaw; None: nobody measures that.
        level: Charge in percent; None: not known.
        charging: Whether it is being charged; None: not known.
        waiting: Why the robot waits for help; empty: it does not.
        failure: What did not work last, until something did.
        held: `stopped`, `paused` or empty.
        must_charge: Why the charge will not do for more than the way home; empty: it will.
        closed: The doors that are closed.
        place: Where the robot was last known to be.
        staying: Why it was decided to stay; empty: it was not.
    """

    now: float
    state: str = ''
    steps: int = 0
    text: str = ''
    pose: tuple[float, float, float] | None = None
    level: float | None = None
    charging: bool | None = None
    waiting: str = ''
    failure: Failure | None = None
    held: str = ''
    must_charge: str = ''
    closed: Sequence[str] = ()
    place: str = ''
    staying: str = ''


class MissionWatchdog:
    """Begins and ends the incidents of one mission.

    Args:
        incidents: Where they are told.
        explains: Returns for how long a state may be silent, seconds.
    """

    def __init__(self, incidents: Incidents, explains: Callable[[str], float]) -> None:
        self._incidents = incidents
        self._explains = explains
        self._before: MissionSight | None = None
        self._since = 0.0
        self._looks = 0
        self._help: tuple[str, str] | None = None
        self._told_charge = False

    def look(self, seen: MissionSight) -> None:
        """Take what is to be seen now."""
        self._look_at_help(seen)
        self._look_at_charge(seen)
        self._look_at_purpose(seen)

    def _look_at_help(self, seen: MissionSight) -> None:
        if seen.waiting:
            if self._help is None:
                self._help = cause_of(seen.failure, seen.closed)
            self._incidents.begin(self._help, text_of(seen))
        elif self._help is not None and seen.failure is None:
            self._incidents.end(self._help, f'the mission goes on in {seen.place}')
            self._help = None

    def _look_at_charge(self, seen: MissionSight) -> None:
        why_held = seen.held or ('waiting for help' if seen.waiting else '')
        if why_held and seen.must_charge and not seen.charging:
            if not self._told_charge:
                level = 'unknown' if seen.level is None else f'{seen.level:g} %'
                self._told_charge = True
                text = (
                    f'the robot is {why_held} in {seen.place or "an unknown place"} and must '
                    f'charge now, at {level}: {seen.must_charge}'
                )
                self._incidents.begin(CHARGE, text)
        elif self._told_charge:
            self._told_charge = False
            self._incidents.end(CHARGE, 'the robot is on its way, or charges')

    def _look_at_purpose(self, seen: MissionSight) -> None:
        before, self._before = self._before, seen
        if before is None or _goes_on(before, seen):
            self._since, self._looks = seen.now, 0
            self._incidents.end(PURPOSE, 'the mission goes on')
            return
        # What moves slowly is compared with where it was when it last moved.
        self._before = _with_mark(before, seen)
        self._looks += 1
        silent = seen.now - self._since
        late = silent > self._explains(seen.state) + PATIENCE
        if late and self._looks >= LEAST_LOOKS and PURPOSE not in self._incidents.open():
            where = seen.state or 'the start'
            text = f'nothing has happened for {silent:.0f} s in {where}: {_step(seen)}'
            self._incidents.begin(PURPOSE, text)


def _goes_on(before: MissionSight, seen: MissionSight) -> bool:
    """Tell whether something has happened, or somebody knows why not."""
    if seen.held or seen.waiting or seen.staying:
        return True
    if (before.state, before.steps) != (seen.state, seen.steps):
        return True
    if before.level is not None and seen.level is not None and seen.level > before.level:
        return True
    if before.pose is None or seen.pose is None:
        return before.pose is not seen.pose
    return any(abs(a - b) > MOVED for a, b in zip(before.pose, seen.pose, strict=True))


def _with_mark(before: MissionSight, seen: MissionSight) -> MissionSight:
    level = before.level if before.level is not None else seen.level
    return replace(seen, pose=before.pose, level=level)


def _step(seen: MissionSight) -> str:
    """Return which step the mission waits for."""
    state = seen.state.upper()
    if 'MOV' in state or 'CONTROL' in state:
        return 'it waits for the end of the drive, and the robot stands'
    if 'POINT' in state:
        return 'it waits for a path of the planner'
    if 'CHARG' in state:
        return 'it waits for the battery to charge'
    if 'CHOOSE' in state or 'REASON' in state:
        return 'it waits for a decision'
    if 'INIT' in state or not state:
        return 'it waits for the map in the ontology'
    return f'the last was: {seen.text or "nothing was said"}'


def cause_of(failure: Failure | None, closed: Sequence[str]) -> tuple[str, str]:
    """Return what a failure is due to, as the cause of an incident."""
    if failure is None:
        return HELP
    if failure.is_over is not None:
        return 'node', failure.reason.split(':')[0].strip()
    if failure.charging and failure.goal:
        return 'station', failure.goal
    if closed:
        return 'door', ', '.join(closed)
    return ('place', failure.goal) if failure.goal else HELP


def text_of(seen: MissionSight) -> str:
    """Return what the robot waits for, with what is known of the cause."""
    doors = ''
    if seen.closed and seen.failure is not None and seen.failure.is_over is None:
        names = ', '.join(seen.closed)
        doors = f' ({names} {"is" if len(seen.closed) == 1 else "are"} closed)'
    what = seen.waiting  # as where the machine broke, which is no failure of a step
    if seen.failure is not None:
        what = f'{seen.failure.what} failed: {seen.failure.reason}'
    return f'the robot waits for help in {seen.place or "an unknown place"}: {what}{doors}'
