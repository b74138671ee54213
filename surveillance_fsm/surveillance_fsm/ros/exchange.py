"""Messages made of userdata and the other way round: what action and service states share."""

from __future__ import annotations

import copy
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass
from typing import Any

import surveillance_fsm as fsm
from surveillance_fsm.exceptions import describe


def seconds(duration: Any) -> float | None:
    """Return a duration in seconds: a number, an rclpy ``Duration``, or None."""
    if duration is None or isinstance(duration, int | float):
        return duration
    return float(duration.nanoseconds) / 1e9


@dataclass
class UserCallback:
    """A user's callback and what it may touch.

    Attributes:
        name: The argument it was given as, for errors.
        function: The callback; None for none.
        args: Further positional arguments.
        kwargs: Further keyword arguments.
        input_keys: Userdata it may read, if it does not declare that itself.
        output_keys: Userdata it may write, likewise.
        outcomes: Outcomes it may return, likewise.
    """

    name: str
    function: Callable[..., Any] | None
    args: Iterable[Any] = ()
    kwargs: Mapping[str, Any] | None = None
    input_keys: Iterable[str] = ()
    output_keys: Iterable[str] = ()
    outcomes: Iterable[str] = ()

    def declare(self, state: fsm.State) -> None:
        """Check the callback and add what it declares to `state`.

        Raises:
            InvalidStateError: It cannot be called.
        """
        if self.function is None:
            return
        if not callable(self.function):
            raise fsm.InvalidStateError(f'{self.name} {self.function!r} cannot be called')
        declared: Any = self.function
        if fsm.has_smach_interface(declared):
            self.input_keys = declared.get_registered_input_keys()
            self.output_keys = declared.get_registered_output_keys()
            self.outcomes = declared.get_registered_outcomes()
        state.register_input_keys(self.input_keys)
        state.register_output_keys(self.output_keys)
        state.register_outcomes(self.outcomes)

    def call(self, ud: Any, *message: Any) -> Any:
        """Call it with its view of userdata.

        Raises:
            InvalidUserCodeError: It raised something.
        """
        assert self.function is not None
        view = fsm.Remapper(ud, tuple(self.input_keys), tuple(self.output_keys))
        try:
            return self.function(view, *message, *self.args, **dict(self.kwargs or {}))
        except Exception as error:
            raise fsm.InvalidUserCodeError(f'{self.name} raised {describe(error)}') from error


@dataclass
class Outgoing:
    """How a goal or a request is made.

    Attributes:
        kind: ``goal`` or ``request``, for errors.
        message_type: The message's class.
        message: The message to begin with; an empty one by default.
        key: Userdata key that holds the whole message.
        slots: Fields that are taken from userdata keys of the same names.
        callback: Given the userdata and the message; returns the message to send, or None when it
            changed the one it was given.
    """

    kind: str
    message_type: Any
    message: Any
    key: str | None
    slots: Iterable[str]
    callback: UserCallback

    def declare(self, state: fsm.State) -> None:
        """Check the policy and declare its userdata keys.

        Raises:
            InvalidStateError: A field does not exist, or a callback cannot be called.
        """
        if self.message is not None and not isinstance(self.message, self.message_type):
            raise fsm.InvalidStateError(
                f'{self.kind} is a {type(self.message).__name__}, expected '
                f'{self.message_type.__name__}'
            )
        check_slots(f'{self.kind}_slots', self.slots, self.message_type)
        if self.key is not None:
            state.register_input_keys([self.key])
        state.register_input_keys(self.slots)
        self.callback.declare(state)

    def make(self, ud: Any) -> Any:
        """Make the message to send.

        Raises:
            InvalidUserCodeError: Userdata lacks something, or holds the wrong thing.
        """
        # A copy: the caller's message is used again by the next execution.
        message = copy.deepcopy(self.message) if self.message is not None else self.message_type()
        # Messages check their fields' types on request only, and there is no public way to ask
        # for it after construction.
        message._check_fields = True
        try:
            if self.key is not None:
                message = ud[self.key]
            for slot in self.slots:
                setattr(message, slot, ud[slot])
        except (fsm.SmachError, AssertionError, AttributeError, TypeError) as error:
            raise fsm.InvalidUserCodeError(f'no {self.kind}: {describe(error)}') from error
        if self.callback.function is not None:
            made = self.callback.call(ud, message)
            message = message if made is None else made
        if not isinstance(message, self.message_type):
            raise fsm.InvalidUserCodeError(
                f'the {self.kind} is a {type(message).__name__}, expected '
                f'{self.message_type.__name__}'
            )
        return message


@dataclass
class Incoming:
    """What becomes of a result or a response.

    Attributes:
        kind: ``result`` or ``response``, for errors.
        message_type: The message's class.
        key: Userdata key that takes the whole message.
        slots: Fields that go to userdata keys of the same names.
        callback: Given the userdata and the message; may return an outcome.
    """

    kind: str
    message_type: Any
    key: str | None
    slots: Iterable[str]
    callback: UserCallback

    def declare(self, state: fsm.State) -> None:
        """Check the policy and declare its userdata keys and outcomes.

        Raises:
            InvalidStateError: A field does not exist, or a callback cannot be called.
        """
        check_slots(f'{self.kind}_slots', self.slots, self.message_type)
        if self.key is not None:
            state.register_output_keys([self.key])
        state.register_output_keys(self.slots)
        self.callback.declare(state)

    def take(self, ud: Any, state: fsm.State, *message: Any) -> str | None:
        """Put a message, the last of `message`, into userdata; the callback's outcome, if any.

        Raises:
            InvalidUserCodeError: The callback raised, or returned an outcome that is not declared.
        """
        outcome = None
        if self.callback.function is not None:
            outcome = self.callback.call(ud, *message)
            if outcome is not None and outcome not in state.get_registered_outcomes():
                raise fsm.InvalidUserCodeError(
                    f'{self.callback.name} returned outcome {outcome!r}: the outcomes are '
                    f'{sorted(state.get_registered_outcomes())}'
                )
        if self.key is not None:
            ud[self.key] = message[-1]
        for slot in self.slots:
            ud[slot] = getattr(message[-1], slot)
        return outcome


def check_slots(name: str, slots: Iterable[str], message_type: Any) -> None:
    """Check that fields exist.

    Raises:
        InvalidStateError: One does not.
    """
    fields = message_type.get_fields_and_field_types()
    for slot in slots:
        if slot not in fields:
            raise fsm.InvalidStateError(
                f"{name}: {message_type.__name__} has no field '{slot}', only {sorted(fields)}"
            )
