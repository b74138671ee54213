"""Containers in which one state runs at a time: their table of nodes and the loop that runs it.

`StateMachine` and `Iterator` differ in how the table is made; all else is the same for both and is
here, except what may come between two states (`between_states`).
"""

from __future__ import annotations

import threading
from abc import abstractmethod
from collections.abc import Iterable
from typing import Any

from surveillance_fsm import log, shutdown
from surveillance_fsm.active import ActiveContainer, stop_for_now
from surveillance_fsm.between_states import ASIDE, SHUTDOWN, BetweenStates
from surveillance_fsm.engine import (
    NO_USERDATA,
    RESUME,
    RESUMPTION,
    SUSPENDED,
    Exit,
    Frame,
    Node,
)
from surveillance_fsm.exceptions import InvalidStateError, SmachError
from surveillance_fsm.limits import settle
from surveillance_fsm.nodes import make_node, user_fault, wrong_outcome
from surveillance_fsm.run import Strand
from surveillance_fsm.state import State
from surveillance_fsm.waiting import Clock

_start_lock = threading.Lock()


class DrivenContainer(BetweenStates):
    """Base of the containers that run one state at a time."""

    def __init__(
        self,
        outcomes: Iterable[str],
        input_keys: Iterable[str] = (),
        output_keys: Iterable[str] = (),
    ) -> None:
        super().__init__(outcomes, input_keys, output_keys)
        self._table: dict[str, Node] = {}
        self._table_made_for: tuple[Any, ...] | None = None

    @abstractmethod
    def _make_table(self) -> dict[str, Node]:
        """Make the nodes; `_node` makes one."""

    @abstractmethod
    def _initial_label(self) -> str:
        """The label of the node a run begins with."""

    def _begun(self, frame: Frame) -> None:
        """Prepare a run that starts at the beginning."""

    # Table.

    def _nodes(self, path: str, clock: Clock) -> dict[str, Node]:
        made_for = (
            self._fsm_registrations[0],
            self._table_version,
            id(self.userdata._data),
            path,
            id(clock),
        )
        if made_for != self._table_made_for:
            self.check_consistency()
            self._fsm_path = path
            self._fsm_clock = clock
            self._table = self._make_table()
            self._add_branches()
            self._table_made_for = made_for
        return self._table

    def _node(self, label: str, state: State, **options: Any) -> Node:
        return make_node(self._path_of(label), state, self.userdata, self._fsm_clock, **options)

    def _add_branches(self) -> None:
        exits = {outcome: Exit(outcome) for outcome in self.get_registered_outcomes()}
        ordinary = dict(self._table)
        for branch in self._branches.values():
            node = self._node(
                branch.label,
                branch.state,
                remapping=branch.remapping,
                priority=branch.priority,
            )
            for outcome in branch.state.get_registered_outcomes():
                name = branch.transitions.get(outcome, RESUME)
                if name == RESUME:
                    node.targets[outcome] = RESUMPTION
                else:
                    node.targets[outcome] = ordinary.get(name) or exits[name]
            self._table[branch.label] = node

    def _has_limits(self) -> bool:
        return any(
            node.limits is not None
            or (isinstance(node.state, ActiveContainer) and node.state._has_limits())
            for node in self._nodes(self._fsm_path, self._fsm_clock).values()
        )

    # Running.

    def _enter(self, strand: Strand, parent_ud: Any) -> Any:
        path = strand.path_inside()
        table = self._nodes(path, strand.run.clock)
        history, self._fsm_history = self._fsm_history, None
        frame = Frame(self, strand, path, table[self._initial_label()], parent_ud)
        with _start_lock:
            if self._frame is not None:
                raise InvalidStateError(f"'{self._fsm_path}' is running already")
            self._frame = frame
        strand.push(frame)
        try:
            self._heed_suspension(frame)
            if history is None:
                self._copy_input_keys(parent_ud, self.userdata)
                self._begun(frame)
            else:
                frame.go_on_from(history, self._table)
            target = frame.current
            if log.chatty():
                verb = 'starts in' if history is None else 'goes on in'
                log.loginfo(
                    f"'{path}' {verb} '{target.label}' with userdata {sorted(self.userdata.keys())}"
                )
            if history is None and self._start_cbs:
                self.call_start_cbs()
            target = self._attend(frame, None, None, target)
            return self._finish(frame, self._drive(frame, target))
        finally:
            self._leave(frame)

    def _proceed(self, frame: Frame, outcome: Any) -> Any:
        """Go on as if the state of `frame` had just returned `outcome`, and run to the end."""
        node = frame.current
        assert isinstance(node, Node)
        strand = frame.strand
        try:
            watch = strand.watch_of(frame)
            if watch is not None:
                strand.unwatch(watch)
                outcome = settle(self._path_of(node.label), node, frame, watch, outcome)
            target = self._target(node, outcome)
            frame.current = target
            target = self._attend(frame, node, outcome, target)
            return self._finish(frame, self._drive(frame, target))
        finally:
            self._leave(frame)

    def _drive(self, frame: Frame, target: Node | Exit) -> Exit:
        data = self.userdata._data
        now, trace = frame.now, frame.trace
        while not target.is_exit:
            node: Node = target  # type: ignore[assignment]
            try:
                outcome = node.execute(node.view)
            except SmachError:
                raise
            except Exception as error:
                raise user_fault(self._path_of(node.label), node, error) from error
            try:
                target = node.targets[outcome]
            except (KeyError, TypeError):
                raise wrong_outcome(self._path_of(node.label), node, outcome) from None
            frame.current = target
            if frame.attention or shutdown.check is not None:
                target = self._attend(frame, node, outcome, target)
                trace = frame.trace
            elif trace is not None:
                trace((node, outcome, now(), data.copy() if data else NO_USERDATA))
        return target  # type: ignore[return-value]

    def _finish(self, frame: Frame, target: Exit) -> Any:
        if target is ASIDE:
            return SUSPENDED
        self._copy_output_keys(self.userdata, frame.parent_ud)
        return None if target is SHUTDOWN else target.label

    def _leave(self, frame: Frame) -> None:
        run = frame.strand.run
        with run.condition:
            frame.strand.pop(frame)
            if self._frame is frame:
                self._frame = None
            run.condition.notify_all()

    # Preempts.

    def request_preempt(self) -> None:
        """Ask the container to stop: the request reaches the state that runs at once."""
        super().request_preempt()
        frame = self._frame
        if frame is None:
            return
        with frame.strand.run.condition:
            if self._frame is None:
                return
            frame = self._frame
            frame.attention = True
            current = frame.current
            if isinstance(current, Node) and frame.preempted is not current:
                frame.preempted = current
                frame.strand.asked()
                current.state.request_preempt()
            frame.strand.run.condition.notify_all()

    # Interrupts.

    def _interrupted(self) -> None:
        frame = self._frame
        if frame is None:
            return
        frame.attention = True
        if any(branch.priority > frame.current.priority for branch in self._fsm_raised):
            self._cut(frame)

    def _cut(self, frame: Frame) -> None:
        current = frame.current
        if isinstance(current, Node) and frame.cut is not current:
            frame.cut = current
            frame.strand.asked()
            stop_for_now(current.state)

    def _suspend(self) -> None:
        """Have the container put aside with its history; under the run's condition."""
        frame = self._frame
        if frame is None:
            self._fsm_aside = True
            return
        frame.suspending = frame.attention = True
        self._cut(frame)

    # The container's interface.

    def get_active_states(self) -> list[str]:
        """The label of the state that runs; empty when none does."""
        frame = self._frame
        if frame is None or frame.current.is_exit:
            return []
        return [frame.current.label]
