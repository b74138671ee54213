"""What both machines share: the base of their states, recovery, waiting for help, path checks."""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable, Iterable, Sequence
from typing import Any

import state_machines as fsm
from patrol_policy.decision import NowhereToGoError
from state_machines.exceptions import CallError, CallInterruptedError, UnavailableError
from surveillance_behaviour.mission.mission import Mission
from surveillance_behaviour.mission.recovery import Failure, Step
from surveillance_behaviour.ports import Point

PREEMPTED = 'preempted'
FAILED = 'failed'


class MachineState(fsm.State):
    """A state that knows the mission; a preempt that comes before its work ends it.

    One that talks to peers has the outcome `FAILED`, and ends with it when one of them fails.

    Args:
        mission: The mission's memory and ports.
    """

    ends: Sequence[str] = ()
    """Outcomes beside ``preempted``."""
    reads: Sequence[str] = ()
    """Userdata read."""
    writes: Sequence[str] = ()
    """Userdata written."""
    task = ''
    """What the state does, for the message when that fails."""
    charging = False
    """Whether a failure means that the battery is not charged."""

    def __init__(self, mission: Mission) -> None:
        super().__init__([*self.ends, PREEMPTED], self.reads, self.writes)
        self.mission = mission

    def execute(self, ud: Any) -> str | None:
        """Work until done, failed or preempted, unless a preempt came first."""
        if self.preempt_requested():
            return self.preempted()
        try:
            return self.work(ud, self.interrupt)
        except CallInterruptedError:
            return self.preempted() if self.preempt_requested() else self.interrupted(ud)
        except UnavailableError as error:
            self.mission.failed(self.task, str(error), is_over=error.is_back)
        except (CallError, NowhereToGoError) as error:
            self.mission.failed(self.task, str(error), self.goal(ud), charging=self.charging)
        return FAILED

    def work(self, ud: Any, interrupt: fsm.Interrupt) -> str:
        """Do the state's own work and return the outcome."""
        raise NotImplementedError

    def preempted(self) -> str:
        """Serve the preempt and return the outcome for that."""
        self.service_preempt()
        return PREEMPTED

    def interrupted(self, ud: Any) -> str:
        """Return the outcome when something else than a preempt ended the work."""
        raise NotImplementedError

    def goal(self, ud: Any) -> str | None:
        """Return the place that is not reached when the state fails; None: it is not about a
        place.
        """
        return None


class Recover(MachineState):
    """Looks at the last failure and chooses the next step."""

    def __init__(self, mission: Mission, *, steps: Iterable[Step] = tuple(Step)) -> None:
        self.ends = tuple(steps)
        super().__init__(mission)

    def work(self, ud: Any, interrupt: fsm.Interrupt) -> str:
        """Return the step that the recovery takes; one that the machine lacks becomes waiting."""
        mission = self.mission
        assert mission.failure is not None
        step = mission.recovery.next_step(
            mission.failure, mission.now(), may_go_back=Step.GO_BACK in self.ends
        )
        if step not in self.ends:
            step = Step.WAIT_FOR_HELP
        mission.say(f'recovery: {WORDS[step]}')
        return step.value


WORDS = {
    Step.CHOOSE_ANEW: 'choosing again',
    Step.ANOTHER_PATH: 'trying another path',
    Step.ANOTHER_PLACE: 'trying another place',
    Step.GO_BACK: 'going back to the last known place',
    Step.WAIT_FOR_HELP: 'waiting for help',
}


PEER_PERIOD = 0.2
"""Seconds between two looks whether a peer that was away has come back."""

PASSAGE_PERIOD = 1.0
"""Seconds between two questions to the ontology whether a way has opened."""


def _what_helps(failure: Failure | None, place: str) -> str:
    """Return what ends the pause, and what a person can do.

    Args:
        failure: What did not work.
        place: Where the robot is; empty: that is not known.
    """
    if failure is not None and failure.is_over is not None:
        return 'continues as soon as it answers'
    if failure is not None and failure.charging:
        return 'check the charging station'
    if not place:
        return 'drive the robot about until it knows where it is, or tell its pose on initialpose'
    return 'open a door or remove the obstacle'


