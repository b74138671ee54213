"""What the machines need from the rest of the robot, as small interfaces without ROS.

A machine talks to its peers only through these ports. On the robot they are services and actions
(:mod:`surveillance_behaviour.peers.ros_ports`); in a test they are plain Python. Every method may
take its time, ends early when the interrupt is raised, and raises :class:`PeerError` when the peer
did not do what was asked - within a deadline that the port knows.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Protocol

from surveillance_behaviour.policy.situation import Decision
from surveillance_fsm import Interrupt

Point = tuple[float, float, float]
"""x, y, z in metres, world frame."""


class PeerError(Exception):
    """A peer did not do what was asked.

    Args:
        peer: Who: the service, action or node.
        reason: What went wrong, as a clause.
    """

    def __init__(self, peer: str, reason: str) -> None:
        super().__init__(f'{peer}: {reason}')
        self.peer = peer
        self.reason = reason


class AwayError(PeerError):
    """A peer is not there, or went away: no other path or place helps, only its return."""


class UnknownPlaceError(PeerError):
    """A place is not there, or not any more."""


class InterruptedWaitError(Exception):
    """The interrupt was raised while a port was at work; what ran on the peer was cancelled."""


@dataclass(frozen=True)
class Beliefs:
    """What the ontology says, all of one moment.

    Attributes:
        place: Where the robot is.
        reachable: Where it can go from there in one move.
        classes: The classes of every place, as far as the rules ask for them.
        visited_at: When each place was visited last, seconds; without those that never were.
        connections: The neighbours of every place.
    """

    place: str
    reachable: tuple[str, ...]
    classes: Mapping[str, frozenset[str]]
    visited_at: Mapping[str, float]
    connections: Mapping[str, tuple[str, ...]]


class Knowledge(Protocol):
    """The ontology."""

    def wait_until_built(self, interrupt: Interrupt) -> None:
        """Returns once the map is in the ontology."""

    def set_urgency_threshold(self, seconds: float, interrupt: Interrupt) -> None:
        """Sets the time after which a place becomes URGENT."""

    def beliefs(
        self,
        classes: Sequence[str],
        now: float,
        interrupt: Interrupt,
        visits: Mapping[str, float] | None = None,
    ) -> Beliefs:
        """Tells the ontology the time and the visits that it does not know; asks what follows."""

    def await_place(self, place: str, seconds: float, interrupt: Interrupt) -> str:
        """Waits until the robot is in ``place``, for a while; where it is then, empty: unknown."""


class Places(Protocol):
    """Where the places are."""

    def position(self, place: str, interrupt: Interrupt) -> Point:
        """A point in the place; raises UnknownPlaceError when there is no such place."""


class Motion(Protocol):
    """The first seed's planner and motion controller."""

    def plan(self, start: Point, goal: Point, interrupt: Interrupt) -> list[Point]:
        """A path from ``start`` to ``goal``, both included."""

    def follow(self, path: Sequence[Point], interrupt: Interrupt) -> Point:
        """Drives along the path; where the robot is at the end."""

    def last_position(self) -> Point | None:
        """Where the robot was when it was last heard of; None: never."""


class Routine(Protocol):
    """The second seed's services and actions."""

    def start(self, interrupt: Interrupt) -> None:
        """Looks around and builds the ontology."""

    def reason(self, interrupt: Interrupt) -> str:
        """The place to visit next."""

    def plan(self, target: str, interrupt: Interrupt) -> list[Point]:
        """Via points from where the robot is to the place."""

    def control(self, via_points: Sequence[Point], interrupt: Interrupt) -> Point:
        """Drives through the points and notes the visit; where the robot is at the end."""

    def recharge(self, interrupt: Interrupt) -> None:
        """Charges the battery; returns when the peer says it is done."""


class Announcer(Protocol):
    """Where the machine says what it does."""

    def decision(self, decision: Decision) -> None:
        """A place was chosen."""

    def say(self, text: str, *, warning: bool = False) -> None:
        """Something worth knowing happened."""

    def waiting_for_help(self, reason: str) -> None:
        """The robot waits for help because of ``reason``; an empty reason: it goes on."""


@dataclass
class Ports:
    """Whom the machines talk to; ``motion`` serves the first seed's, ``routine`` the second's."""

    knowledge: Knowledge
    places: Places
    announcer: Announcer
    motion: Motion | None = None
    routine: Routine | None = None
