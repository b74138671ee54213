"""Tells subscribers what changed: assertions, and what follows from them."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import dataclass

from owl_reasoner.owl.axioms import (
    Axiom,
)
from owl_reasoner.reasoner.assertion_reader import is_public
from owl_reasoner.reasoner.clauses import Fact as StoredFact
from owl_reasoner.reasoner.engine import Engine, FactView


@dataclass(frozen=True)
class Changes:
    """What one batch of assertions, or one `reason`, changed.

    Attributes:
        sequence: Number of this batch, counted from 1 without gaps.
        added: Pairs (axiom, derived).
        removed: Pairs (axiom, derived).
        consistent: Whether the ontology was consistent when last reasoned over.
    """

    sequence: int
    added: tuple[tuple[Axiom, bool], ...]
    removed: tuple[tuple[Axiom, bool], ...]
    consistent: bool


class Notifier:
    """The subscribers, and what they were told last."""

    def __init__(self) -> None:
        self._subscribers: list[Callable[[Changes], None]] = []
        self._sequence = 0
        self._consistent = True
        # What is shown, kept only where the engine's log of an update cannot tell what was shown
        # before it: after a contradiction, and while individuals are known to be the same.
        self._shown: set[Axiom] | None = None

    def __bool__(self) -> bool:
        return bool(self._subscribers)

    def subscribe(
        self, callback: Callable[[Changes], None], engine: Engine | None
    ) -> Callable[[], None]:
        """Add a subscriber; return a function that takes it off again."""
        if not self._subscribers:
            self._show(engine)
        self._subscribers.append(callback)

        def unsubscribe() -> None:
            if callback in self._subscribers:
                self._subscribers.remove(callback)

        return unsubscribe

    def asserted(self, added: Iterable[Axiom], removed: Iterable[Axiom]) -> None:
        """Tell of one batch of assertions."""
        self._tell([(axiom, False) for axiom in added], [(axiom, False) for axiom in removed])

    def shown_by(self, engine: Engine | None) -> set[Axiom]:
        """Return what subscribers know of derived facts, before `engine` is given up."""
        return visible(engine) if self._shown is None else self._shown

    def given_up(self, engine: Engine | None) -> None:
        """Remember what subscribers know, where `engine` and what it shows is given up."""
        self._shown = self.shown_by(engine)

    def replaced(self, before: set[Axiom], engine: Engine) -> None:
        """Tell what a new engine shows that the old one did not, and the reverse."""
        after = visible(engine)
        self._show(engine)
        self._derived(engine, after - before, before - after)

    def updating(self, engine: Engine, update: Callable[[], None]) -> None:
        """Run an engine's update and tell what it changed.

        Where the update ends with an error nobody is told anything: what was shown before it is
        remembered until another engine shows something.
        """
        before = self._shown
        log: dict[StoredFact, bool] = {}
        engine.changed, engine.renamed = log, False
        view = FactView(engine)
        try:
            update()
        except BaseException:
            self._shown = _before(engine, view, log) if before is None else before
            raise
        finally:
            engine.changed = None
        if before is not None or engine.renamed or not engine.consistent:
            if before is None:
                before = _before(engine, view, log)
            self.replaced(before, engine)
            return
        come: list[Axiom] = []
        gone: list[Axiom] = []
        for fact, was_derived in log.items():
            if is_public(fact[0]):
                is_derived = fact[0].holds(fact) and fact not in engine.asserted
                if is_derived and not was_derived:
                    come += view.public(fact, {})
                elif was_derived and not is_derived:
                    gone += view.public(fact, {})
        self._derived(engine, come, gone)

    def began(self, engine: Engine) -> None:
        """Take what a new engine shows for known, without telling it; a contradiction is told."""
        self._show(engine)
        self._derived(engine, (), ())

    def _show(self, engine: Engine | None) -> None:
        special = engine is not None and (not engine.consistent or bool(engine.equality.members))
        self._shown = visible(engine) if special else None

    def _derived(self, engine: Engine, come: Iterable[Axiom], gone: Iterable[Axiom]) -> None:
        come, gone = dict.fromkeys(come), dict.fromkeys(gone)
        # Where a predicate was made anew, its facts went and came.
        added = [(axiom, True) for axiom in come if axiom not in gone]
        removed = [(axiom, True) for axiom in gone if axiom not in come]
        if added or removed or self._consistent != engine.consistent:
            self._consistent = engine.consistent
            self._tell(added, removed)

    def _tell(self, added: list[tuple[Axiom, bool]], removed: list[tuple[Axiom, bool]]) -> None:
        self._sequence += 1
        changes = Changes(self._sequence, tuple(added), tuple(removed), self._consistent)
        for callback in tuple(self._subscribers):
            callback(changes)


def visible(engine: Engine | None) -> set[Axiom]:
    """Return the derived facts that queries show: none while there is a contradiction."""
    if engine is None or not engine.consistent:
        return set()
    return set(FactView(engine).derived())


def _before(engine: Engine, view: FactView, log: dict[StoredFact, bool]) -> set[Axiom]:
    """Return the derived facts before an update that began with every individual under its own
    name.
    """
    now = {fact for fact in view.stored() if fact not in engine.asserted and fact not in log}
    now.update(fact for fact, was_derived in log.items() if was_derived)
    return {axiom for fact in now if is_public(fact[0]) for axiom in view.public(fact, {})}
