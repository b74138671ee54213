"""Transitions held against the machine that made them, without executing a state."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass

from state_machines import Container
from state_machines.structure import PossibleTransition, Structure
from state_machines.transitions import Transition, TransitionFeed


@contextmanager
def recording(machine: Container) -> Iterator[list[Transition]]:
    """Collect the transitions that a machine makes while the block runs; all are there after it."""
    seen: list[Transition] = []
    feed = TransitionFeed(machine, seen.append)
    yield seen
    feed.close()


@dataclass(frozen=True)
class Step:
    """A replayed transition.

    Attributes:
        transition: The transition.
        active: Paths of all states that are active after it.
    """

    transition: Transition
    active: tuple[str, ...]


def replay(machine: Container, transitions: Iterable[Transition]) -> Iterator[Step]:
    """Go through a record on a machine's structure, without executing a state.

    Every transition is held against the machine: a record of another version of it stops at the
    first difference.

    Args:
        machine: A machine built like the recorded one.
        transitions: The record.

    Raises:
        AssertionError: A transition that the machine cannot make.
    """
    root = Structure(machine)
    containers = {inner.path: inner for inner in root.walk()}
    active: set[str] = set(_entered(root))
    # What was active in a container when an interrupt came, the last one last.
    aside: dict[str, list[set[str]]] = {path: [] for path in containers}
    for transition in transitions:
        container = containers.get(transition.path)
        if container is None:
            raise AssertionError(
                f"Transition {transition.sequence}: no container '{transition.path}'"
            )
        _check_transition(container, transition)
        path, kind = transition.path, transition.kind
        # At an interrupt all that is in the container makes way.
        left = path if kind == 'interrupt' else f'{path}/{transition.from_state}'
        gone = {each for each in active if each.startswith(f'{left}/') or each == left != path}
        active = active - gone
        place = f'{path}/{transition.to_state}'
        before = aside[path].pop() if kind == 'resume' and aside[path] else set()
        if kind == 'interrupt':
            aside[path].append(gone)
        elif kind == 'exit' or (transition.from_state in container.interrupts and kind != 'resume'):
            aside[path].clear()
        if not transition.to_state or place in before:
            active |= before
        elif kind not in ('exit', 'ended'):
            active.add(place)
            if place in containers:
                active |= set(_entered(containers[place]))
        yield Step(transition, tuple(sorted(active)))


def _entered(container: Structure) -> list[str]:
    paths = []
    for label in container.initial:
        paths.append(f'{container.path}/{label}')
        if label in container.inner:
            paths += _entered(container.inner[label])
    return paths


def _check_transition(container: Structure, transition: Transition) -> None:
    what = f'Transition {transition.sequence} in {container.path!r}'
    states, kind = container.members, transition.kind
    left, outcome, target = transition.from_state, transition.outcome, transition.to_state
    if left not in states and not (kind == 'interrupt' and left == ''):
        raise AssertionError(f'{what}: no state {left!r}')
    if kind in ('interrupt', 'resume'):
        if target not in states and not (container.together and target == ''):
            raise AssertionError(f'{what}: no state {target!r}')
    elif kind == 'ended':
        if outcome not in states[left].get_registered_outcomes():
            raise AssertionError(f'{what}: {left!r} has no outcome {outcome!r}')
    elif kind == 'exit' and target in container.outcomes:
        # By more than edges: an iterator that was preempted, or an interrupt's state that ended
        # where the container was about to end.
        return
    elif PossibleTransition(left, outcome, target, kind == 'exit') not in container.edges:
        raise AssertionError(f'{what}: {left!r} does not lead to {target!r} by {outcome!r}')