class WaitForHelp(MachineState):
    """Says what is wrong and waits; then everything is tried anew, with longer pauses each time.

    The return of a peer that was away ends the pause; where none was away, a way that has opened
    does, such as a door.
    """

    ends = ('try_again',)

    def work(self, ud: Any, interrupt: fsm.Interrupt) -> str:
        """Wait for one pause, or until the peer that was away is back, or a way has opened."""
        mission = self.mission
        failure = mission.failure
        reason = 'nothing works' if failure is None else f'{failure.what} failed: {failure.reason}'
        seconds = mission.recovery.pause()
        mission.ports.announcer.waiting_for_help(
            f'{reason} (in {mission.place or "an unknown place"}, {mission.battery.level_text()}); '
            f'{_what_helps(failure, mission.place)}; next try in {seconds:g} s'
        )
        is_over, period = mission.watch_passages(interrupt), PASSAGE_PERIOD
        if failure is not None and failure.is_over is not None:
            is_over, period = failure.is_over, PEER_PERIOD
        if not self._wait(seconds, is_over, period):
            return self.preempted()
        mission.ports.announcer.waiting_for_help('')
        return 'try_again'

    def _wait(self, seconds: float, is_over: Callable[[], bool], period: float) -> bool:
        """Wait, and look once a period; return False when a preempt ended it."""
        was_over = True
        while seconds > 0.0:
            began = self.mission.now()
            over = is_over()
            # One that is there all the time does not answer: that takes the whole pause.
            if over and not was_over:
                return True
            was_over = over
            if not self.wait(min(period, seconds)):
                return False
            # a look takes long where nobody answers, and a clock may be set back
            seconds -= max(period, self.mission.now() - began)
        return True


def add(label: str, state: fsm.State, **transitions: str) -> None:
    """Add a state to the open machine: each outcome with what it leads to.

    ``preempted`` leaves the machine unless it is bound.
    """
    fsm.StateMachine.add(label, state, {PREEMPTED: PREEMPTED, **transitions})


def add_asking(
    label: str, state: fsm.State, outcome: str, mission: Mission, **transitions: str
) -> None:
    """Add a state as `add` does; below the autonomy ``high`` a person is asked after `outcome`.

    A robot that nobody answers goes on, so that it is back before its battery is empty.
    """
    seconds = mission.settings.approval_seconds
    approval = fsm.Approval(fsm.Autonomy.HIGH, timeout=seconds, otherwise=outcome)
    bound = {PREEMPTED: PREEMPTED, **transitions}
    fsm.StateMachine.add(label, state, bound, autonomy={outcome: approval})


def check_path(path: list[Point], goal: Point | None, tolerance: float, peer: str) -> None:
    """Refuse a path that leads nowhere, or elsewhere.

    Raises:
        CallError: It is empty, not finite, or ends too far from ``goal``.
    """
    if not path:
        raise CallError(f'{peer}: the path has no points')
    if not all(math.isfinite(value) for point in path for value in point):
        raise CallError(f'{peer}: the path has a point that is not finite')
    gap = 0.0 if goal is None else math.dist(path[-1][:2], goal[:2])
    if gap > tolerance:
        raise CallError(
            f'{peer}: the path ends {gap:.2f} m from the goal, expected at most {tolerance:g} m'
        )


def follow(
    mission: Mission,
    place: str,
    path: list[Point],
    drive: Callable[[Sequence[Point], fsm.Interrupt], Point],
    peer: str,
    interrupt: fsm.Interrupt,
) -> float:
    """Drive along a path and make sure that it ends in ``place``; metres driven.

    Args:
        mission: The mission's memory and ports.
        place: Where the path leads.
        path: The path; not empty.
        drive: Drives along it and returns where the robot is at the end.
        peer: Names who drives, in errors.
        interrupt: Ends it.

    Raises:
        CallError: The robot stopped too far from the path's end, or is in another place.
    """
    mission.departs()
    away = math.dist(drive(path, interrupt)[:2], path[-1][:2])
    tolerance = mission.settings.arrival_tolerance
    if not away <= tolerance:
        raise CallError(
            f'{peer}: the robot stopped {away:.2f} m short, expected at most {tolerance:g} m'
        )
    mission.make_sure_of(place, interrupt)
    return sum(math.dist(start, end) for start, end in itertools.pairwise(path))
