"""What a running container is made of: nodes, exits, the frame of one execution, its history."""

from __future__ import annotations

import itertools
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any, NamedTuple

from surveillance_fsm.exceptions import InvalidStateError
from surveillance_fsm.state import State

if TYPE_CHECKING:
    from surveillance_fsm.limits import Limits
    from surveillance_fsm.run import Strand

LOWEST = float('-inf')
"""The priority of ordinary work, below that of every interrupt."""


class _Suspended:
    """What a container returns when its parent put it aside with its history kept."""

    def __repr__(self) -> str:
        return 'SUSPENDED'


SUSPENDED: Any = _Suspended()


class Exit:
    """Where a transition leaves the container."""

    __slots__ = ('label',)

    is_exit = True
    priority = LOWEST
    kind = 'exit'

    def __init__(self, label: str) -> None:
        self.label = label


RESUME = 'RESUME'
"""Target of an interrupt's outcome: go on where the interrupt came."""

RESUMPTION = Exit(RESUME)


class Node:
    """One state of a container as the loop needs it.

    Attributes:
        label: The state's label in its container.
        path: The container's path.
        state: The state.
        enter: What runs it; the state's own `execute` as a rule.
        execute: What the loop calls: `enter`, within the state's limits if it has any.
        make_view: Makes a view.
        view: The state's view of the container's userdata.
        targets: Where each outcome leads.
        limits: Time limits and retries, if it has any.
        priority: Of an interrupt's branch; `LOWEST` for ordinary states.
    """

    __slots__ = (
        'enter',
        'execute',
        'label',
        'limits',
        'make_view',
        'path',
        'priority',
        'state',
        'targets',
        'view',
    )

    is_exit = False
    kind = 'transition'

    def __init__(
        self,
        path: str,
        label: str,
        state: State,
        make_view: Callable[[], Any],
        priority: float = LOWEST,
    ) -> None:
        self.path = path
        self.label = label
        self.state = state
        self.enter: Callable[[Any], Any] = state.execute
        self.execute: Callable[[Any], Any] = self.enter
        self.make_view = make_view
        self.view = make_view()
        self.targets: dict[Any, Node | Exit] = {SUSPENDED: self}
        self.limits: Limits | None = None
        self.priority = priority

    def step(self, outcome: Any) -> tuple[str, str, str, str]:
        """What `outcome` leads to by the table: (path of the container, from, to, kind)."""
        target = self.targets[outcome]
        return self.path, self.label, target.label, target.kind

    def revoke(self) -> None:
        """Cut the view in use off the userdata, and make a new one for the next execution."""
        self.view._revoke()
        self.view = self.make_view()


class SpecialStep:
    """A step that is not what the table says, told to a trace in place of the node that was left.

    Args:
        path: Path of the container.
        source: Label of the state that was left; empty at the start.
        target: Label of the state or the outcome reached.
        kind: See `Transition`.
    """

    __slots__ = ('_step',)

    def __init__(self, path: str, source: str, target: str, kind: str) -> None:
        self._step = path, source, target, kind

    def step(self, _outcome: Any) -> tuple[str, str, str, str]:
        """As `Node.step`."""
        return self._step


RawTransition = tuple[Node | SpecialStep, Any, float, dict[str, Any]]
"""(what was left, outcome, time in seconds, shallow copy of the container's userdata)."""

Trace = Callable[[RawTransition], object]
"""Takes transitions as the loop notes them, at the least cost to the machine; see `unfold`."""

NO_USERDATA: dict[str, Any] = {}
"""Stands for a copy of userdata that holds nothing; never written to."""


class Noted(NamedTuple):
    """A transition as it was noted.

    Attributes:
        path: Path of the container.
        source: Label of the state that was left; empty at the start.
        outcome: What that ended with.
        target: Label of the state entered, or the container's outcome.
        time: Seconds on the machine's clock.
        userdata: Shallow copy of the container's userdata.
        kind: See `Transition`; also ``start``, when a container is entered.
    """

    path: str
    source: str
    outcome: str
    target: str
    time: float
    userdata: dict[str, Any]
    kind: str


def unfold(raw: RawTransition) -> Noted:
    """Say in full what a trace was given."""
    left, outcome, time, userdata = raw
    path, source, target, kind = left.step(outcome)
    return Noted(path, source, str(outcome), target, time, userdata, kind)


