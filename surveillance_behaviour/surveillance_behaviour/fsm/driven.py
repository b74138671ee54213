"""Containers in which one state runs at a time: their loop and all that may come between states.

`StateMachine` and `Iterator` differ in how their table of nodes is made; what happens between two
states is the same for both and is here: preempts are passed on, interrupts cut in and are resumed
from, transitions are reported, a paused machine stands still.
"""

from __future__ import annotations

import threading
from abc import abstractmethod
from collections.abc import Iterable
from typing import Any

from surveillance_behaviour.fsm import log, shutdown
from surveillance_behaviour.fsm.active import ActiveContainer, forget, let_go, stop_for_now
from surveillance_behaviour.fsm.container import Container
from surveillance_behaviour.fsm.engine import (
    LOWEST,
    RESUME,
    RESUMPTION,
    SUSPENDED,
    Exit,
    Frame,
    Node,
)
from surveillance_behaviour.fsm.exceptions import (
    InvalidStateError,
    SmachError,
)
from surveillance_behaviour.fsm.limits import settle
from surveillance_behaviour.fsm.nodes import make_node, user_fault, wrong_outcome
from surveillance_behaviour.fsm.run import LeftBehind, Strand
from surveillance_behaviour.fsm.state import State
from surveillance_behaviour.fsm.waiting import Clock

_start_lock = threading.Lock()
_SHUTDOWN = Exit('shutdown')
_ASIDE = Exit('aside')


