"""The shape of a machine: its containers, states and edges, as drawings and checks need it."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

from state_machines.container import Container
from state_machines.program import RESUME
from state_machines.state import State
from state_machines.state_machine import Iterator as IteratorContainer


@dataclass(frozen=True)
class PossibleTransition:
    """A transition that a container may take.

    Attributes:
        source: Label of the state.
        outcome: What it returns.
        target: Label of a state, an outcome of the container when `leaving`, or `RESUME`.
        leaving: The container ends.
    """

    source: str
    outcome: str
    target: str
    leaving: bool


class Structure:
    """One container, with those inside.

    Args:
        container: The container.
        path: Its path; by default the name it has as a root.

    Attributes:
        path: The container's path.
        label: Its label in its parent.
        kind: The container's class, as in ``StateMachine``.
        together: All states run at the same time.
        container: The container itself.
        states: Its states by label.
        interrupts: Labels and states of its interrupts, most urgent first.
        members: States and interrupts by label.
        initial: Labels of the states a run begins with.
        outcomes: What it may end with.
        edges: Its transitions, in the order of the states.
        inner: The containers among its states and interrupts, by label.
    """

    def __init__(self, container: Container, path: str | None = None) -> None:
        pending = [self]
        self._read(container, container.get_name() if path is None else path)
        while pending:
            # Not by recursion: machines may be nested deeper than Python calls.
            outer = pending.pop()
            for label, state in outer.members.items():
                if isinstance(state, Container):
                    inner = outer.inner[label] = object.__new__(Structure)
                    inner._read(state, f'{outer.path}/{label}')
                    pending.append(inner)

    def _read(self, container: Container, path: str) -> None:
        """Take over what one container says of itself."""
        program = container.fsm_program
        self.path = path
        self.label = path.rpartition('/')[2]
        self.kind = type(container).__name__
        self.together = container.together
        self.container = container
        branches = sorted(program.branches.values(), key=lambda branch: -branch.priority)
        self.states = container.get_children()
        self.interrupts = {branch.label: branch.state for branch in branches}
        self.members = self.states | self.interrupts
        self.initial = container.get_initial_states() if self.states else []
        self.outcomes = sorted(container.get_registered_outcomes())
        self.edges = [
            # What is not bound leads out, also where a state has the outcome's name.
            PossibleTransition(
                source, outcome, target or outcome, not target or target not in self.states
            )
            for outcome, source, target in container.get_internal_edges()
        ]
        if isinstance(container, IteratorContainer):
            exhausted, ending = container.exhausted_outcome, container.fsm_ending
            self.edges += [
                PossibleTransition(label, exhausted, ending(exhausted), True)
                for label in self.states
            ]
        for branch in branches:
            for outcome, name in sorted(branch.transitions.items()):
                leaving = name not in self.states and name != RESUME
                self.edges.append(PossibleTransition(branch.label, outcome, name, leaving))
        self.inner: dict[str, Structure] = {}

    def walk(self) -> Iterator[Structure]:
        """Return this container and all inside, outermost first."""
        pending = [self]
        while pending:
            structure = pending.pop()
            yield structure
            pending += reversed(structure.inner.values())


def state_at(container: Container, path: str) -> State:
    """Return the state at a path that begins with the container's own.

    Raises:
        KeyError: There is none; the message names the part that is missing.
    """
    root = container.get_name()
    if path != root and not path.startswith(f'{root}/'):
        raise KeyError(f"Path '{path}' does not begin with '{root}'")
    state: State = container
    walked = root
    labels = path[len(root) + 1 :].split('/') if path != root else []
    for label in labels:
        children = {} if state.fsm_program is None else state.fsm_program.children()
        if label not in children:
            raise KeyError(f"'{walked}' has no state '{label}': its states are {sorted(children)}")
        state = children[label]
        walked += f'/{label}'
    return state
