"""Reasoning by cases that goes on from change to change.

Which assertions change is learned from those that were retracted. The others are stated once, in a
few models that stay (`kept_model`): one that is read, and some that choose otherwise. What the
first has by choice and another one lacks does not follow. After a change only individuals that it
touched in one of these models are looked at again.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator

from owl_reasoner.owl import axioms as ax
from owl_reasoner.owl.axioms import Axiom
from owl_reasoner.owl.vocabulary import (
    BOTTOM,
    BOTTOM_DATA,
    NOTHING,
    THING,
    TOP,
    TOP_DATA,
)
from owl_reasoner.reasoner.budget import Budget
from owl_reasoner.reasoner.clauses import StoppedError
from owl_reasoner.reasoner.hypertableau.assertions import AssertionWriter
from owl_reasoner.reasoner.hypertableau.class_comparison import ClassComparison
from owl_reasoner.reasoner.hypertableau.dl_clauses import DLClauses, OfChain
from owl_reasoner.reasoner.hypertableau.fact_questions import FactQuestions
from owl_reasoner.reasoner.hypertableau.kept_model import KeptModel
from owl_reasoner.reasoner.hypertableau.model_facts import kind_of

_OTHER_MODELS = 3
"""Models beside the first one; most often one rules out what the first has by choice."""
_MOST_ASKED = 20
"""Facts asked for one by one with each change; where there are more, nothing is kept."""
_MOST_ADDED = 100
"""Assertions that came, and stay, before the models are made anew with them below."""
_FORGOTTEN = 200
"""Changes after which an assertion that changed once counts as lasting again."""
_SPECIAL = frozenset((TOP, BOTTOM, TOP_DATA, BOTTOM_DATA, THING, NOTHING))

_About = tuple[str, str]
"""What an assertion is about: a class or property, and the subject."""


_ANYBODY = ''
"""In place of the subject: whoever it is."""


def _about(axiom: Axiom) -> _About | None:
    """Return what a plain assertion is about; None for any other axiom."""
    if isinstance(axiom, ax.ClassAssertion):
        known = isinstance(axiom.cls, str) and axiom.cls not in _SPECIAL
        return (axiom.cls, axiom.individual) if known else None  # type: ignore[return-value]
    if isinstance(axiom, ax.ObjectPropertyAssertion | ax.DataPropertyAssertion):
        return None if axiom.prop in _SPECIAL else (axiom.prop, axiom.subject)
    return None


class ChangeHistory:
    """Learns which assertions change: those about something that was retracted before.

    Where values of one property were retracted of two individuals, all of its values count: a
    patrol visits one place after the other. Relations do not, for what follows from them reaches
    further, and has to be stated again with each change.
    """

    def __init__(self) -> None:
        self._turn = 0
        self._last: dict[_About, int] = {}
        self._subject: dict[str, str] = {}

    def note(self, removed: Iterable[Axiom]) -> None:
        """Take in what one change retracts."""
        self._turn += 1
        for axiom in removed:
            about = _about(axiom)
            if about is not None:
                self._last[about] = self._turn
            if about is not None and isinstance(axiom, ax.DataPropertyAssertion):
                prop, subject = about
                if self._subject.setdefault(prop, subject) != subject:
                    self._last[prop, _ANYBODY] = self._turn
                    self._subject[prop] = subject

    def forget(self) -> None:
        """Forget what changed long ago."""
        oldest = self._turn - _FORGOTTEN
        self._last = {about: turn for about, turn in self._last.items() if turn > oldest}

    def __contains__(self, axiom: Axiom) -> bool:
        about = _about(axiom)
        return about is not None and (about in self._last or (about[0], _ANYBODY) in self._last)


def is_plain(axioms: Iterable[Axiom]) -> bool:
    """Tell whether all are assertions of named classes and properties."""
    return all(_about(axiom) is not None for axiom in axioms)


class IncrementalCases:
    """Reasons by cases over a schema that stays and assertions some of which change.

    Args:
        schema: The axioms that are not about individuals.
        assertions: Those that are.
        history: Tells which of them change.
        most_steps: When a search is given up, in facts added.
        budget: What the whole reasoning may use.

    Attributes:
        gaps: One sentence for each axiom that is not fully used, or for what was not decided.
        class_gaps: What `hierarchy` did not decide; nothing beyond `gaps`.
        stopped: Whether a search was given up.
        names_individuals: Whether the axioms about classes name individuals.
        lasting: Facts that follow while no lasting assertion goes.
    """

    def __init__(
        self,
        schema: Iterable[Axiom],
        assertions: Iterable[Axiom],
        history: ChangeHistory,
        most_steps: int,
        budget: Budget,
    ) -> None:
        assertions = list(assertions)
        budget.stage = 'reasoning by cases'
        self._budget, self._history, self._most_steps = budget, history, most_steps
        self._rules = DLClauses([*schema, *assertions], budget)
        self.gaps = dict(self._rules.gaps)
        self.class_gaps: dict[str, None] = {}
        self.stopped = False
        self.names_individuals = bool(self._rules.nominals)
        self._writer = AssertionWriter(self._rules, self.gaps)
        self._stated = {axiom for axiom in assertions if axiom not in history}
        self._below = self._writer.prepare(a for a in assertions if a in self._stated)
        self._changing = {
            axiom: self._writer.prepared(axiom) for axiom in assertions if axiom in history
        }
        # Rules that ask for chains know the individuals that there are.
        self._is_closed = any(
            isinstance(atom, OfChain) for rule in self._rules.named for atom in rule.body
        )
        self._models: list[KeptModel] = []
        # What the first model has by choice and no other one lacks: looked at with each change.
        self._unrefuted: list[Axiom] = []
        self.lasting: list[Axiom] = []
        # Whether a change left more facts open than are asked for one by one.
        self._is_spent = False

    # --- the lasting assertions ---

    def build(self, known: Callable[[Axiom], bool]) -> bool:
        """Make the models; False where none are kept, for whatever reason.

        Args:
            known: Tells what follows from all assertions without cases.
        """
        try:
            return self._build(known)
        except StoppedError:
            return False

    def _build(self, known: Callable[[Axiom], bool]) -> bool:
        first = self._model()
        if not first.build(self._below):
            return False
        by_choice = _by_choice(first)
        for _ in range(_OTHER_MODELS):
            if all(map(known, by_choice)):
                break
            other = self._model()
            for model in self._models[:-1]:
                # Models that differ where they can: a fact that follows is in all of them, so what
                # one lacks is refuted without a search.
                other.search.avoid(model.choices)
            if not other.build(self._below):
                return False
            other.search.forget_models()
            before = len(by_choice)
            by_choice = [fact for fact in by_choice if other.has(fact)]
            # It refuted nothing that the others had not: a further one would cost as much with each
            # change.
            if len(by_choice) == before:
                self._models.pop()
                break
        unknown = {fact: None for fact in by_choice if not known(fact)}
        # Each open fact costs a search: beyond so many, reasoning from nothing is cheaper.
        if len(unknown) > _MOST_ASKED:
            return False
        if unknown:
            first.restart(())
            questions = self._questions(first)
            for fact in questions.following(dict(unknown)):
                del unknown[fact]
            if questions.stopped or not first.choose():
                return False
            others = self._models[1:]
            by_choice = [
                fact for fact in _by_choice(first) if all(other.has(fact) for other in others)
            ]
            if not all(known(fact) or fact in unknown for fact in by_choice):
                return False
        self._unrefuted = by_choice
        self.lasting = [
            fact
            for facts in first.lasting.values()
            for fact, choices in facts.items()
            if not choices and fact not in self._stated
        ]
        named = any(isinstance(fact, ax.SameIndividual) for fact in self.lasting)
        return not named and not self._undecided()

    def _model(self) -> KeptModel:
        valued = (a.subject for a in self._changing if isinstance(a, ax.DataPropertyAssertion))
        model = KeptModel(self._rules, self._writer, self._most_steps, valued)
        self._models.append(model)
        return model

    def _questions(self, model: KeptModel) -> FactQuestions:
        return FactQuestions(model.search, model.reader, self._writer, self.gaps, self._budget)

    def _undecided(self) -> bool:
        """Tell whether the models left something open; what they say of it would never go."""
        return any(model.search.gaps for model in self._models)

    # --- changes ---

    def take(self, added: Iterable[Axiom], removed: Iterable[Axiom]) -> bool:
        """Take in a change; False where the models are no use after it."""
        added = tuple(added)
        for axiom in removed:
            if axiom not in self._changing:
                return False
            del self._changing[axiom]
        if not is_plain(added):
            return False
        for axiom in added:
            if self._is_closed and not self._knows_individuals(axiom):
                return False
            self._changing[axiom] = self._writer.prepared(axiom)
        # Assertions that were never retracted before may stay for good: with many of them the
        # models rest on too little.
        come = len(self._changing) - _MOST_ADDED
        return come <= 0 or sum(axiom not in self._history for axiom in self._changing) <= come

    def _knows_individuals(self, axiom: Axiom) -> bool:
        known = self._models[0].lasting
        if isinstance(axiom, ax.ClassAssertion):
            return axiom.individual in known
        if isinstance(axiom, ax.ObjectPropertyAssertion):
            return axiom.subject in known and axiom.object in known
        assert isinstance(axiom, ax.DataPropertyAssertion)
        return axiom.subject in known

    # --- answers ---

    def consistent(self) -> bool:
        """Tell whether all assertions have a model; True where that was not found out."""
        try:
            return all(model.put(self._changing.values()) for model in self._models)
        except StoppedError:
            self.stopped = True
            return True

    @property
    def is_usable(self) -> bool:
        """Whether the models are of use for the next change."""
        return not self.stopped and not self._is_spent and not self._undecided()

    def facts(self, known: Callable[[Axiom], bool]) -> Iterator[Axiom]:
        """Yield every fact about named individuals that follows and is not known.

        `consistent` was asked for before.
        """
        if self.stopped:
            return
        first, *others = self._models
        yield from (fact for fact in self.lasting if not known(fact))
        opened = dict.fromkeys(fact for fact in self._unrefuted if first.has(fact))
        touched = first.touched()
        for name in touched:
            before = first.lasting.get(name, {})
            for fact, choices in first.present(name).items():
                if known(fact):
                    continue
                if choices:
                    opened[fact] = None
                # It follows now, by no choice; with 0 before it followed without the change and is
                # yielded above.
                elif before.get(fact, 1):
                    yield fact
        # What others lacked and may have now.
        for other in others:
            for name, kinds in other.touched().items():
                kinds &= ~touched.get(name, 0)
                facts = first.lasting.get(name, {}).items() if kinds else ()
                opened.update((f, None) for f, choices in facts if choices and kind_of(f) & kinds)
        opened = dict.fromkeys(
            fact for fact in opened if all(other.has(fact) for other in others) and not known(fact)
        )
        if len(opened) > _MOST_ASKED:
            self._is_spent = True
        elif opened:
            first.restart(self._changing.values())
            questions = self._questions(first)
            yield from questions.following(opened)
            self.stopped |= questions.stopped

    def hierarchy(
        self, classes: Iterable[str], known: Callable[[str, str], bool]
    ) -> Iterator[tuple[str, str]]:
        """Yield the pairs of named classes, one below the other, that follow and are not known.

        Only where the axioms name individuals; otherwise none of this depends on a change.
        """
        first = self._models[0]

        def restart() -> None:
            first.restart(self._changing.values())

        comparison = ClassComparison(self._rules, first.search, restart, keeps=False)
        yield from comparison.pairs(classes, known)
        self.stopped |= comparison.stopped


def _by_choice(model: KeptModel) -> list[Axiom]:
    """Return what the model of the lasting assertions has by choice."""
    return [fact for facts in model.lasting.values() for fact, choices in facts.items() if choices]
