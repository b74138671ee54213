"""What the machines need from the rest of the robot, as small interfaces without ROS.

A machine talks to its peers only through these ports. On the robot they are services and actions
(:mod:`surveillance_behaviour.ros_adapters`); in a test they are plain Python. Every method may take
its time and ends early when the interrupt is raised. It raises `CallError` when the peer did not do
what was asked within a deadline that the port knows, `UnavailableError` when it is away.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Protocol

from patrol_policy.idleness_bounds import IdlenessBound
from patrol_policy.situation import Decision
from state_machines import Interrupt
from state_machines.exceptions import CallError
from surveillance_ontology.robot_ontology import Snapshot

Point = tuple[float, float, float]
"""x, y, z in metres, world frame."""


class UnknownPlaceError(CallError):
    """A place is not there, or not any more."""


class Ontology(Protocol):
    """What the robot and its ontology say to each other."""

    def wait_until_built(self, interrupt: Interrupt) -> None:
        """Return once the map is in the ontology."""

    def answers(self) -> bool:
        """Return whether an ontology that did not answer does again, without the wait of a call."""
        return True

    def place_classes(self, interrupt: Interrupt) -> tuple[str, ...]:
        """Return the classes that a place can be in."""

    def snapshot(
        self,
        now: float,
        classes: Sequence[str],
        visits: Mapping[str, float],
        interrupt: Interrupt,
        threshold: float | None = None,
        own_thresholds: Mapping[str, float] | None = None,
    ) -> Snapshot:
        """Tell the time and the visits that the ontology does not know, and ask what follows.

        The answer knows where the robot is by the last that was heard of it.

        Args:
            now: The robot's time, seconds.
            classes: The classes of places that matter.
            visits: When the robot was in each place last, seconds.
            interrupt: Ends it.
            threshold: Seconds without a visit after which a place is URGENT; None: as it was.
            own_thresholds: The same for places that differ and of which the ontology has none.
        """

    def reachable(self, interrupt: Interrupt) -> frozenset[str]:
        """Return the places that an open door leads to from where the robot is."""

    def record_coverage(self, covered: Mapping[str, int], interrupt: Interrupt) -> None:
        """Tell how much of each place was in view within its threshold, percent."""
        return

    def await_place(self, place: str, seconds: float, interrupt: Interrupt) -> str:
        """Wait until the robot is in ``place``, for a while; where it is then, empty: unknown."""


class Places(Protocol):
    """Where the places are."""

    def position(self, place: str, interrupt: Interrupt) -> Point:
        """Return a point in the place; raises UnknownPlaceError when there is no such place.

        A recharge room's name with `AT_STATION` behind it stands for its charging station.
        """


class Reasoner(Protocol):
    """Who decides where the robot goes: a `DecisionMaker`, here or in another process.

    A class need not define the methods that return nothing: it is then told in vain.
    """

    @property
    def places(self) -> frozenset[str]:
        """All places of the map, as far as is known."""

    @property
    def idleness_bounds(self) -> tuple[IdlenessBound, ...]:
        """What can be kept of each place, as far as is known."""
        return ()

    def begin(self, now: float, interrupt: Interrupt) -> str:
        """Look at the map for the first time; where the robot is."""

    def decide(
        self,
        now: float,
        interrupt: Interrupt,
        avoided: frozenset[str],
        *,
        to_charge: bool = False,
    ) -> Decision:
        """Choose where to go next; raises NowhereToGoError when nothing can be reached.

        Args:
            now: Seconds on the mission's clock.
            interrupt: Ends it.
            avoided: Places that could not be reached lately.
            to_charge: Only a charging place will do.
        """

    def exploring(self, place: str, usual: float) -> float:
        """Return the seconds for which a place is explored; ``usual`` unless it differs."""
        return usual

    def why_charge(self) -> str:
        """Return why the robot must charge now, as a sentence; empty: it need not."""

    def dock_is_taken(self) -> bool:
        """Return whether another robot of the fleet charges where this one is."""
        return False

    def charge_is_over(self, now: float) -> bool:
        """Return whether the robot may go on though its battery is not full: a fleet's charges in
        passing have their time.

        Args:
            now: Seconds on the mission's clock.
        """
        return False

    def send_to_charge(self, why: str) -> None:
        """Have the robot charge before anything else."""
        return

    def saw(self, place: str, now: float) -> None:
        """Note that the robot is in ``place``."""
        return

    def arrived(self, place: str, now: float, metres: float | None = None) -> None:
        """Note that the robot has come to ``place`` over a path of so many metres."""
        return

    def disturbed(self) -> None:
        """Note that the present drive is no example of how long a leg takes."""
        return

    def charged(self) -> None:
        """Note that the battery was charged."""
        return

    def detour(self, start: str, goal: str) -> tuple[str, ...]:
        """Return the places of another way between two neighbours, ``goal`` included; empty:
        none.
        """


class Motion(Protocol):
    """The planner and the motion controller of the behaviour `surveillance`."""

    def plan(self, start: Point, goal: Point, interrupt: Interrupt) -> list[Point]:
        """Return a path from ``start`` to ``goal``, both included."""

    def follow(self, path: Sequence[Point], interrupt: Interrupt) -> Point:
        """Drive along the path; return where the robot is at the end."""

    def last_position(self) -> Point | None:
        """Return where the robot was when it was last heard of; None: never."""

    def driven(self) -> list[Point]:
        """Return where the robot was on its way, since this was asked last."""


class Routine(Protocol):
    """The services and actions of the behaviour `patrol`."""

    def start(self, interrupt: Interrupt) -> None:
        """Look around and build the ontology."""

    def plan(self, target: str, interrupt: Interrupt) -> list[Point]:
        """Via points from where the robot is to the place."""

    def control(self, via_points: Sequence[Point], interrupt: Interrupt) -> Point:
        """Drive through the points and note the visit; return where the robot is at the end."""

    def recharge(self, interrupt: Interrupt) -> None:
        """Charge the battery; return when the peer says it is done."""


@dataclass(frozen=True)
class Doubt:
    """An alert that waits for a second look.

    Attributes:
        number: Of the event.
        place: Where it was noticed.
        look_from: From where to look again; None: from anywhere in the place.
        position: Where it was noticed; None: nobody knows.
    """

    number: int
    place: str
    look_from: Point | None = None
    position: Point | None = None


@dataclass(frozen=True)
class Check:
    """What a person's rules want to have seen in a place, such as the spot of a marker.

    Attributes:
        name: Names it in the record, `marker 21`.
        point: Where it is.
        look_from: From where it is to be seen well; None: from the place's own point.
        is_open: Whether it was looked at, and what that means is not settled.
    """

    name: str
    point: Point
    look_from: Point | None = None
    is_open: bool = False


class InspectionPort(Protocol):
    """Who knows from where a place is to be looked at, and moves the robot there."""

    def viewpoints(self, place: str) -> Sequence[Point]:
        """Return from where else than its point a place is to be looked at."""

    def doubts(self, place: str) -> Sequence[Doubt]:
        """Return the alerts in a place that wait for a second look."""

    def checks(self, place: str) -> Sequence[Check]:
        """Return what is to be seen in a place before all else."""

    def camera_angle(self) -> float | None:
        """Return how much of the horizon a picture shows, rad; None: nobody has said."""

    def saw(self, bearing: float) -> int:
        """Return how many pictures to a bearing, map frame, rad, were looked at that were taken
        since the camera was turned last. Where no pictures are looked at, the lidar has seen it.
        """

    def position(self) -> Point | None:
        """Return where the robot is; None: nobody has said."""

    def heading(self) -> float:
        """Return where the robot's front points, map frame, rad; 0 where nobody has said."""

    def await_watcher(self, interrupt: Interrupt) -> None:
        """Wait until who watches is ready to look; once, and not for ever."""

    def sees_around(self) -> bool:
        """Tell whether a turn shows nothing more: lidars all around, and no camera."""

    def has_arm(self) -> bool:
        """Tell whether an arm turns the camera."""

    def drive(self, point: Point, interrupt: Interrupt) -> None:
        """Drive to a point in the same place."""

    def face(self, bearing: float, interrupt: Interrupt) -> None:
        """Turn the camera to a bearing in the map frame, rad: the arm, or the base without one."""

    def rest_arm(self) -> None:
        """Have the arm look ahead, if there is one; nobody waits for it."""


