"""Which class is below which, by models: the class hierarchy where it takes cases.

Somebody is put into each class, on top of one model of the individuals. What the model lacks is not
above the class; what it has without a choice is; the rest is asked for pair by pair. Every model
rules out further pairs (Glimm, Horrocks, Motik, Shearer and Stoilos, "A novel approach to ontology
classification", Journal of Web Semantics 14, 2012).
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from functools import partial

from owl_reasoner.owl import expressions as ex
from owl_reasoner.owl.vocabulary import NOTHING, THING, local_name
from owl_reasoner.reasoner.clauses import StoppedError
from owl_reasoner.reasoner.hypertableau.dl_clauses import DLClauses
from owl_reasoner.reasoner.hypertableau.search import CaseSearch

_MOST_KEPT = 200
"""Individuals in models of classes that stay while other classes are looked at."""


class ClassComparison:
    """Compares the named classes.

    Args:
        rules: What the axioms say.
        search: Where models are made. It may have a model of the individuals.
        restart: Brings the search to where everything is asserted and nothing was chosen.
        keeps: Whether models of classes stay, as there are no individuals: those that come may be
            like them.

    Attributes:
        stopped: Whether a search was given up.
    """

    def __init__(
        self, rules: DLClauses, search: CaseSearch, restart: Callable[[], object], keeps: bool
    ) -> None:
        self._search, self._restart, self._keeps = search, restart, keeps
        self._budget = rules.budget
        self._models = _ClassModels(rules, search)
        self.stopped = False
        # The state before the first choice for a class, and what its first model cost.
        self._settled = self._cost = 0

    def pairs(
        self, classes: Iterable[str], known: Callable[[str, str], bool]
    ) -> Iterator[tuple[str, str]]:
        """Yield the pairs of classes, one below the other, that follow and are not known.

        A class that can have no members is below owl:Nothing.
        """
        models = self._models
        # First a model of each class, then only the pairs that no model refutes: classification by
        # models, as in HermiT (Glimm, Horrocks, Motik and Stoilos, "Optimising ontology
        # classification", ISWC 2010). What the consequence-based hierarchy knows stands for told
        # subsumers and is not asked at all.
        wanted = [(cls,) for cls in classes if not known(cls, NOTHING)]
        for cls, *_ in self._impossible(wanted):
            yield cls, NOTHING
        for cls, sup in models.certain:
            if not known(cls, sup):
                yield cls, sup
        pairs = [pair for pair in models.possible() if not known(*pair)]
        for cls, *rest in self._impossible(pairs):
            yield cls, rest[0]

    def _impossible(self, questions: Iterable[tuple[str, ...]]) -> Iterator[tuple[str, ...]]:
        """Yield the classes, alone or without another, that can have no members.

        What contradicts the choices of one model of the individuals is asked for again without it.
        """
        again: list[tuple[str, ...]] = []
        if self._is_possible():
            self._search.hold()
        yield from self._ask(questions, again)
        if again:
            self._restart()
            yield from self._ask(again, again)

    def _ask(
        self, questions: Iterable[tuple[str, ...]], again: list[tuple[str, ...]]
    ) -> Iterator[tuple[str, ...]]:
        search, models = self._search, self._models
        start = search.mark()
        for question in tuple(questions):
            if self.stopped:
                return
            self._budget.at_work = partial(_question_text, question)
            if not models.may_be(*question):
                continue
            is_possible = self._is_possible(question)
            if self.stopped:
                return
            if is_possible:
                models.look(*question)
                is_complete = self._look_at_other(question)
                few = sum(1 for _ in search.model.alive()) < _MOST_KEPT
                # A class that comes later is often blocked by individuals of an earlier model: its
                # own is then small.
                if self._keeps and few and is_complete:
                    search.hold()
                    start = search.mark()
            # It contradicts what was chosen for the individuals, and perhaps nothing else.
            elif search.depends:
                again.append(question)
            else:
                yield question
            search.undo(start)

    def _is_possible(self, question: tuple[str, ...] = ()) -> bool:
        """Tell whether somebody can be in a class, and not in another one; the model is left."""
        search = self._search
        before = search.model.steps
        try:
            if question:
                if not search.attempt(partial(self._models.state, *question)):
                    return False
                if not search.settle():
                    return False
                self._settled = search.mark()
            found = search.solve()
        except StoppedError:
            self.stopped = True
            return True
        self._cost = search.model.steps - before
        return found

    def _look_at_other(self, question: tuple[str, ...]) -> bool:
        """Learn from a second model of a class, which chooses otherwise wherever it can.

        It rules out most of what the first one has by choice. Without it each of these classes
        takes a model of its own, which makes the comparison of n classes cost n * n models.

        Returns:
            Whether the search was left with a whole model.
        """
        search, models = self._search, self._models
        if len(question) > 1 or not models.is_open(*question):
            return True
        search.differ_from_model()
        search.undo(self._settled)
        try:
            with search.model.at_most(1000 + 3 * self._cost):
                if not search.solve():
                    return False
        except StoppedError:
            return False
        finally:
            search.forget_models()
        models.look_at_all()
        return True


class _ClassModels:
    """What models of classes, one after the other, say of which class may be below which."""

    def __init__(self, rules: DLClauses, search: CaseSearch) -> None:
        self._rules, self._search, self._somebody = rules, search, 0
        self.certain: list[tuple[str, str]] = []
        # Sets of named classes as bits: thousands of sets of hundreds of classes are intersected.
        self._bits: dict[str, int] = {}
        self._common: dict[str, int] = {}
        self._above: dict[str, set[str]] = {}
        self._looked_at_all = False

    def state(self, cls: str, without: str = '') -> None:
        """State that somebody is in a class and not in another one."""
        model = self._search.model
        self._somebody = model.somebody()
        model.concept(self._somebody, self._rules.positive(cls), 0)
        if without:
            outside = self._rules.positive(ex.ObjectComplementOf(without))
            model.concept(self._somebody, outside, 0)

    def look(self, cls: str, without: str = '') -> None:
        """Learn from the model that was found."""
        self.look_at_all()
        if without:
            return
        rules, model = self._rules, self._search.model
        found, merged = model.find(self._somebody)
        labels = {} if found is None else model.labels[found]
        above = {rules.names[one]: choices | merged for one, choices in labels.items()}
        self.certain += [
            (cls, sup) for sup, choices in above.items() if not choices and sup not in ('', cls)
        ]
        self._above[cls] = {sup for sup, choices in above.items() if choices} - {'', cls}

    def look_at_all(self) -> None:
        """Learn from everybody in the model: who is in a class is in all that is above it.

        Individuals that were there before the question are looked at once: later they are the
        same, or have more classes.
        """
        asked, _ = self._search.model.find(self._somebody)
        names, model, blocked = self._rules.names, self._search.model, self._search.blocked
        bits, common = self._bits, self._common
        for y in model.alive():
            is_old = y < self._somebody and y != asked
            if y in blocked or (is_old and self._looked_at_all):
                continue
            there = [name for concept in model.labels[y] if (name := names[concept])]
            mask = 0
            for name in there:
                bit = bits.get(name)
                if bit is None:
                    bit = bits[name] = 1 << len(bits)
                mask |= bit
            for name in (THING, *there):
                common[name] = common.get(name, mask) & mask
        self._looked_at_all = True

    def may_be(self, cls: str, sup: str = '') -> bool:
        """Tell whether every member of the class was a member of the other one so far."""
        return not sup or bool(self._common[cls] & self._bits[sup])

    def is_open(self, cls: str) -> bool:
        """Tell whether the class may be below another one that its model chose."""
        common, bits = self._common[cls], self._bits
        return any(common & bits[sup] for sup in self._above[cls])

    def possible(self) -> list[tuple[str, str]]:
        """Return the pairs of classes, one above the other in the class's model by choice."""
        return [
            (cls, sup)
            for cls, above in self._above.items()
            for sup in sorted(above)
            if self.may_be(cls, sup)
        ]


def _question_text(question: tuple[str, ...]) -> str:
    return 'the question ' + ' below '.join(map(local_name, question))
