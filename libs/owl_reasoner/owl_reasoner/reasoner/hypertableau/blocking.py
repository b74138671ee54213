"""Who needs no successors, or no choices, as an earlier individual is like it.

Anywhere blocking, pairwise where roles are used backwards and counted; core blocking where no role
is used backwards (Motik, Shearer and Horrocks 2009, section 4.3; Glimm, Horrocks and Motik,
IJCAR 2010).
"""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any, TypeAlias

from owl_reasoner.reasoner.hypertableau.model import CaseModel

_Conditions: TypeAlias = 'tuple[frozenset[int], list[tuple[frozenset[int], frozenset[int]]]]'


class Blocking:
    """Compares the unnamed individuals of a model.

    Args:
        model: Where they are.

    Attributes:
        blocked: Who is what an earlier one is.
        put_off: Individuals that needed no choice, with their disjunctions by number.
        chosen: Individuals for which a choice was made.
    """

    def __init__(self, model: CaseModel) -> None:
        self._model, self._rules = model, model.rules
        self.blocked: dict[int, int] = {}
        self.put_off: dict[int, tuple[int, ...]] = {}
        self.chosen: dict[int, None] = {}
        self._signs: dict[int, frozenset[int]] = {}
        self._known_conditions: dict[tuple[frozenset[int], tuple[int, ...]], _Conditions] = {}

    def forget(self) -> None:
        """Take in that something was taken back."""
        # Concepts went, so equal sizes are no sign of equal sets any more.
        self._signs.clear()

    def look(self) -> None:
        """Find the unnamed individuals that need no successors, and in whose place they are."""
        model = self._model
        found: dict[int, int] = {}
        seen: dict[Any, int] = {}
        cores = {y: None for y in self.chosen if y not in self.put_off}
        for x in model.alive():
            model.budget.tick()
            parent = model.parent[x]
            if parent is None:
                continue
            # Blocked indirectly: below a blocked individual the model is that below its blocker.
            if parent in found:
                found[x] = found[parent]
                cores.pop(x, None)
                continue
            if x in self.put_off:
                core = self._core_blocker(x, found, cores)
                if core is not None:
                    found[x] = core
                continue
            if self._is_its_own(x):
                continue
            sign: Any = self._sign(x)
            # With inverses and counting, what is required of an individual comes from above as
            # well: two are alike only if they, their parents and the roles between are (pairwise
            # blocking; Horrocks and Sattler, "A description logic with transitive and inverse roles
            # and role hierarchies", 1999).
            if self._rules.is_pairwise:
                roles = model.out[parent].get(x, {})
                sign = sign, self._sign(parent), frozenset(roles)
            # Anywhere blocking: any earlier individual, not an ancestor alone. A tree with many
            # equal branches needs one of them only.
            first = seen.setdefault(sign, x)
            if first != x:
                found[x] = first
                cores.pop(x, None)
        self.blocked = found

    def _is_its_own(self, x: int) -> bool:
        """Tell whether an individual was made for a named one, and so is nobody else.

        The other may be related to that named individual as well, which numbers, and roles that
        exclude each other, may not allow of one.
        """
        parent, rules = self._model.parent[x], self._rules
        assert parent is not None
        return self._model.parent[parent] is None and (rules.is_pairwise or bool(rules.disjoint))

    def needs_no_choice(self, x: int) -> bool:
        """Tell whether an individual seems to be blocked, or its parent is."""
        if self._rules.roles.has_inverse:
            return False
        is_known = x in self.put_off or self._model.parent[x] in self.blocked
        return is_known or self._core_blocker(x, self.blocked, self.chosen) is not None

    def _core_blocker(self, x: int, blocked: dict[int, int], cores: Iterable[int]) -> int | None:
        """Return an earlier individual with all concepts of x, in whose place x may stand.

        Args:
            x: An unnamed individual.
            blocked: Who is blocked already, and so blocks nobody.
            cores: Who may block.
        """
        model, put_off, nominals = self._model, self.put_off, self._rules.nominals.keys()
        own, known = model.labels[x].keys(), self.blocked.get(x)
        parent = model.parent[x]
        assert parent is not None
        if self._is_its_own(x):
            return None
        unwanted, conditions = self._conditions(self._sign(parent), tuple(model.out[parent][x]))
        # Many are alike: what is not found in one of them is not looked for in the others.
        unlike: set[frozenset[int]] = set()
        for y in cores if known is None else (known, *cores):
            # Earlier ones alone: two that blocked each other would both be without successors.
            if y in blocked or y in put_off or y >= x or model.is_gone(y):
                continue
            sign = self._sign(y)
            if sign in unlike:
                continue
            unlike.add(sign)
            other = model.labels[y].keys()
            # Nobody is like a named individual: it would be that individual.
            if not own <= other or not nominals.isdisjoint(other):
                continue
            model.step()
            if not unwanted & other <= own:
                continue
            # What its parent asks of x must be met by y in the place of x (Glimm, Horrocks and
            # Motik 2010, core blocking with a check of validity).
            for body, heads in conditions:
                if body <= other and heads.isdisjoint(other):
                    break
            else:
                return y
        return None

    def _conditions(self, above: frozenset[int], roles: tuple[int, ...]) -> _Conditions:
        """Return what is asked of whoever is related, by these roles, to one with these concepts.

        Returns:
            Concepts that are counted, of which there may be no more; and pairs: who has all these
            concepts must have one of those.
        """
        found = self._known_conditions.get((above, roles))
        if found is None:
            limits = [limit for one, limit in self._rules.at_most.items() if one in above]
            pairs = [
                (rule.ys, frozenset(head for place, head in rule.heads if place))
                for role in roles
                for rule in self._rules.by_role.get(role, ())
                if rule.xs <= above
                and not any(head in above for place, head in rule.heads if not place)
            ]
            unwanted = frozenset(limit.concept for limit in limits if limit.role in roles)
            found = self._known_conditions[above, roles] = unwanted, pairs
        return found

    def _sign(self, x: int) -> frozenset[int]:
        """Return the concepts of an individual, which only grow until something is taken back."""
        known, labels = self._signs.get(x), self._model.labels[x]
        if known is None or len(known) < len(labels):
            known = self._signs[x] = frozenset(labels)
        return known