class SweepPort(Protocol):
    """Who knows how much of a place was in view, and from where to see the rest."""

    def is_swept(self, place: str) -> bool:
        """Tell whether a visit is to cover all of a place."""

    def threshold(self, place: str) -> float:
        """Return after how many seconds without a visit a place is URGENT."""

    def begin(self, place: str, since: float) -> float | None:
        """Begin to sweep a place.

        Args:
            place: Where the robot is.
            since: What was in view since then need not be seen again, seconds.

        Returns:
            The metres of the way; None: the map does not show the place, or not the robot.
        """

    def next_stop(self) -> Point | None:
        """Return where to drive next; None: nothing that can be seen is left."""

    def leave_out(self, stop: Point) -> None:
        """Take note that a stop cannot be reached."""

    def drive(self, stop: Point, interrupt: Interrupt) -> None:
        """Drive to a point in the same place, and look around there with what must be turned."""

    def position(self) -> Point | None:
        """Return where the robot is; None: nobody has said."""

    def end(self, seconds: float | None) -> tuple[float, float]:
        """End the sweep; return which part of the place was in view since the sweep's time, and
        the metres driven.

        Args:
            seconds: How long it took; None: it was not finished.
        """

    def covered(self) -> Mapping[str, float]:
        """Return which part of each place was in view within its threshold."""


class Announcer(Protocol):
    """Where the machine says what it does."""

    def say(self, text: str, *, warning: bool = False) -> None:
        """Something worth knowing happened."""

    def waiting_for_help(self, reason: str) -> None:
        """Announce that the robot waits for help because of ``reason``; an empty reason: it goes
        on.
        """


@dataclass
class Ports:
    """Whom the machines talk to.

    ``motion`` serves the machine `surveillance`, ``routine`` the machine `patrol`; ``looking`` is
    None where nobody watches, ``sweeping`` where nobody knows what was in view.
    """

    ontology: Ontology
    places: Places
    announcer: Announcer
    reasoner: Reasoner
    motion: Motion | None = None
    routine: Routine | None = None
    looking: InspectionPort | None = None
    sweeping: SweepPort | None = None
