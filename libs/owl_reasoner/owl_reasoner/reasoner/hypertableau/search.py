"""Searches a model by cases: the hypertableau calculus.

A model (`model`) grows from named individuals: rules add concepts, related individuals and
values; where a rule has several heads, one is tried after the other, and a contradiction goes back
to the last choice that took part in it. Unnamed individuals that look like an earlier one need no
successors of their own (anywhere blocking), which ends the search. Where no role is used backwards,
one that is less than an earlier one needs no choices either: it can be what that one is, where the
rules about whom it was made for admit that (core blocking). Sources: Motik, Shearer and Horrocks,
"Hypertableau reasoning for description logics", Journal of Artificial Intelligence Research 36
(2009); Glimm, Horrocks and Motik, "Optimized description logic reasoning via core blocking",
IJCAR 2010.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable
from typing import NamedTuple

from owl_reasoner.reasoner.hypertableau.blocking import Blocking
from owl_reasoner.reasoner.hypertableau.counting import Counting
from owl_reasoner.reasoner.hypertableau.dl_clauses import (
    ANYBODY,
    Count,
    DLClauses,
    EdgeClause,
    Heads,
)
from owl_reasoner.reasoner.hypertableau.model import (
    Alternative,
    CaseModel,
    Choices,
    ClashError,
    Has,
    still_open,
    total,
)
from owl_reasoner.reasoner.hypertableau.rule_joins import CaseJoins
from owl_reasoner.reasoner.hypertableau.values import CaseValues


class _Choice:
    """A disjunction that is being tried."""

    __slots__ = ('alternatives', 'choices', 'mark', 'place', 'stated')

    def __init__(self, mark: int, alternatives: list[Alternative], choices: Choices) -> None:
        self.mark, self.alternatives, self.place = mark, alternatives, 0
        # What the disjunction itself rests on; and with it what its failed alternatives rested on,
        # which its last alternative inherits.
        self.stated = self.choices = choices


class _Either(NamedTuple):
    """A disjunction that was not tried yet."""

    alternatives: tuple[Alternative, ...]
    choices: Choices


class _Always(NamedTuple):
    """The disjunctions about everybody, for one individual, from a place on."""

    x: int
    place: int


class CaseSearch:
    """Completes a model.

    Large because the rules of the calculus share one agenda and one trail of choices.

    Args:
        rules: What must hold.
        most_steps: After so many added facts the search ends.

    Attributes:
        model: What was found.
        depends: Whether the last contradiction rests on choices that are held.
    """

    def __init__(self, rules: DLClauses, most_steps: int) -> None:
        self.rules = rules
        self.model = CaseModel(rules, most_steps)
        self._values = CaseValues(self.model, self._either)
        self._named = CaseJoins(self.model, self._either)
        self._blocking = Blocking(self.model)
        self._counting = Counting(self.model, self._either)
        self.gaps = self._values.gaps
        self._named.gaps = self.gaps
        self.depends = False
        self._stack: list[_Choice] = []
        self._held = 0
        # By concept, over all of the search: not undone with it, as what failed in one place often
        # fails in the next.
        self._failures: dict[int, int] = {}
        # Disjunctions by number; `_next` tells which was not looked at yet.
        self._open: dict[int, _Either | _Always] = {}
        self._next = {'first': 0, 'end': 0}
        # Individuals and the concepts for which they may need others.
        self._needs: dict[tuple[int, int], None] = {}
        self._stated: dict[tuple[tuple[type, Alternative], ...], bool] = {}
        # What earlier models chose, which `differ_from_models` has this one choose last.
        self._avoided: set[tuple[type, Alternative]] = set()

    @property
    def blocked(self) -> dict[int, int]:
        """Unnamed individuals in the model that are what an earlier one is."""
        return self._blocking.blocked

    # --- asking for a model ---

    def mark(self) -> int:
        """Return a state to come back to."""
        return self.model.mark()

    def undo(self, mark: int) -> None:
        """Go back to a state."""
        self._back_to(mark)
        while self._stack and self._stack[-1].mark >= mark:
            self._stack.pop()
        self._held = min(self._held, len(self._stack))

    def hold(self) -> None:
        """Keep to the choices of the model that was found, until `undo` takes them back."""
        self._held = len(self._stack)

    def _back_to(self, mark: int) -> None:
        self.model.undo(mark)
        self._blocking.forget()

    def differ_from_model(self) -> None:
        """Have later models choose what the present one does not, where they can."""
        self.avoid(self.chosen())

    def chosen(self) -> set[tuple[type, Alternative]]:
        """Return what the present model chose.

        What named individuals are in a model that chooses otherwise, too, does not depend on the
        choices that differ. Choices that are held stay as they are.
        """
        found: set[tuple[type, Alternative]] = set()
        for choice in self._stack[self._held :]:
            chosen = choice.alternatives[choice.place]
            found.add((type(chosen), chosen))
        if self._held:
            return found
        model = self.model
        for x in model.alive():
            if model.names[x]:
                for concept, choices in model.labels[x].items():
                    if choices:
                        found.add((Has, Has(x, concept)))
        return found

    def avoid(self, chosen: Iterable[tuple[type, Alternative]]) -> None:
        """Choose last what others chose, until `forget_models`."""
        self._avoided.update(chosen)

    def forget_models(self) -> None:
        """Choose in the order of what failed least again."""
        self._avoided.clear()

    def attempt(self, state: Callable[[], None]) -> bool:
        """State something; False where that is a contradiction at once."""
        try:
            state()
        except ClashError as clash:
            self.depends = bool(clash.choices)
            return False
        return True

    def await_values(self, names: Iterable[str]) -> None:
        """Make no values that must exist for certain individuals, until `make_values`."""
        self._values.waiting = {self.model.individual(name)[0] for name in names}

    def make_values(self, names: Iterable[str]) -> None:
        """Make the values that must exist and are not known, of these individuals as of others."""
        self._values.waiting.clear()
        found = (self.model.individual(name)[0] for name in names)
        self.model.revalue.update(dict.fromkeys(x for x in found if not self.model.is_gone(x)))

    def settle(self) -> bool:
        """Derive what needs no cases; False on a contradiction."""
        return self.attempt(self._saturate)

    def solve(self) -> bool:
        """Tell whether there is a model, which is then left in `model`."""
        while True:
            try:
                self._saturate()
                # A choice before a new individual: a successor that a later choice makes needless
                # is then never made, and blocking compares individuals of whom all is known. What
                # was put off comes last: mostly it is never needed.
                if not (self._branch() or self._expand() or self._resume()):
                    return True
            except ClashError as clash:
                if not self._go_back(clash.choices):
                    return False

    def _saturate(self) -> None:
        model = self.model
        queue, recount, is_gone = model.queue, model.recount, model.is_gone
        revalue, rejoin, budget = model.revalue, model.rejoin, model.budget
        while queue or recount or revalue or rejoin:
            while queue:
                # The newest first: a contradiction is met before all else that follows is.
                event = queue.pop()
                budget.tick()
                if is_gone(event[0]):
                    continue
                if len(event) == 2:
                    self._on_concept(*event)
                elif not is_gone(event[2]):
                    self._on_relation(*event)
            # Counting after concepts and relations: it may merge individuals, which walks over all
            # that is known of both.
            if recount:
                x, _ = recount.popitem()
                budget.tick()
                if not is_gone(x):
                    self._counting.count(x)
            elif revalue:
                x, _ = revalue.popitem()
                if not is_gone(x):
                    self._values.check(x)
                    rejoin[x] = None
            elif rejoin:
                # Rules after everybody's values: a value that must exist may be one that is known,
                # and then no rule has to ask which one it is.
                x, _ = rejoin.popitem()
                if not is_gone(x):
                    self._named.on_values(x)

    # --- choices ---

    def _either(self, alternatives: list[Alternative], choices: Choices) -> None:
        """State that one of the alternatives holds."""
        if not alternatives:
            raise ClashError(choices)
        if len(alternatives) == 1:
            alternatives[0].apply(self.model, choices)
            return
        # Alternatives of two kinds may be equal as tuples.
        key = tuple(dict.fromkeys((type(one), one) for one in alternatives))
        distinct = tuple(one for _, one in key)
        if key not in self._stated:
            self.model.put(self._stated, key, True)
            self._append(_Either(distinct, choices))

    def _branch(self) -> bool:
        """Try the first open disjunction; whether something was added."""
        put, following = self.model.put, self._next
        while following['first'] < following['end']:
            number = following['first']
            put(following, 'first', number + 1)
            x = self._subject(number)
            if x is not None and self._blocking.needs_no_choice(x):
                put(self._blocking.put_off, x, (*self._blocking.put_off.get(x, ()), number))
            elif self._decide(number):
                return True
        return False

    def _resume(self) -> bool:
        """Look again at the disjunctions about an individual that is not blocked after all."""
        for x, numbers in tuple(self._blocking.put_off.items()):
            if x not in self.blocked:
                self.model.drop(self._blocking.put_off, x)
                for number in numbers[1:]:
                    self._append(self._open[number])
                self._decide(numbers[0])
                return True
        return False

    def _append(self, disjunction: _Either | _Always) -> None:
        number = self._next['end']
        self.model.put(self._open, number, disjunction)
        self.model.put(self._next, 'end', number + 1)

    def _subject(self, number: int) -> int | None:
        """Return the unnamed individual that a disjunction is about, where it is about one."""
        disjunction = self._open[number]
        if isinstance(disjunction, _Always):
            subjects = {disjunction.x}
        else:
            alternatives = disjunction.alternatives
            subjects = {one.x if isinstance(one, Has) else 0 for one in alternatives}
        if len(subjects) > 1 or 0 in subjects:
            return None
        x, _ = self.model.find(subjects.pop())
        return None if x is None or self.model.parent[x] is None else x

    def _decide(self, number: int) -> bool:
        """Try a disjunction; False where it holds, or is about nobody that is there."""
        disjunction = self._open[number]
        if isinstance(disjunction, _Always):
            return self._decide_always(number, *disjunction)
        return self._try(*disjunction, self._subject(number))

    def _decide_always(self, number: int, x: int, place: int) -> bool:
        """Try the next disjunction of those that hold of everybody; the rest comes after it."""
        labels, always = self.model.labels[x], self.rules.always
        while not self.model.is_gone(x) and place < len(always):
            heads = always[place]
            place += 1
            if not any(concept in labels for _, concept in heads):
                self.model.put(self._open, number, _Always(x, place))
                self.model.put(self._next, 'first', number)
                return self._try(tuple(Has(x, concept) for _, concept in heads), 0, x)
        return False

    def _try(self, alternatives: tuple[Alternative, ...], choices: Choices, x: int | None) -> bool:
        """Try alternatives, about one unnamed individual `x` where it is given."""
        found = still_open(self.model, alternatives, choices)
        if found is None:
            return False
        left, choices = found
        if not left:
            raise ClashError(choices)
        self.model.step()
        if len(left) > 1:
            # What failed often is tried late, as HermiT does.
            left.sort(key=self._order)
            if x is not None:
                self.model.put(self._blocking.chosen, x, None)
            self._stack.append(_Choice(self.mark(), left, choices))
            choices |= 1 << len(self._stack) - 1
        left[0].apply(self.model, choices)
        return True

    def _order(self, alternative: Alternative) -> tuple[bool, int]:
        is_avoided = (type(alternative), alternative) in self._avoided
        return is_avoided, self._failures_of(alternative)

    def _failures_of(self, alternative: Alternative) -> int:
        return self._failures.get(alternative.concept, 0) if isinstance(alternative, Has) else 0

    def _go_back(self, choices: Choices) -> bool:
        """Take the next alternative of the last choice that took part; False: there is none."""
        while len(self._stack) > self._held:
            choice = self._stack[-1]
            bit = 1 << len(self._stack) - 1
            self._back_to(choice.mark)
            # Backjumping (dependency-directed backtracking; Horrocks, "Optimising tableaux decision
            # procedures for description logics", 1997, section 6.2): this choice took no part in
            # the contradiction, its other alternatives would meet it again.
            if not choices & bit:
                self._stack.pop()
                continue
            choice.choices |= choices & ~bit
            failed = choice.alternatives[choice.place]
            if isinstance(failed, Has):
                self._failures[failed.concept] = self._failures.get(failed.concept, 0) + 1
            choice.place += 1
            stated = choice.stated | bit
            # The last alternative is no choice any more: it follows from the failures of the
            # others, and a contradiction with it goes back past this point at once.
            if choice.place == len(choice.alternatives) - 1:
                self._stack.pop()
                stated = choice.choices
            try:
                choice.alternatives[choice.place].apply(self.model, stated)
            except ClashError as clash:
                choices = clash.choices
                continue
            return True
        self.depends = bool(choices)
        return False

    # --- rules ---

    def _one_of(self, heads: Heads, x: int, y: int, choices: Choices) -> None:
        """State that one of the heads holds of x (place 0) or y."""
        alternatives: list[Alternative] = []
        for place, concept in heads:
            one = y if place else x
            if concept in self.model.labels[one]:
                return
            alternatives.append(Has(one, concept))
        self._either(alternatives, choices)

    def _on_concept(self, x: int, concept: int) -> None:
        model, rules = self.model, self.rules
        labels, is_gone = model.labels[x], model.is_gone
        if concept in rules.nominals:
            named, more = model.individual(rules.nominals[concept])
            model.same(named, x, labels[concept] | more)
            if is_gone(x):
                return
        # Hyperresolution: a rule is looked at whenever one of its concepts comes, and fires with
        # the last of them. It needs no order of its body, and each instance is found once.
        for rule in rules.of_node.get(concept, ()):
            choices = total(rule.body, labels)
            if choices is not None:
                self._one_of(rule.heads, x, x, choices)
                if is_gone(x):
                    return
        for edge_rule in rules.by_source.get(concept, ()):
            for y, roles in tuple(model.out[x].items()):
                if edge_rule.role in roles:
                    self._fire(edge_rule, x, y)
        for edge_rule in rules.by_target.get(concept, ()):
            for y, roles in tuple(model.out[x].items()):
                if -edge_rule.role in roles:
                    self._fire(edge_rule, y, x)
        # One entry for all disjunctions about everybody: one for each of them would be individuals
        # times axioms.
        if concept == ANYBODY and rules.always:
            self._append(_Always(x, 0))
        if concept in rules.loops:
            model.relate(x, rules.loops[concept], x, labels[concept])
        if concept in rules.at_least:
            model.put(self._needs, (x, concept), None)
        if concept in rules.at_most:
            model.recount[x] = None
        limits = rules.counted_by.get(concept)
        if limits is not None:
            for y in model.out[x]:
                if not limits.isdisjoint(model.labels[y]):
                    model.recount[y] = None
        if (
            concept in rules.values_at_least
            or concept in rules.values_at_most
            or concept in rules.of_values
        ):
            model.revalue[x] = None
        self._named.on_concept(x, concept)

    def _on_relation(self, x: int, role: int, y: int) -> None:
        model, rules = self.model, self.rules
        roles = model.out[x].get(y)
        if roles is None or role not in roles:
            return
        for other in rules.disjoint.get(role, ()):
            if other in roles:
                raise ClashError(roles[role] | roles[other])
        if x == y:
            for concept in rules.marks.get(abs(role), ()):
                model.concept(x, concept, roles[role])
        for rule in rules.by_role.get(role, ()):
            self._fire(rule, x, y)
        for rule in rules.by_role.get(-role, ()):
            self._fire(rule, y, x)
        for one, way in ((x, role), (y, -role)):
            limited = not rules.at_most.keys().isdisjoint(model.labels[one])
            if limited or way in self._counting.functional:
                model.recount[one] = None
        self._named.on_relation(x, role, y)

    def _fire(self, rule: EdgeClause, x: int, y: int) -> None:
        model = self.model
        if model.is_gone(x) or model.is_gone(y):
            return
        roles = model.out[x].get(y)
        if roles is None or rule.role not in roles:
            return
        mine = total(rule.xs, model.labels[x])
        if mine is None:
            return
        theirs = total(rule.ys, model.labels[y])
        if theirs is not None:
            self._one_of(rule.heads, x, y, mine | theirs | roles[rule.role])

    # --- individuals that must exist ---

    def _expand(self) -> bool:
        """Add the individuals that are still needed; whether there were any."""
        model = self.model
        if not self._needs and not self._blocking.put_off:
            # Whoever is blocked has needs that wait: nobody is.
            self._blocking.blocked = {}
            return False
        # Once for all needs: comparing individuals costs more than making one.
        self._blocking.look()
        progress = False
        for x, concept in tuple(self._needs):
            if x in self.blocked:
                continue
            model.drop(self._needs, (x, concept))
            needed = self.rules.at_least[concept]
            if not model.is_gone(x) and not self._counting.is_met(x, needed):
                self._create(x, needed, model.labels[x][concept])
                progress = True
        return progress

    def _create(self, x: int, needed: Count, choices: Choices) -> None:
        model = self.model
        iri = self.rules.nominals.get(needed.concept)
        if iri is not None and needed.n == 1:
            y, more = model.individual(iri)
            model.relate(x, needed.role, y, choices | more)
            return
        made = [model.somebody(x) for _ in range(needed.n)]
        if len(made) > 1:
            # Else a bound above would make them the same, and `n` would be met by one.
            model.differ(made, choices)
        for y in made:
            model.relate(x, needed.role, y, choices)
            model.concept(y, needed.concept, choices)
