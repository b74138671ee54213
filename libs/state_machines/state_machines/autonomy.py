"""Autonomy levels: transitions that wait for a person.

A transition may need a level of autonomy (`Approval`). While the machine's level is lower
(`Control.set_autonomy`), it does not make the transition by itself: it asks (`Question`), and goes
on when a person approves, chooses another outcome of the state, raises the level, or when the time
for that is over. FlexBE has the idea and its names.
"""

from __future__ import annotations

import enum
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field

from state_machines.clock import Interrupt
from state_machines.exceptions import InvalidTransitionError


class Autonomy(enum.IntEnum):
    """How much a machine does by itself, with FlexBE's names."""

    OFF = 0
    LOW = 1
    HIGH = 2
    FULL = 3


@dataclass(frozen=True)
class Approval:
    """What a transition needs beside its outcome.

    Attributes:
        level: At this level of the machine and above it is made without a question.
        timeout: Seconds of the machine's clock after which nobody is waited for; None for never.
        otherwise: The outcome that counts then.
    """

    level: int
    timeout: float | None = None
    otherwise: str = ''


def make_approvals(
    path: str, outcomes: Iterable[str], given: Mapping[str, int | Approval]
) -> dict[str, Approval]:
    """Check what transitions of a state need.

    Args:
        path: The state's path, for errors.
        outcomes: The outcomes that lead somewhere.
        given: From outcomes to levels, or to approvals.

    Raises:
        InvalidTransitionError: An outcome or a level is none, or a timeout has no outcome to go on
            with.
    """
    known, approvals = sorted(outcomes), {}
    for outcome, need in given.items():
        approval = need if isinstance(need, Approval) else Approval(need)
        what = f"State '{path}': the autonomy of outcome '{outcome}'"
        if outcome not in known:
            raise InvalidTransitionError(f'{what} is given, but its outcomes are {known}')
        level = level_of(approval.level, what)
        approvals[outcome] = Approval(level, approval.timeout, approval.otherwise)
        if approval.timeout is None:
            continue
        if not approval.timeout > 0:
            raise InvalidTransitionError(
                f'{what} has timeout {approval.timeout!r}: expected seconds above 0'
            )
        if approval.otherwise not in known:
            raise InvalidTransitionError(
                f"{what} has a timeout, after which '{approval.otherwise}' counts: expected one of "
                f'its outcomes {known}'
            )
    return approvals


def level_of(level: int, what: str) -> Autonomy:
    """Return a level of autonomy that is given as a number.

    Raises:
        InvalidTransitionError: It is none.
    """
    try:
        return Autonomy(level)
    except ValueError:
        levels = ', '.join(f'{each.value} ({each.name})' for each in Autonomy)
        raise InvalidTransitionError(f'{what} is {level!r}: expected one of {levels}') from None


@dataclass(eq=False)
class Question:
    """A transition that waits for a person.

    Attributes:
        path: Of the state that has ended.
        outcome: What it ended with.
        target: Label of the state, or outcome of the container, that this leads to.
        approval: What the transition needs.
        outcomes: The outcomes that may be chosen.
        answer: The outcome that was chosen.
        wake: Ends the wait.
    """

    path: str
    outcome: str
    target: str
    approval: Approval
    outcomes: tuple[str, ...]
    answer: str | None = None
    wake: Interrupt = field(default_factory=Interrupt)
