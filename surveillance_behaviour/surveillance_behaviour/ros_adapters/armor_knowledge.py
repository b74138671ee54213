"""The ontology behind the machines' port, and where the robot is by the topic `robot_place`."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager

import state_machines as fsm
from armor_service.client import (
    ArmorClient,
    ArmorError,
    ArmorServiceCallError,
    ArmorServiceInternalError,
    Transport,
)
from state_machines.exceptions import CallError, CallInterruptedError, UnavailableError
from surveillance_ontology.patrol_vocabulary import ROBOT, OntologyNotReadyError
from surveillance_ontology.robot_ontology import RobotOntology, Snapshot

ANSWER_PATIENCE = 0.3
"""How long a server that did not answer is waited for when it is looked at again, seconds."""


class Whereabouts:
    """The last that was told on `robot_place`; written in the executor's thread.

    Attributes:
        place: Where the robot is; empty when that is not known.
        stamp: When it was seen in the last place that was known, nanoseconds of ROS time; 0: never.
    """

    def __init__(self) -> None:
        self._changed = threading.Condition()
        self._heard = False
        self.place = ''
        self.stamp = 0

    def note(self, place: str, stamp: int) -> None:
        """Take a message: the place, empty when it is not known, and nanoseconds of ROS time."""
        with self._changed:
            self._heard, self.place = True, place
            if place:
                self.stamp = stamp
            self._changed.notify_all()

    def await_place(self, place: str, seconds: float, interrupt: fsm.Interrupt) -> str:
        """Wait until the robot is in a place.

        Args:
            place: The place.
            seconds: How long at most, steady time.
            interrupt: Ends the wait early.

        Returns:
            Where it is then; empty when it is in none, or nobody said so far.
        """
        deadline = time.monotonic() + seconds

        def wake() -> None:
            with self._changed:
                self._changed.notify_all()

        forget = interrupt.subscribe(wake)
        try:
            with self._changed:
                while self.place != place and not interrupt.is_set():
                    left = deadline - time.monotonic()
                    if left <= 0.0 or not self._heard:
                        break
                    self._changed.wait(left)
                return self.place
        finally:
            forget()


class ArmorKnowledge:
    """Asks and tells ARMOR; one thread at a time.

    Args:
        client_id: Name of the client.
        transport: How directives travel to the server.
        wake: Ends the transport's call when it is raised.
        reference: Waits until the map is built and gives the ontology's reference name.
        whereabouts: Where the robot is.
        patience: How long an ontology that is built (anew), or contradicts itself, may take until
            it knows where the robot is, seconds of steady time.
        is_back: Whether a server that was away is there again; None: nobody can tell.
        look_for_answer: Returns a look whether a server that did not answer does again, which takes
            how long to wait at most, seconds; None: only another call tells.
        robot: The robot's name in the ontology.
    """

    def __init__(
        self,
        client_id: str,
        transport: Transport,
        wake: fsm.Interrupt,
        reference: Callable[[fsm.Interrupt], str],
        whereabouts: Whereabouts | None = None,
        patience: float = 0.0,
        is_back: Callable[[], bool] | None = None,
        robot: str = ROBOT,
        look_for_answer: Callable[[], Callable[[float], bool]] | None = None,
    ) -> None:
        self._is_back = is_back
        self._look_for_answer = look_for_answer
        self._answers: Callable[[float], bool] | None = None
        self._armor = ArmorClient(client_id, '', transport)
        self._ontology = RobotOntology(self._armor, robot)
        self._wake = wake
        self._ask_reference = reference
        self._whereabouts = whereabouts or Whereabouts()
        self._patience = patience

    def wait_until_built(self, interrupt: fsm.Interrupt) -> None:
        """Ask for the name of the ontology, which is answered once the map is built."""
        self._armor.reference_name = self._ask_reference(interrupt)

    def answers(self) -> bool:
        """Return whether the server answers, without the wait of a call; from a worker thread."""
        if self._answers is not None and self._answers(ANSWER_PATIENCE):
            self._answers = None
        return self._answers is None

    def place_classes(self, interrupt: fsm.Interrupt) -> tuple[str, ...]:
        """Return the classes that a place can be in."""
        with self._talking(interrupt):
            return self._ontology.place_classes()

    def await_place(self, place: str, seconds: float, interrupt: fsm.Interrupt) -> str:
        """Wait until the robot is in ``place``; return where it is then, empty when nobody says."""
        found = self._whereabouts.await_place(place, seconds, interrupt)
        if interrupt.is_set():
            raise CallInterruptedError
        return found

    def snapshot(
        self,
        now: float,
        classes: Sequence[str],
        visits: Mapping[str, float],
        interrupt: fsm.Interrupt,
        threshold: float | None = None,
        own_thresholds: Mapping[str, float] | None = None,
    ) -> Snapshot:
        """Tell the time and what the ontology does not know of ``visits``; ask what follows.

        The answer knows where the robot is by the last that was heard of it.
        """
        with self._talking(interrupt):
            return self._ontology.snapshot(
                now,
                classes,
                not_before=self._whereabouts.stamp,
                visits=visits,
                threshold=threshold,
                own_thresholds=own_thresholds,
                patience=self._patience,
                interrupt=interrupt,
            )

    def reachable(self, interrupt: fsm.Interrupt) -> frozenset[str]:
        """Return the places that an open door leads to from where the robot is."""
        with self._talking(interrupt):
            return self._ontology.reachable()

    def record_coverage(self, covered: Mapping[str, int], interrupt: fsm.Interrupt) -> None:
        """Tell how much of each place was in view within its threshold, percent."""
        with self._talking(interrupt):
            self._ontology.record_coverage(covered)

    @contextmanager
    def _talking(self, interrupt: fsm.Interrupt) -> Iterator[None]:
        """Heed the interrupt, and turn what went wrong into the ports' errors.

        Raises:
            CallError: ARMOR is away, refuses something, or the ontology is not ready.
            CallInterruptedError: The interrupt was raised.
        """
        if not self._armor.reference_name:
            self.wait_until_built(interrupt)
        forget = interrupt.subscribe(self._wake.set)
        try:
            yield
        except (ArmorError, OntologyNotReadyError) as error:
            if isinstance(error, ArmorServiceInternalError):
                # A server that was started anew does not know the ontology yet.
                self._armor.reference_name = ''
            if interrupt.is_set():
                raise CallInterruptedError from None
            if isinstance(error, ArmorServiceCallError):
                if self._look_for_answer is not None:
                    self._answers = self._look_for_answer()
                raise UnavailableError(f'armor: {error}', self._is_back) from None
            told = self._whereabouts.place or not isinstance(error, OntologyNotReadyError)
            hint = '' if told else '; nobody tells its place on robot_place'
            raise CallError(f'armor: {error}{hint}') from None
        finally:
            forget()
            self._wake.clear()
