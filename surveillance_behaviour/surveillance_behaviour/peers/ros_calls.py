"""Service calls and goals as the machines' ports have them: an answer, or an error of the ports."""

from __future__ import annotations

import time
from collections.abc import Callable
from typing import Any

from surveillance_behaviour.peers.ports import AwayError, InterruptedWaitError, PeerError
from surveillance_fsm import Interrupt
from surveillance_runtime.calls import (
    CallError,
    CallInterruptedError,
    GoalCaller,
    ServiceCaller,
    UnavailableError,
)

ASK_AGAIN = 10.0
"""How long one question to a service that takes long waits for its answer, seconds."""


def call(
    caller: ServiceCaller,
    request: Any,
    deadline: float,
    interrupt: Interrupt,
    discovery: float | None = None,
) -> Any:
    """Calls a service.

    Args:
        caller: The service.
        request: The request message.
        deadline: Seconds of steady time.
        interrupt: Ends the wait.
        discovery: Seconds after which a server that is not there is given up, for services whose
            answer may take much longer; default: the deadline.

    Raises:
        PeerError: No server, or no answer in time.
        InterruptedWaitError: The interrupt was raised.
    """
    try:
        return caller.call(request, deadline, interrupt, discovery=discovery)
    except CallInterruptedError:
        raise InterruptedWaitError from None
    except CallError as error:
        raise _peer_error(caller.name, error) from None


def ask(
    caller: ServiceCaller, request: Any, deadline: float, interrupt: Interrupt, discovery: float
) -> Any:
    """Calls a service whose answer takes long and that may be asked twice; else as `call`.

    It is asked anew now and then: a server that has just taken the place of another one may have
    been found before its end of the line was there, and does not know that anybody waits.
    """
    late = time.monotonic() + deadline
    while True:
        patience = min(ASK_AGAIN, max(discovery, late - time.monotonic()))
        try:
            return call(caller, request, patience, interrupt, discovery)
        except AwayError:
            raise
        except PeerError:
            if time.monotonic() >= late:
                raise


def run(
    caller: GoalCaller,
    goal: Any,
    accept_deadline: float,
    result_deadline: float,
    interrupt: Interrupt,
    on_feedback: Callable[[Any], None] | None = None,
) -> Any:
    """Runs a goal to its result.

    Args:
        caller: The action.
        goal: The goal message.
        accept_deadline: Seconds of steady time until the goal is accepted.
        result_deadline: Seconds of steady time for the result; 0: as long as the server lives.
        interrupt: Ends the wait and cancels the goal.
        on_feedback: Called with each feedback message.

    Raises:
        PeerError: No server, or the goal was rejected, aborted, or not done in time.
        InterruptedWaitError: The interrupt was raised.
    """
    try:
        end = caller.run(
            goal,
            accept_timeout=accept_deadline,
            result_timeout=result_deadline or None,
            interrupt=interrupt,
            on_feedback=on_feedback,
        )
    except CallInterruptedError:
        raise InterruptedWaitError from None
    except CallError as error:
        raise _peer_error(caller.name, error) from None
    if end.status != 'succeeded':
        raise PeerError(caller.name, f'the goal was {end.status}')
    return end.result


def _peer_error(name: str, error: CallError) -> PeerError:
    kind = AwayError if isinstance(error, UnavailableError) else PeerError
    return kind(name, str(error).partition(f'{name}: ')[2] or str(error))