class DrivenContainer(ActiveContainer):
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
        path, now, trace = frame.path, frame.now, frame.trace
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
                trace((path, node.label, outcome, target.label, now(), data.copy(), target.kind))
        return target  # type: ignore[return-value]

    def _target(self, node: Node, outcome: Any) -> Node | Exit:
        try:
            return node.targets[outcome]
        except (KeyError, TypeError):
            raise wrong_outcome(self._path_of(node.label), node, outcome) from None

    def _finish(self, frame: Frame, target: Exit) -> Any:
        if target is _ASIDE:
            return SUSPENDED
        self._copy_output_keys(self.userdata, frame.parent_ud)
        return None if target is _SHUTDOWN else target.label

    def _leave(self, frame: Frame) -> None:
        run = frame.strand.run
        with run.condition:
            frame.strand.pop(frame)
            if self._frame is frame:
                self._frame = None
            run.condition.notify_all()

    # Between two states.

    def _attend(
        self, frame: Frame, left: Node | None, outcome: Any, target: Node | Exit
    ) -> Node | Exit:
        """Do what comes between two states beside the transition itself.

        Args:
            frame: The execution.
            left: The state that ended; None at the start.
            outcome: What it returned.
            target: Where that leads by the table.

        Returns:
            Where to go.
        """
        run = frame.strand.run
        ended = left
        with run.condition:
            if frame.stale:
                raise LeftBehind
            frame.strand.heeded()
            frame.attention = False
            kind = 'start' if left is None else 'transition'
            while True:
                if frame.cut is not None and frame.cut is not ended:
                    # It was asked to make way before it began.
                    let_go(frame.cut.state)
                    if frame.preempted is frame.cut:
                        frame.preempted = None  # It is asked again below.
                    frame.cut = None
                if frame.forced is not None and frame.forced[0] is ended:
                    outcome, kind = frame.forced[1], 'forced'
                    target = self._target(frame.forced[0], outcome)
                    self._drop_requests(frame, frame.forced[0])
                elif ended is not None:
                    target = self._sort_requests(frame, ended, outcome, target)
                if ended is not None and ended.priority > LOWEST and target is not ended:
                    target, kind = self._leave_branch(frame, target, kind)
                ended = None
                if self._preempt_requested and isinstance(target, Node):
                    self._preempt_next(frame, target)
                elif frame.suspending and isinstance(target, Node):
                    self._fsm_history = frame.history(target)
                    return _ASIDE
                elif self._fsm_raised and not self._preempt_requested:
                    target, kind = self._branch_off(frame, target, kind)
                if shutdown.is_shutdown():
                    target = _SHUTDOWN
                frame.current = target
                if not self._stands_still(frame, target):
                    break
                run.condition.wait()
                if frame.stale:
                    raise LeftBehind
                if frame.forced is not None and frame.forced[0] is target:
                    left = ended = frame.forced[0]
            frame.attention = self._wants_attention(frame, target)
            frame.trace = run.trace
        if target is _SHUTDOWN:
            pass
        elif left is not None:
            self._tell(frame, left, outcome, target, kind)
        elif frame.trace is not None:
            frame.trace((frame.path, '', '', target.label, frame.now(), {}, 'start'))
        return target

    def _sort_requests(
        self, frame: Frame, left: Node, outcome: Any, target: Node | Exit
    ) -> Node | Exit:
        """Settle what was asked of the state that ended: a preempt, or to make way."""
        state, cut, made_way = left.state, frame.cut, False
        asked = frame.preempted is left
        gone = frame.gone is left
        # A state that was left behind keeps the request, and has not ignored it any longer.
        pending = state.preempt_requested() and not gone
        frame.cut = frame.gone = None
        if asked:
            frame.preempted = None
        if cut is left and outcome is not SUSPENDED and (pending or not asked):
            # With both asked and one still pending, what it served was to make way.
            made_way = not pending or outcome == 'preempted'
            if not gone:
                state.recall_preempt()
        elif asked and pending:
            state.recall_preempt()
        elif asked and self._preempt_requested:
            self.service_preempt()
        if made_way:
            target = left
        if made_way or outcome is SUSPENDED:
            frame.repeat = True
        if not made_way and getattr(state, '_fsm_progress', None) is not None:
            state._fsm_progress = None
        return target

    def _drop_requests(self, frame: Frame, left: Node) -> None:
        left.state.recall_preempt()
        forget(left.state)
        frame.forced = frame.preempted = frame.cut = None

    def _preempt_next(self, frame: Frame, target: Any) -> None:
        """Ask the next state to stop, because the last one did not acknowledge the preempt."""
        if frame.preempted is not target:
            if frame.preempted is not None:
                frame.preempted.state.recall_preempt()
            frame.preempted = target
            frame.strand.asked()
            target.state.request_preempt()

    def _stands_still(self, frame: Frame, target: Node | Exit) -> bool:
        """Whether the machine is paused here; takes one step if it may."""
        run = frame.strand.run
        if not run.paused or not isinstance(target, Node) or isinstance(target.state, Container):
            return False
        if frame.forced is not None or frame.suspending:
            return False
        if any(other.container._preempt_requested for other in frame.strand.stack):
            return False
        if run.steps:
            run.steps -= 1
            return False
        return True

    def _wants_attention(self, frame: Frame, target: Node | Exit) -> bool:
        return bool(
            log.chatty()
            or self._transition_cbs
            or self._termination_cbs
            or self._preempt_requested
            or self._fsm_raised
            or frame.saved
            or frame.suspending
            or frame.cut
            or frame.forced
            or frame.strand.run.paused
            or self._always_attend
            or (isinstance(target, Node) and getattr(target.state, '_fsm_progress', None))
        )

    _always_attend = False

    def _tell(self, frame: Frame, left: Node, outcome: Any, target: Node | Exit, kind: str) -> None:
        if frame.trace is not None:
            kind = target.kind if target.is_exit else kind
            data = self.userdata._data.copy()
            frame.trace((frame.path, left.label, outcome, target.label, frame.now(), data, kind))
        if log.chatty():
            verb = 'ends' if target.is_exit else 'goes on'
            log.loginfo(f"'{frame.path}' {verb}: '{left.label}' : '{outcome}' --> '{target.label}'")
        if target.is_exit:
            self.call_termination_cbs([left.label], target.label)
        else:
            self.call_transition_cbs()

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

    def _branch_off(self, frame: Frame, target: Node | Exit, kind: str) -> tuple[Node | Exit, str]:
        """Enter the branch of the most urgent interrupt, if it is more urgent than `target`."""
        urgent = max(self._fsm_raised, key=lambda branch: branch.priority)
        if urgent.priority <= target.priority:
            return target, kind
        self._fsm_raised.remove(urgent)
        frame.saved.append(target)
        return self._table[urgent.label], 'interrupt'

    def _leave_branch(
        self, frame: Frame, target: Node | Exit, kind: str
    ) -> tuple[Node | Exit, str]:
        """Go back to where the interrupt came, or forget that place."""
        if target is RESUMPTION:
            return frame.saved.pop(), 'resume'
        for node in frame.saved:
            if isinstance(node, Node):
                forget(node.state)
        frame.saved.clear()
        return target, kind

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
