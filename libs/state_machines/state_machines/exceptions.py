"""The errors of the engine, with SMACH's names, and those of calls to other nodes.

Every message of a `SmachError` names the state by its path from the root (``ROOT/CHILD/LEAF``), the
outcome or the userdata key in question, and what was expected instead.
"""

from __future__ import annotations

import difflib
from collections.abc import Callable, Iterable


class SmachError(Exception):
    """Base of every error that the engine raises.

    Attributes:
        message: The text, as SMACH's exceptions keep it.
    """

    def __init__(self, message: str = '') -> None:
        super().__init__(message)
        self.message = message

    def __str__(self) -> str:
        # KeyError, which one subclass mixes in, would show the repr.
        return self.message


class InvalidStateError(SmachError):
    """A state, a label or a container's specification is wrong."""


class InvalidTransitionError(SmachError):
    """An outcome is undeclared, or leads to no state and to no outcome of the container.

    Also: a state ignored a preempt beyond its bound, and the container has no outcome for that.
    """


class InvalidConstructionError(InvalidStateError):
    """A construction method was called while the wrong container, or none, was open."""


class InvalidUserCodeError(SmachError):
    """User code raised, or broke the userdata contract; ``__cause__`` keeps what it raised."""


class MissingKeyError(InvalidUserCodeError, KeyError):
    """A declared userdata key was read before anything wrote it (a ``KeyError``, as in SMACH)."""


class CheckpointError(SmachError):
    """A checkpoint cannot be read or written, or does not fit the machine; the place is named."""


class CallError(Exception):
    """Another node did not do what it was asked; the message is one line that names it."""


class UnavailableError(CallError):
    """The server is not there, or went away before it answered: only its return helps.

    Args:
        message: One line that names the server.
        is_back: Whether a server is there now; None: nobody can tell.
    """

    def __init__(self, message: str, is_back: Callable[[], bool] | None = None) -> None:
        super().__init__(message)
        self.is_back = is_back


class CallTimeoutError(CallError):
    """The server is there but did not answer in time."""


class CallInterruptedError(CallError):
    """The caller's interrupt ended the wait; a goal that ran on the server was cancelled."""


def describe(error: BaseException) -> str:
    """Return one line for an exception raised by user code."""
    try:
        text = str(error)
    except Exception as broken:
        text = f'its message cannot be shown ({type(broken).__name__})'
    if isinstance(error, SmachError):
        return text
    return f'{type(error).__name__}: {text}' if text else type(error).__name__


def shown(value: object) -> str:
    """Return a value as an error message shows it, whatever its own ``__repr__`` does."""
    try:
        return repr(value)
    except Exception:
        return f'<{type(value).__name__} that cannot be shown>'


def unknown(name: object, known: Iterable[str]) -> str:
    """Say that a name is not known, and which is nearest to it."""
    known = sorted(each for each in known if not each.startswith('_'))
    near = difflib.get_close_matches(str(name), known, 1)
    hint = f"; did you mean '{near[0]}'?" if near else f'; known are {known[:20]}'
    return f'{shown(name)} is not known{hint}'
