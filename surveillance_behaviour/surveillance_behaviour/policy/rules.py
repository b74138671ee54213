"""Rules before policy: which places may be chosen at all, and the sentence that says why.

The rules are a list of classes of places in order of priority. The first class that has a
reachable member decides: its members are the candidates, and the policy chooses among them.
Charging stands above all of them.
"""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass

from surveillance_behaviour.policy.policies import Policy
from surveillance_behaviour.policy.situation import Decision, Situation

RECHARGE = 'recharge'
"""The rule of a decision to go charging."""
ANY = 'any'
"""The rule of a decision for which no class had a reachable member."""
DEFAULT_RULES = ('URGENT', 'CORRIDOR', 'ROOM')


class NowhereToGoError(RuntimeError):
    """No place can be reached from where the robot is."""


@dataclass(frozen=True)
class Rules:
    """Classes of places by falling priority.

    Attributes:
        classes: Names of classes of the ontology; with none, every reachable place may be chosen.

    Raises:
        ValueError: A name is no class name, or stands twice.
    """

    classes: tuple[str, ...] = DEFAULT_RULES

    def __post_init__(self) -> None:
        for position, name in enumerate(self.classes):
            if not re.fullmatch(r'[A-Za-z_][\w.-]*', name):
                raise ValueError(f'{name!r} is not the name of a class of places')
            if name in self.classes[:position]:
                raise ValueError(f'{name} stands twice in the list of rules')

    def candidates(self, situation: Situation) -> tuple[str, tuple[str, ...]]:
        """The rule whose turn it is and the places it allows.

        Places that could not be reached lately only count when nothing else can be reached.

        Raises:
            NowhereToGoError: Nothing is reachable.
        """
        reachable = [place for place in situation.reachable if place != situation.place]
        if not reachable:
            raise NowhereToGoError(f'nothing can be reached from {situation.place}')
        open_places = [place for place in reachable if place not in situation.avoided] or reachable
        for name in self.classes:
            members = [p for p in open_places if name in situation.classes.get(p, frozenset())]
            if members:
                return name, tuple(sorted(members))
        return ANY, tuple(sorted(open_places))


def decide(situation: Situation, rules: Rules, policy: Policy, name: str) -> Decision:
    """Chooses the next place.

    Among equals it takes the place that went unvisited longest, then the first by name.

    Args:
        situation: What is known.
        rules: Which places may be chosen.
        policy: Which of them is best.
        name: The policy's name, for the reason.

    Raises:
        NowhereToGoError: Nothing is reachable.
    """
    rule, allowed = rules.candidates(situation)
    scores = policy(situation, allowed)
    order = sorted(allowed)
    best = max(
        order,
        key=lambda place: (
            round(scores[place].value, 6),
            situation.unvisited(place),
            -order.index(place),
        ),
    )
    if len(allowed) == 1:
        choice = f'{best} is the only {_kind(rule)} place within reach'
    else:
        choice = f'{best} of {len(allowed)} {_kind(rule)} places within reach, by {name}'
    if rule == 'URGENT':
        choice += (
            f' (unvisited {situation.unvisited(best):.1f} s, threshold {situation.threshold:g} s)'
        )
    return Decision(
        time=situation.now,
        from_place=situation.place,
        place=best,
        target=scores[best].target,
        rule=rule,
        policy=name,
        reason=f'{choice}: {scores[best].words}',
        scores={place: scores[place].value for place in order},
    )


def decide_to_charge(situation: Situation, stations: Sequence[str], why: str) -> Decision:
    """Sends the robot to the nearest place where it can charge, wherever that is.

    Args:
        situation: What is known.
        stations: The places with a charging station.
        why: What the battery says, as a sentence.

    Raises:
        NowhereToGoError: None of them can be reached.
    """
    graph = situation.graph
    away = {
        station: graph.seconds(situation.place, station)
        for station in stations
        if station in graph.index
    }
    within = {station: seconds for station, seconds in away.items() if seconds < float('inf')}
    if not within:
        raise NowhereToGoError(
            f'no charging place ({", ".join(stations)}) can be reached from {situation.place}'
        )
    best = min(sorted(within), key=lambda station: (station in situation.avoided, within[station]))
    return Decision(
        time=situation.now,
        from_place=situation.place,
        place=best,
        target=best,
        rule=RECHARGE,
        policy='nearest',
        reason=f'{why}: {best} is the nearest charging place, {within[best]:.1f} s away',
        scores={station: -seconds for station, seconds in sorted(within.items())},
    )


def _kind(rule: str) -> str:
    return 'open' if rule == ANY else rule


def tour_warning(graph_tour: float, threshold: float) -> str:
    """What to say when no robot can keep to the threshold; empty when one can.

    Args:
        graph_tour: Length of the shortest closed tour, seconds.
        threshold: The urgency threshold, seconds.
    """
    if threshold >= graph_tour:
        return ''
    return (
        f'urgency_threshold is {threshold:g} s, but the shortest tour of all places takes '
        f'{graph_tour:.1f} s: no robot can keep them from becoming URGENT'
    )
