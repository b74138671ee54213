"""Patrols that are simulated ahead on a map with rules.

`roll_out` moves a `PatrolState` by a choice function until the state comes back, which proves the
longest wait for ever, or until a horizon (a rollout, as in Bertsekas, "Rollout algorithms for
combinatorial optimization", 1997).
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field

import numpy as np

from patrol_policy.rule_graph import PatrolState, RuleGraph

MOST_MOVES = 6000
"""Moves that one simulation takes at most, whatever the threshold."""
MOVES_A_PLACE = 4
"""Further moves for each place of the map."""
LOOK_EVERY = 64
"""Moves between two looks at the clock."""

Choice = Callable[[RuleGraph, PatrolState], int]
"""Returns a stop: a neighbour that the rules allow, or a charge; the robot's own place when there
is none. It may change the position, and goes on equally from an equal state."""


@dataclass(frozen=True, order=True)
class Outcome:
    """What a way to choose comes to; less is better.

    Attributes:
        settled: The longest wait from visit to visit, less what the place has more time, seconds.
        first: The same with the waits before a place's first visit, seconds.
        lasting: The same of the part that repeats itself alone, so of what comes for ever, seconds.
        waits: For each place the longest wait, the last one as far as it was looked at, seconds.
        walk: The stops that were entered.
        back: From where on the walk repeats itself; None: that was not found.
        cut: Whether the simulation was ended before its horizon.
    """

    settled: float
    first: float
    lasting: float = math.inf
    waits: Sequence[float] = field(default=(), compare=False)
    walk: Sequence[int] = field(default=(), compare=False)
    back: int | None = field(default=None, compare=False)
    cut: bool = field(default=False, compare=False)

    def repeated_from(self, rules: RuleGraph) -> int | None:
        """Return from where on the walk may be repeated; None: it does not visit all places."""
        last = {rules.places[stop]: step for step, stop in enumerate(self.walk)}
        if self.back is not None or any(place not in last for place in rules.wanted):
            return self.back
        return min(last.values())


def roll_out(
    rules: RuleGraph,
    choose: Choice,
    state: PatrolState,
    horizon: float,
    stop: float = math.inf,
    late: Callable[[], bool] = lambda: False,
) -> Outcome:
    """Simulate a patrol until the state comes back, the horizon, or a wait that is too long.

    Args:
        rules: The map.
        choose: Says where to go.
        state: Where to begin; it is not changed.
        horizon: Seconds at most.
        stop: A wait from visit to visit that is too long, seconds.
        late: Whether there is no time left; asked now and then.
    """
    at = state.fresh()
    due = at.due = at.due or rules.table.due_times(at.now, at.seen)
    due_after = rules.table.due_after
    seen, met, slack, places = at.seen, at.met, rules.slack, rules.places
    end = at.now + horizon
    settled = first = 0.0
    windows, waits = rules.windows, [0.0] * rules.count
    walk: list[int] = []
    gaps: list[float] = []
    # Comparing all ages at each step would be slow: only visits of one place are compared.
    anchor = min(rules.wanted, key=lambda place: len(rules.leg_seconds[place]), default=at.place)
    states: dict[tuple[float, ...], int] = {}
    back, cut, most = None, False, MOST_MOVES + MOVES_A_PLACE * rules.count
    while at.now < end and settled <= stop:
        if len(walk) >= most or (len(walk) % LOOK_EVERY == 0 and late()):
            cut = True
            break
        choice = rules.guarded(at, choose(rules, at))
        if choice == at.place:  # It stays there for good.
            at.now = end
            break
        arrived = rules.go(at, choice)
        walk.append(choice)
        place = places[choice]
        wait = rules.waited(place, seen[place], arrived) if windows else arrived - seen[place]
        seen[place] = at.now
        due[place] = at.now + due_after[place]
        waits[place] = max(waits[place], wait)
        gaps.append(wait - slack[place])
        if met[place]:
            settled = max(settled, wait - slack[place])
        else:
            met[place] = True
            first = max(first, wait - slack[place])
        if place == anchor and at.now > rules.last_change:
            key = (at.position, round(at.level, 2), *(round(at.now - last, 3) for last in seen))
            if key in states:
                back = states[key]
                break
            states[key] = len(walk)
    # What still waits: where the walk repeats itself only places that have closed may, for long.
    for place in range(rules.count) if back is None else windows:
        is_closed = place in windows and rules.opens_in(place, at.now) > 0.0
        wait = rules.waited(place, seen[place], max(at.now, end) if is_closed else at.now)
        waits[place] = max(waits[place], wait)
        settled = max(settled, wait - slack[place])
    lasting = settled if back is None else max(gaps[back:], default=0.0)
    return Outcome(settled, max(first, settled), lasting, waits, walk, back, cut)


def oldest(rules: RuleGraph, state: PatrolState) -> int:
    """Choose the allowed neighbour that went unvisited longest."""
    seen = state.seen
    return min(rules.allowed(state), key=lambda place: (seen[place], place), default=state.place)


def lookahead(rules: RuleGraph, state: PatrolState) -> int:
    """Choose the way towards wherever (time unvisited - time to get there) is highest."""
    allowed = rules.allowed(state)
    if len(allowed) < 2:
        return allowed[0] if allowed else state.place
    idle = state.now - np.array(state.seen)
    idle[state.place] = -np.inf
    legs, graph = rules.leg_seconds[state.place], rules.graph
    worth = {p: round(float((idle - graph.row(p)).max()) - legs[p], 6) for p in allowed}
    return max(allowed, key=lambda place: (worth[place], -state.seen[place], -place))
