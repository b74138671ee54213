"""Describing what a callback reads, writes and returns, so that a state can adopt it."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from typing import Any


def has_smach_interface(obj: object) -> bool:
    """Whether `obj` tells its outcomes and userdata keys the way a state does."""
    return (
        hasattr(obj, 'get_registered_input_keys')
        and hasattr(obj, 'get_registered_output_keys')
        and hasattr(obj, 'get_registered_outcomes')
    )


class CBInterface:
    """A callable together with the outcomes and userdata keys it adds to a state."""

    def __init__(
        self,
        cb: Callable[..., Any],
        outcomes: Iterable[str] | None = None,
        input_keys: Iterable[str] | None = None,
        output_keys: Iterable[str] | None = None,
        io_keys: Iterable[str] | None = None,
    ) -> None:
        both = tuple(io_keys or ())
        self._cb = cb
        self._outcomes = tuple(outcomes or ())
        self._input_keys = {*(input_keys or ()), *both}
        self._output_keys = {*(output_keys or ()), *both}

    def __call__(self, *args: Any, **kwargs: Any) -> Any:
        return self._cb(*args, **kwargs)

    def get_registered_input_keys(self) -> tuple[str, ...]:
        """The userdata keys the callback reads."""
        return tuple(self._input_keys)

    def get_registered_output_keys(self) -> tuple[str, ...]:
        """The userdata keys the callback writes."""
        return tuple(self._output_keys)

    def get_registered_outcomes(self) -> tuple[str, ...]:
        """The outcomes the callback may return."""
        return tuple(self._outcomes)


class cb_interface:  # noqa: N801 - SMACH's name
    """Decorator that gives a function a `CBInterface`."""

    def __init__(
        self,
        outcomes: Iterable[str] | None = None,
        input_keys: Iterable[str] | None = None,
        output_keys: Iterable[str] | None = None,
        io_keys: Iterable[str] | None = None,
    ) -> None:
        self._declared = (outcomes, input_keys, output_keys, io_keys)

    def __call__(self, cb: Callable[..., Any]) -> CBInterface:
        return CBInterface(cb, *self._declared)