@dataclass
class History:
    """Where a container that was put aside goes on.

    Attributes:
        current: Label of the state, or of the outcome when `leaving`.
        leaving: `current` is an outcome of the container.
        saved: Of the interrupts under way, where each goes on: (label, leaving).
        index: How many items an iterator had begun, the current one included.
        outcomes: Of a concurrence's children that had ended.
    """

    current: str = ''
    leaving: bool = False
    saved: list[tuple[str, bool]] = field(default_factory=list)
    index: int = 0
    outcomes: dict[str, str] = field(default_factory=dict)
    # An iterator suspended in this process goes on with its own generator.
    items: Any = None


class Frame:
    """One execution of a container.

    The thread that executes writes `current` first and looks at `attention` after; a thread that
    wants something raises `attention` first and looks at `current` after. So one of the two always
    sees the other, and the loop needs no lock. Everything else is touched under the run's condition
    only.

    Attributes:
        container: Whose execution it is.
        strand: The thread of execution it belongs to.
        path: The container's path.
        current: The node that executes, or the exit that was taken.
        attention: Something beside the next state wants to be looked at.
        stale: The machine went on without the thread that runs this frame.
        preempted: The node whose state was last asked to stop because of a preempt.
        cut: The node whose state was asked to stop because of an interrupt.
        suspending: The parent wants the container put aside.
        saved: Where to go on after each of the interrupts under way.
        gone: The node whose state was left behind.
        forced: A node, and the outcome to take in place of the one that its state returns.
        parent_ud: The parent's userdata.
        trace: Where transitions are reported.
        now: The trace's clock.
        items: An iterator's items that are left.
        repeat: The current state is executed again where it was cut short.
        index: How many items an iterator has begun.
    """

    __slots__ = (
        'attention',
        'container',
        'current',
        'cut',
        'forced',
        'gone',
        'index',
        'items',
        'now',
        'parent_ud',
        'path',
        'preempted',
        'repeat',
        'saved',
        'stale',
        'strand',
        'suspending',
        'trace',
    )

    def __init__(
        self, container: Any, strand: Strand, path: str, current: Node | Exit, parent_ud: Any
    ) -> None:
        self.container = container
        self.strand = strand
        self.path = path
        self.current = current
        self.parent_ud = parent_ud
        self.attention = True
        self.stale = False
        self.preempted: Node | None = None
        self.cut: Node | None = None
        self.suspending = False
        self.saved: list[Node | Exit] = []
        self.forced: tuple[Node, str] | None = None
        self.gone: Node | None = None
        self.trace: Trace | None = strand.run.trace
        self.now = strand.run.now
        self.items: Any = None
        self.index = 0
        self.repeat = False

    def successor(self) -> Frame:
        """A copy for the thread that takes this execution over."""
        frame = Frame(self.container, self.strand, self.path, self.current, self.parent_ud)
        for name in (
            'preempted',
            'cut',
            'suspending',
            'forced',
            'items',
            'index',
            'repeat',
        ):
            setattr(frame, name, getattr(self, name))
        frame.saved = list(self.saved)
        return frame

    def history(self, target: Node | Exit) -> History:
        """Where to go on when the container is put aside before `target`."""
        return History(
            target.label,
            target.is_exit,
            [(node.label, node.is_exit) for node in self.saved],
            self.index,
            items=self.items,
        )

    def go_on_from(self, history: History, table: Mapping[str, Node]) -> None:
        """Begin where the container was put aside.

        Raises:
            InvalidStateError: It has no such state any more.
        """

        def place(label: str, leaving: bool) -> Node | Exit:
            if leaving:
                return Exit(label)
            if label not in table:
                raise InvalidStateError(
                    f"'{self.path}' cannot go on in '{label}': its states are {sorted(table)}"
                )
            return table[label]

        self.saved = [place(*saved) for saved in history.saved]
        self.current = place(history.current, history.leaving)
        self.index, self.items = history.index, history.items
        self.repeat = True

    @property
    def wanted(self) -> bool:
        """Whether somebody wants the current state to end."""
        return bool(
            self.container._preempt_requested
            or self.cut is not None
            or self.suspending
            or self.forced is not None
        )


@dataclass
class Branch:
    """An interrupt declared on a container.

    Attributes:
        label: Its name.
        state: What runs when it is raised.
        priority: It cuts work of lower priority short.
        transitions: From the state's outcomes to `RESUME`, labels or outcomes of the container.
        remapping: From the state's userdata keys to the container's.
    """

    label: str
    state: State
    priority: float
    transitions: dict[str, str]
    remapping: dict[str, str]
    order: int = field(default_factory=itertools.count().__next__)
