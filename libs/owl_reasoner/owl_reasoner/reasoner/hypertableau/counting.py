"""Upper and lower bounds on who is related to an individual, in a model of cases.

Where there are too many, some of them are the same: which ones is a choice (the rule NI and the
"at most" rule of Motik, Shearer and Horrocks 2009, section 4.2).
"""

from __future__ import annotations

from itertools import combinations

from owl_reasoner.reasoner.hypertableau.dl_clauses import Count
from owl_reasoner.reasoner.hypertableau.model import (
    Alternative,
    CaseModel,
    Choices,
    Either,
    Root,
    Same,
)


class Counting:
    """Counts in a model.

    Args:
        model: Where.
        either: Takes what is open.

    Attributes:
        functional: The bounds that hold for everybody, by role.
    """

    def __init__(self, model: CaseModel, either: Either) -> None:
        self._model, self._either = model, either
        self.functional: dict[int, Count] = {limit.role: limit for limit in model.rules.functional}

    def _related(self, x: int, counted: Count) -> list[int]:
        """Return who counts for an individual."""
        labels = self._model.labels
        return [
            y
            for y, roles in self._model.out[x].items()
            if counted.role in roles and counted.concept in labels[y]
        ]

    def _reasons(self, x: int, counted: Count, y: int) -> Choices:
        """Return the choices by which somebody counts for an individual."""
        return self._model.out[x][y][counted.role] | self._model.labels[y][counted.concept]

    def count(self, x: int) -> None:
        """Apply all upper bounds to an individual."""
        model, rules = self._model, self._model.rules
        # Ontologies have thousands of functional properties, an individual a few of them.
        roles = dict.fromkeys(role for roles in model.out[x].values() for role in roles)
        limits = [(self.functional[role], 0) for role in roles if role in self.functional]
        for concept in rules.at_most.keys() & model.labels[x].keys():
            limits.append((rules.at_most[concept], model.labels[x][concept]))
        for limit, choices in limits:
            self._limit(x, limit, choices)
            if model.is_gone(x):
                return

    def _limit(self, x: int, limit: Count, choices: Choices) -> None:
        model = self._model
        related = self._related(x, limit)
        if model.parent[x] is None:
            unnamed = [y for y in related if model.parent[y] not in (None, x)]
            for y in unnamed:
                self._introduce(x, limit, y, choices, len(unnamed))
            if model.is_gone(x) or any(map(model.is_gone, related)):
                model.recount[x] = None
                return
        if len(related) <= limit.n:
            return
        related.sort(key=lambda y: (-model.count_of_differences(y), y))
        chosen = related[: limit.n + 1]
        for y in chosen:
            choices |= self._reasons(x, limit, y)
        pairs: list[Alternative] = []
        for one, other in combinations(chosen, 2):
            apart = model.different(one, other)
            if apart is None:
                pairs.append(Same(one, other))
            else:
                choices |= apart
        self._either(pairs, choices)

    def _introduce(self, x: int, limit: Count, y: int, choices: Choices, waiting: int) -> None:
        """Make an unnamed individual that a named one counts one of so many.

        ``waiting``: How many such there are. Each of them may take a number that none has yet, and
        it is open which.
        """
        options: list[Alternative] = []
        for number in range(limit.n):
            key = (x, limit, number)
            options.append(Root(y, key))
            waiting -= key not in self._model.roots
            if not waiting:
                break
        self._either(options, choices | self._reasons(x, limit, y))

    def is_met(self, x: int, needed: Count) -> bool:
        """Tell whether an individual has as many, known to differ, as it needs."""
        found, different = self._related(x, needed), self._model.different

        def extend(chosen: list[int], place: int) -> bool:
            self._model.budget.tick()
            if len(chosen) == needed.n:
                return True
            for next_place in range(place, len(found) - (needed.n - len(chosen)) + 1):
                y = found[next_place]
                fits = all(different(one, y) is not None for one in chosen)
                if fits and extend([*chosen, y], next_place + 1):
                    return True
            return False

        return extend([], 0)
