"""The shape of a machine: its containers, states and edges, as drawings and checks need it."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field

from surveillance_fsm.active import ActiveContainer
from surveillance_fsm.concurrence import Concurrence
from surveillance_fsm.container import Container
from surveillance_fsm.engine import RESUME
from surveillance_fsm.iterator import Iterator as IteratorContainer
from surveillance_fsm.state import State


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
        return isinstance(self.container, Concurrence)

    def walk(self) -> Iterator[Structure]:
        """This container and all inside, outermost first."""
        yield self
        for inner in self.inner.values():
            yield from inner.walk()

    def all_states(self) -> dict[str, State]:
        """States and interrupts by label."""
        return {**self.states, **self.interrupts}


def structure_of(container: Container, path: str | None = None) -> Structure:
    """Describe a container and all inside it."""
    path = container._fsm_path if path is None else path
    states = dict(container.get_children())
    outcomes = sorted(container.get_registered_outcomes())
    branches = []
    if isinstance(container, ActiveContainer):
        branches = sorted(container._branches.values(), key=lambda branch: -branch.priority)
    interrupts = {branch.label: branch.state for branch in branches}
    edges = []
    for outcome, source, target in container.get_internal_edges():
        name = target or outcome
        edges.append(Edge(source, outcome, name, name not in states))
    if isinstance(container, IteratorContainer):
        ending = container._ending(container._exhausted_outcome).label
        edges += [Edge(label, container._exhausted_outcome, ending, True) for label in states]
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
    """The state at a path that begins with the container's own.

    Raises:
        KeyError: There is none; the message names the part that is missing.
    """
    root, *labels = path.split('/')
    if root != container._fsm_path:
        raise KeyError(f"Path '{path}' begins with '{root}', expected '{container._fsm_path}'")
    state: State = container
    walked = root
    for label in labels:
        children = state.get_children() if isinstance(state, Container) else {}
        if isinstance(state, ActiveContainer):
            children |= {name: branch.state for name, branch in state._branches.items()}
        if label not in children:
            raise KeyError(f"'{walked}' has no state '{label}': its states are {sorted(children)}")
        state = children[label]
        walked += f'/{label}'
    return state
