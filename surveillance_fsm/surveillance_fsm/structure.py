"""The shape of a machine: its containers, states and edges, as drawings and checks need it."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field
from functools import cached_property

from surveillance_fsm.container import Container
from surveillance_fsm.execution import RESUME
from surveillance_fsm.state import State
from surveillance_fsm.state_machine import Iterator as IteratorContainer


@dataclass(frozen=True)
class Edge:
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


@dataclass
class Structure:
    """One container, with those inside.

    Attributes:
        path: The container's path.
        label: Its label in its parent.
        container: The container itself.
        states: Its states by label.
        interrupts: Labels and states of its interrupts, most urgent first.
        initial: Labels of the states a run begins with.
        outcomes: What it may end with.
        edges: Its transitions, in the order of the states.
        inner: The containers among its states and interrupts, by label.
    """

    path: str
    label: str
    container: Container
    states: dict[str, State]
    interrupts: dict[str, State]
    initial: list[str]
    outcomes: list[str]
    edges: list[Edge]
    inner: dict[str, Structure] = field(default_factory=dict)

    @property
    def kind(self) -> str:
        """The container's class, as in ``StateMachine``."""
        return type(self.container).__name__

    @property
    def together(self) -> bool:
        """Whether all states run at the same time."""
        return self.container.together

    def walk(self) -> Iterator[Structure]:
        """Return this container and all inside, outermost first."""
        yield self
        for inner in self.inner.values():
            yield from inner.walk()

    @cached_property
    def members(self) -> dict[str, State]:
        """States and interrupts by label."""
        return {**self.states, **self.interrupts}


def structure_of(container: Container, path: str | None = None) -> Structure:
    """Describe a container and all inside it."""
    path = container.get_name() if path is None else path
    states = dict(container.get_children())
    outcomes = sorted(container.get_registered_outcomes())
    branches = sorted(container.fsm_branches.values(), key=lambda branch: -branch.priority)
    interrupts = {branch.label: branch.state for branch in branches}
    edges = []
    for outcome, source, target in container.get_internal_edges():
        # What is not bound leads out, also where a state has the outcome's name.
        edges.append(Edge(source, outcome, target or outcome, not target or target not in states))
    if isinstance(container, IteratorContainer):
        exhausted = container.exhausted_outcome
        edges += [Edge(label, exhausted, container.ending(exhausted), True) for label in states]
    for branch in branches:
        for outcome, name in sorted(branch.transitions.items()):
            edges.append(Edge(branch.label, outcome, name, name not in states and name != RESUME))
    inner = {
        label: structure_of(state, f'{path}/{label}')
        for label, state in {**states, **interrupts}.items()
        if isinstance(state, Container)
    }
    return Structure(
        path,
        path.rpartition('/')[2],
        container,
        states,
        interrupts,
        container.get_initial_states() if states else [],
        outcomes,
        edges,
        inner,
    )


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
        children = state.fsm_children()
        if label not in children:
            raise KeyError(f"'{walked}' has no state '{label}': its states are {sorted(children)}")
        state = children[label]
        walked += f'/{label}'
    return state
