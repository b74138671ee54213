"""What all containers share: construction under ``with``, callbacks, userdata in and out."""

from __future__ import annotations

import threading
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from types import TracebackType
from typing import Any, Self

from surveillance_fsm.exceptions import (
    InvalidConstructionError,
    InvalidStateError,
    InvalidTransitionError,
    SmachError,
)
from surveillance_fsm.log import logerr, logwarn
from surveillance_fsm.state import State
from surveillance_fsm.user_data import UserData


class _Construction(threading.local):
    """The containers being built in this thread, innermost last, with `opened`'s arguments."""

    def __init__(self) -> None:
        self.stack: list[tuple[Container, Mapping[str, Any]]] = []


_construction = _Construction()

Callback = tuple[Callable[..., Any], tuple[Any, ...]]


class Container(State):
    """Base of the states that run other states.

    Args:
        outcomes: What the container may end with.
        input_keys: Keys copied from the parent's userdata on entry.
        output_keys: Keys copied to the parent's userdata on exit.
    """

    def __init__(
        self,
        outcomes: Iterable[str] = (),
        input_keys: Iterable[str] = (),
        output_keys: Iterable[str] = (),
    ) -> None:
        super().__init__(outcomes, input_keys, output_keys)
        self.userdata = UserData()
        self._start_cbs: list[Callback] = []
        self._transition_cbs: list[Callback] = []
        self._termination_cbs: list[Callback] = []
        self._fsm_path = type(self).__name__

    # What each kind of container defines.

    def __getitem__(self, key: str) -> State:
        """The child with label `key`."""
        raise NotImplementedError

    def get_children(self) -> dict[str, State]:
        """The children by label."""
        raise NotImplementedError

    def get_initial_states(self) -> list[str]:
        """Labels of the children a run begins with."""
        raise NotImplementedError

    def set_initial_state(self, initial_states: Sequence[str], userdata: UserData) -> None:
        """Choose the children a run begins with, and add to the container's userdata."""
        raise NotImplementedError

    def get_active_states(self) -> list[str]:
        """Labels of the children that are running."""
        raise NotImplementedError

    def get_internal_edges(self) -> list[tuple[str, str, str | None]]:
        """Transitions inside, as (outcome, from label, to label)."""
        raise NotImplementedError

    def check_consistency(self) -> None:
        """Raise `InvalidTransitionError` when the container cannot run."""
        raise NotImplementedError

    def is_running(self) -> bool:
        """Whether the container is executing."""
        raise NotImplementedError

    # Callbacks.

    def register_start_cb(self, start_cb: Callable[..., Any], cb_args: Iterable[Any] = ()) -> None:
        """Call ``start_cb(userdata, initial_states, *cb_args)`` on entry."""
        self._start_cbs.append((start_cb, tuple(cb_args)))

    def register_transition_cb(
        self, transition_cb: Callable[..., Any], cb_args: Iterable[Any] = ()
    ) -> None:
        """Call ``transition_cb(userdata, active_states, *cb_args)`` on every transition inside."""
        self._transition_cbs.append((transition_cb, tuple(cb_args)))

    def register_termination_cb(
        self, termination_cb: Callable[..., Any], cb_args: Iterable[Any] = ()
    ) -> None:
        """Call ``termination_cb(userdata, terminal_states, outcome, *cb_args)`` on exit."""
        self._termination_cbs.append((termination_cb, tuple(cb_args)))

    def call_start_cbs(self) -> None:
        """Call the start callbacks; what they raise is logged."""
        self._call(self._start_cbs, 'start', self.get_initial_states)

    def call_transition_cbs(self) -> None:
        """Call the transition callbacks; what they raise is logged."""
        self._call(self._transition_cbs, 'transition', self.get_active_states)

    def call_termination_cbs(self, terminal_states: Sequence[str], outcome: str | None) -> None:
        """Call the termination callbacks; what they raise is logged."""
        self._call(self._termination_cbs, 'termination', lambda: list(terminal_states), outcome)

    def _call(
        self,
        callbacks: list[Callback],
        kind: str,
        states: Callable[[], list[str]],
        *further: Any,
    ) -> None:
        for callback, args in tuple(callbacks):
            try:
                callback(self.userdata, states(), *further, *args)
            except Exception as error:
                logerr(
                    f"{kind.capitalize()} callback {callback!r} of '{self._fsm_path}' raised "
                    f'{type(error).__name__}: {error}'
                )

    # Userdata in and out.

    def _copy_input_keys(self, parent_ud: Any, ud: UserData) -> None:
        if parent_ud is None:
            return
        for key in self._input_keys:
            try:
                ud._data[key] = parent_ud[key]
            except KeyError:
                logwarn(f"'{self._fsm_path}' starts without its input key '{key}': nobody set it")

    def _copy_output_keys(self, ud: UserData, parent_ud: Any) -> None:
        if parent_ud is None:
            return
        for key in self._output_keys:
            if key in ud._data:
                parent_ud[key] = ud._data[key]
            else:
                logwarn(f"'{self._fsm_path}' ends without its output key '{key}': nobody set it")

    # Construction.

    def __enter__(self) -> Self:
        self.open()
        return self

    def __exit__(
        self,
        exc_type: type[BaseException] | None,
        exc_val: BaseException | None,
        exc_tb: TracebackType | None,
    ) -> None:
        if exc_type is None:
            self.close()
        else:
            self._leave_construction()

    @contextmanager
    def opened(self, **kwargs: Any) -> Iterator[Self]:
        """Open the container for construction.

        Args:
            **kwargs: ``transitions``: a mapping of outcomes to targets that every state added
                inside takes for those of its outcomes that it does not bind itself.
        """
        self.open(**kwargs)
        try:
            yield self
        except BaseException:
            self._leave_construction()
            raise
        self.close()

    def open(self, **kwargs: Any) -> None:
        """Make this the container that states are added to in this thread."""
        _construction.stack.append((self, kwargs))

    def close(self) -> None:
        """End construction and log what the container still lacks to be run."""
        if not self.is_opened():
            raise InvalidStateError(
                f"Cannot close '{self._fsm_path}': it is not the open container"
            )
        self._leave_construction()
        try:
            self.check_consistency()
        except (InvalidStateError, InvalidTransitionError) as error:
            logerr(str(error))

    def is_opened(self) -> bool:
        """Whether states added now go to this container."""
        return bool(_construction.stack) and _construction.stack[-1][0] is self

    def assert_opened(self, msg: str = '') -> None:
        """Raise `InvalidConstructionError` unless the container is open."""
        if not self.is_opened():
            raise InvalidConstructionError(
                msg or f"'{self._fsm_path}' is not open for construction"
            )

    def _leave_construction(self) -> None:
        # Everything opened inside and left open by an error goes with it.
        stack = _construction.stack
        for depth in range(len(stack) - 1, -1, -1):
            if stack[depth][0] is self:
                del stack[depth:]
                return

    @classmethod
    def _currently_opened_container(cls) -> Self:
        if not _construction.stack:
            raise InvalidConstructionError(
                f'{cls.__name__}: no container is open; add states inside "with container:"'
            )
        container = _construction.stack[-1][0]
        if not isinstance(container, cls):
            raise InvalidConstructionError(
                f"{cls.__name__}: the open container '{container._fsm_path}' is a "
                f'{type(container).__name__}'
            )
        return container

    @staticmethod
    def _group_transitions() -> Mapping[str, str]:
        transitions: Mapping[str, str] = _construction.stack[-1][1].get('transitions', {})
        return transitions


def describe(error: BaseException) -> str:
    """One line for an exception raised by user code."""
    if isinstance(error, SmachError):
        return str(error)
    return f'{type(error).__name__}: {error}' if str(error) else type(error).__name__
