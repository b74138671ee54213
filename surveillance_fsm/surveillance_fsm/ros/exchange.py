"""Messages made of userdata and the other way round: what action and service states share."""

from __future__ import annotations

import copy
from collections.abc import Iterable, Mapping
from typing import Any

import surveillance_fsm as fsm
from surveillance_fsm.exceptions import describe


def seconds(duration: Any) -> float | None:
    """Return a duration in seconds: a number, an rclpy ``Duration``, or None."""
    if duration is None or isinstance(duration, int | float):
        return duration
    return float(duration.nanoseconds) / 1e9


class UserCallback:
    """A user's callback; one without a `cb_interface` sees all that its state declares.

    Args:
        state: The state that it belongs to; what the callback declares is added to it.
        name: The argument it was given as, for errors.
        function: The callback; None for none.
        args: Further positional arguments.
        kwargs: Further keyword arguments.

    Raises:
        InvalidStateError: It cannot be called.
    """

    def __init__(
        self,
        state: fsm.State,
        name: str,
        function: Any,
        args: Iterable[Any],
        kwargs: Mapping[str, Any] | None,
    ) -> None:
        if function is not None and not callable(function):
            raise fsm.InvalidStateError(f'{name} {function!r} cannot be called')
        self.name = name
        self.function = function
        self._args = tuple(args)
        self._kwargs = dict(kwargs or {})
        self._declares = state.fsm_take_over(function)

    def call(self, ud: Any, *message: Any) -> Any:
        """Call it with its view of userdata.

        Raises:
            InvalidUserCodeError: It raised something.
        """
        function = self.function
        if self._declares:
            ud = fsm.Remapper(
                ud, function.get_registered_input_keys(), function.get_registered_output_keys()
            )
        try:
            return function(ud, *message, *self._args, **self._kwargs)
        except Exception as error:
            raise fsm.InvalidUserCodeError(f'{self.name} raised {describe(error)}') from error


class Outgoing:
    """How a goal or a request is made.

    Args:
        state: The state that sends it; it declares the userdata keys.
        kind: ``goal`` or ``request``, for errors.
        message_type: The message's class.
        message: The message to begin with; an empty one by default.
        key: Userdata key that holds the whole message.
        slots: Fields that are taken from userdata keys of the same names.
        callback: Given the userdata and the message; returns the message to send, or None when it
            changed the one it was given.

    Raises:
        InvalidStateError: The message is of another type, or a field does not exist.
    """

    def __init__(
        self,
        state: fsm.State,
        kind: str,
        message_type: Any,
        message: Any,
        key: str | None,
        slots: Iterable[str],
        callback: UserCallback,
    ) -> None:
        if message is not None and not isinstance(message, message_type):
            raise fsm.InvalidStateError(
                f'{kind} is a {type(message).__name__}, expected {message_type.__name__}'
            )
        self.kind, self.message_type, self.message = kind, message_type, message
        self.key, self.callback = key, callback
        self.slots = checked_slots(f'{kind}_slots', slots, message_type)
        state.register_input_keys(self.slots if key is None else (key, *self.slots))

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


class Incoming:
    """What becomes of a result or a response.

    Args:
        state: The state that receives it; it declares the userdata keys.
        kind: ``result`` or ``response``, for errors.
        message_type: The message's class.
        key: Userdata key that takes the whole message.
        slots: Fields that go to userdata keys of the same names.
        callback: Given the userdata and the message; may return an outcome.

    Raises:
        InvalidStateError: A field does not exist.
    """

    def __init__(
        self,
        state: fsm.State,
        kind: str,
        message_type: Any,
        key: str | None,
        slots: Iterable[str],
        callback: UserCallback,
    ) -> None:
        self.state, self.key, self.callback = state, key, callback
        self.slots = checked_slots(f'{kind}_slots', slots, message_type)
        state.register_output_keys(self.slots if key is None else (key, *self.slots))

    def take(self, ud: Any, *message: Any) -> str | None:
        """Put a message, the last of `message`, into userdata; the callback's outcome, if any.

        Raises:
            InvalidUserCodeError: The callback raised, or returned an outcome that is not declared.
        """
        outcome = None
        if self.callback.function is not None:
            outcome = self.callback.call(ud, *message)
            outcomes = self.state.get_registered_outcomes()
            if outcome is not None and outcome not in outcomes:
                raise fsm.InvalidUserCodeError(
                    f'{self.callback.name} returned outcome {outcome!r}: the outcomes are '
                    f'{sorted(outcomes)}'
                )
        if self.key is not None:
            ud[self.key] = message[-1]
        for slot in self.slots:
            ud[slot] = getattr(message[-1], slot)
        return outcome


def checked_slots(name: str, slots: Iterable[str], message_type: Any) -> tuple[str, ...]:
    """Return names of fields, all of which exist.

    Raises:
        InvalidStateError: One does not.
    """
    slots, fields = tuple(slots), message_type.get_fields_and_field_types()
    for slot in slots:
        if slot not in fields:
            raise fsm.InvalidStateError(
                f"{name}: {message_type.__name__} has no field '{slot}', only {sorted(fields)}"
            )
    return slots
