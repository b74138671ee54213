"""The states of a concurrence while they run: who runs, who was asked to stop, who has ended."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from typing import Any

from surveillance_fsm import log
from surveillance_fsm.active import forget, stop_for_now
from surveillance_fsm.engine import SUSPENDED, Frame, Node
from surveillance_fsm.exceptions import SmachError
from surveillance_fsm.outcome_policy import Outcomes
from surveillance_fsm.run import LeftBehind, Run, Strand
from surveillance_fsm.state import State
from surveillance_fsm.supervision import supervise
from surveillance_fsm.waiting import Interrupt


class Children:
    """Runs a concurrence's states, each on a strand of its own.

    What is asked of them, and what they are, is touched under the run's condition only.

    Args:
        states: The states by label.

    Attributes:
        outcomes: What each ended with; None for those that have not ended.
        wakeup: Raised to have the wait for them look around.
    """

    def __init__(self, states: Mapping[str, State]) -> None:
        self.outcomes: Outcomes = {}
        self.wakeup = Interrupt()
        self._states = states
        self._strands: dict[str, Strand] = {}
        self._making_way: set[str] = set()
        self._preempted: set[str] = set()
        self._gone: set[str] = set()

    def begin(self, ended: Mapping[str, str]) -> None:
        """Begin anew, or with the outcomes of those that had ended before the history was kept."""
        self.outcomes = dict.fromkeys(self._states)
        self.outcomes.update(ended)

    def ended(self) -> dict[str, str]:
        """The outcomes of those that have ended."""
        return {label: end for label, end in self.outcomes.items() if end is not None}

    def all_ended(self) -> bool:
        """Whether none is left to run."""
        return all(end is not None for end in self.outcomes.values())

    # Starting and stopping.

    def make_strands(
        self, run: Run, path: str, make_node: Callable[[str, State], Node]
    ) -> dict[str, Node]:
        """Make strands for those that have not ended; `start` starts them.

        Args:
            run: The execution that they belong to.
            path: The concurrence's.
            make_node: Makes the node of a state.

        Returns:
            Their nodes by label.
        """
        self._making_way.clear()
        self._preempted.clear()
        self._gone.clear()
        nodes, self._strands = {}, {}
        for label, state in self._states.items():
            if self.outcomes[label] is None:
                node = nodes[label] = make_node(label, state)
                strand = self._strands[label] = Strand(run, f'{path}/{label}', self.wakeup)
                strand.begin_with(state, node)
        return nodes

    def start(self, nodes: Mapping[str, Node], execute: Callable[[Node], Any]) -> None:
        """Have each strand execute its node."""
        strands = self._strands
        for label, node in nodes.items():
            strands[label].start(lambda node=node: execute(node))  # type: ignore[misc]

    def preempt(self) -> None:
        """Ask those that run to stop, each once: again could come after it has served the first."""
        asked = {
            label: strand
            for label, strand in self._strands.items()
            if not strand.done and label not in self._preempted
        }
        self._preempted.update(asked)
        self._stop(asked, _preempt)

    def make_way(self) -> None:
        """Ask those that run to stop for now, with their history kept."""
        self._making_way.update(label for label, strand in self._strands.items() if not strand.done)
        self._stop(self._strands, stop_for_now)

    def _stop(self, strands: Mapping[str, Strand], ask: Callable[[State], object]) -> None:
        for label, strand in strands.items():
            if not strand.done:
                strand.wanted = True
                strand.asked()
                ask(self._states[label])

    # Waiting for their ends.

    def wait(
        self,
        frame: Frame,
        to_stop: Callable[[], Iterable[str]],
        tell_end: Callable[[str, str], object],
    ) -> BaseException | None:
        """Watch them until all have ended or made way.

        Args:
            frame: The concurrence's.
            to_stop: Says, whenever one has ended, which of the others shall stop.
            tell_end: Called with label and outcome of each that ended.

        Returns:
            The first error of one of them, which stopped the others.

        Raises:
            LeftBehind: The machine went on without the concurrence.
        """
        run = frame.strand.run
        running = dict(self._strands)
        first_error: BaseException | None = None
        while running:
            supervise(run, list(running.values()), self.wakeup)
            if frame.stale:
                self._abandon(running)
            for label in [label for label, strand in running.items() if strand.done]:
                strand = running.pop(label)
                if strand.error is not None:
                    first_error = first_error or strand.error
                    self._stop(running, _preempt)
                    continue
                with run.condition:
                    ended = self._note_end(label, strand)
                if ended is not None:
                    tell_end(label, ended)
                if first_error is None:
                    try:
                        stop = to_stop()
                    except SmachError as error:
                        first_error, stop = error, list(running)
                    self._stop(
                        {other: running[other] for other in stop if other in running}, _preempt
                    )
        with run.condition:
            self._strands = {}
        return first_error

    def _note_end(self, label: str, strand: Strand) -> str | None:
        """Note what a state ended with; None when it only made way."""
        state, outcome = self._states[label], strand.outcome
        if strand.without_leaf:
            self._gone.add(label)
        if strand.forced is not None:
            # A preempt that it was asked for, too, is not served by that.
            outcome = strand.forced[1]
            self._preempted.discard(label)
            forget(state)
            if label not in self._gone:
                state.recall_preempt()
        elif outcome is SUSPENDED:
            return None
        elif label in self._making_way:
            made_way = not state.preempt_requested() or outcome == 'preempted'
            if label not in self._gone:
                state.recall_preempt()
            if made_way:
                return None
            # Nor by ending by itself.
            self._preempted.discard(label)
        if getattr(state, '_fsm_progress', None) is not None:
            state._fsm_progress = None
        self.outcomes[label] = outcome
        return str(outcome)

    def _abandon(self, running: Mapping[str, Strand]) -> None:
        self._stop(running, _preempt)
        for strand in running.values():
            strand.disown()
        raise LeftBehind

    def served_preempt(self, path: str, *, preempted: bool) -> bool:
        """Take back the requests that were not acknowledged; whether one of those asked did.

        Args:
            path: The concurrence's, for the log.
            preempted: The concurrence is preempted.
        """
        # A state that was left behind keeps the request, so that it ends some time.
        ignored = [
            label
            for label, state in self._states.items()
            if state.preempt_requested() and label not in self._gone
        ]
        for label in ignored:
            self._states[label].recall_preempt()
        if preempted and ignored:
            log.logwarn(f"'{path}': {ignored} did not acknowledge the preempt")
        return bool(self._preempted.difference(ignored))


def _preempt(state: State) -> None:
    state.request_preempt()
