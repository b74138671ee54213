"""A model that stays between changes, with the assertions that change on top of it.

The trail of the search has, from below: what the lasting assertions lead to, the choices of one
model of them, and then the changing assertions with what follows of them. A change takes back the
top part alone. Where it contradicts the choices below, these are given up and made anew above the
changing assertions (compare Halaschek-Wiener, Parsia and Sirin, "Description logic reasoning with
syntactic updates", ODBASE 2006, which keeps a completion graph and the axioms each part rests on).
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from functools import partial
from typing import Any

from owl_reasoner.owl import axioms as ax
from owl_reasoner.owl.axioms import Axiom
from owl_reasoner.reasoner.hypertableau.assertions import AssertionWriter, Prepared
from owl_reasoner.reasoner.hypertableau.dl_clauses import DLClauses
from owl_reasoner.reasoner.hypertableau.model import Choices
from owl_reasoner.reasoner.hypertableau.model_facts import (
    CLASSES,
    EVERY_KIND,
    RELATIONS,
    VALUES,
    ModelFacts,
    kind_of,
)
from owl_reasoner.reasoner.hypertableau.search import CaseSearch


class KeptModel:
    """One model of the lasting assertions.

    Args:
        rules: What the axioms say.
        writer: States assertions.
        most_steps: When a search is given up, for each change anew.
        valued: Individuals whose values change: below, they have none that only must exist, which
            would have to be made one with the known values above at each change.

    Attributes:
        search: Where the model is.
        reader: Reads its facts.
        lasting: Its facts, with the choices they depend on, by the name of their subject, before
            anything that changes is stated.
        choices: What it chose.
        is_flat: Whether no choices are kept below the changing assertions.
    """

    def __init__(
        self, rules: DLClauses, writer: AssertionWriter, most_steps: int, valued: Iterable[str]
    ) -> None:
        self._rules, self._writer, self._valued = rules, writer, tuple(valued)
        self.search = CaseSearch(rules, most_steps)
        self.reader = ModelFacts(rules, self.search)
        self.lasting: dict[str, dict[Axiom, Choices]] = {}
        self.choices: set[Any] = set()
        self.is_flat = True
        self._derived = self._chosen = 0
        # Whose each table of the model is, and of which kind of facts.
        self._owners: dict[int, tuple[int, int]] = {}
        self._touched: dict[str, int] | None = None
        self._present: dict[str, dict[Axiom, Choices]] = {}

    # --- the lasting assertions ---

    def build(self, lasting: list[Prepared]) -> bool:
        """State the lasting assertions and find a model of them; False: there is none."""
        search = self.search
        begin = partial(self._writer.begin, search.model, lasting)
        if not search.attempt(begin):
            return False
        search.await_values(self._valued)
        return search.settle() and self.choose()

    def choose(self) -> bool:
        """Find a model of what is stated, and keep to its choices."""
        search = self.search
        self._derived = search.mark()
        if not search.solve():
            return False
        self.choices = search.chosen()
        search.hold()
        self._chosen, self.is_flat = search.mark(), False
        self._touched, self._present = {}, {}
        self.lasting = {name: {} for names in search.model.names.values() for name in names}
        for fact, choices in self.reader.all():
            self.lasting[subject_of(fact)][fact] = choices
        self._note_owners()
        return True

    def _note_owners(self) -> None:
        model = self.search.model
        owners = self._owners = {}
        for x in model.labels:
            owners[id(model.labels[x])] = x, CLASSES
            owners[id(model.values[x])] = x, VALUES
            owners[id(model.groups_of(x))] = x, EVERY_KIND
            for table in (model.out[x], *model.out[x].values()):
                owners[id(table)] = x, RELATIONS
        for v, x in model.owner.items():
            owners[id(model.props[v])] = owners[id(model.groups_of(v))] = x, VALUES

    def take_back(self) -> None:
        """Go back to the lasting assertions and the choices of their model."""
        self.search.undo(self._derived if self.is_flat else self._chosen)
        self.search.model.steps = 0
        self._present = {}

    def give_up_choices(self) -> None:
        """Go back to what follows of the lasting assertions, and keep no choices from now on."""
        self.is_flat = True
        self.take_back()

    # --- the changing assertions ---

    def put(self, changing: Iterable[Prepared]) -> bool:
        """Find a model of all assertions; False: there is none."""
        search, changing = self.search, tuple(changing)
        self.take_back()
        if self._state(changing) and search.solve():
            self._touched = None if self.is_flat else self._names_touched()
            return True
        if self.is_flat or not search.depends:
            return False
        self.give_up_choices()
        self._touched = None
        return self._state(changing) and search.solve()

    def restart(self, changing: Iterable[Prepared]) -> bool:
        """Go to where everything is stated and nothing chosen."""
        self.give_up_choices()
        return self._state(tuple(changing)) and self.search.settle()

    def _state(self, changing: tuple[Prepared, ...]) -> bool:
        def state() -> None:
            self.search.make_values(self._valued)
            for assertion in changing:
                self._writer.state(self.search.model, *assertion)

        return self.search.attempt(state)

    def _names_touched(self) -> dict[str, int]:
        """Return the named individuals of which anything changed above the kept choices, each with
        the kinds of its facts.
        """
        model, owners = self.search.model, self._owners
        whole = {id(t) for t in (model.labels, model.out, model.values, model.names, model.gone)}
        by_value = {id(model.sets), id(model.props), id(model.owner)}
        touched: dict[int, int] = {}
        for table, key in model.changed_since(self._chosen):
            place = id(table)
            owner = owners.get(place)
            if owner is not None:
                x, kinds = owner
            elif place in whole:
                x, kinds = key, VALUES if key in model.owner else EVERY_KIND
            elif place in by_value and key in model.owner:
                x, kinds = model.owner[key], VALUES
            else:
                continue
            touched[x] = touched.get(x, 0) | kinds
        if touched and self._rules.roles.complex_props():
            # Chains reach further than what they lead along.
            return self._all_touched()
        found: dict[str, int] = {}
        for x, kinds in touched.items():
            # A value that is gone stands for one of the same individual.
            present = model.find(model.owner.get(x, x))[0]
            for name in () if present is None else model.names.get(present, ()):
                found[name] = found.get(name, 0) | kinds
        return found

    def _all_touched(self) -> dict[str, int]:
        names = self.search.model.names.values()
        return {name: EVERY_KIND for some in names for name in some}

    # --- facts ---

    def touched(self) -> Mapping[str, int]:
        """Return the named individuals that may have other facts than in `lasting`, with the kinds
        of these facts.
        """
        return self._all_touched() if self._touched is None else self._touched

    def present(self, name: str) -> dict[Axiom, Choices]:
        """Return the facts about a named individual that may be others than in `lasting`."""
        found = self._present.get(name)
        if found is None:
            kinds = EVERY_KIND if self._touched is None else self._touched.get(name, 0)
            x, _ = self.search.model.individual(name)
            facts = self.reader.about(x, kinds)
            found = {fact: choices for fact, choices in facts if subject_of(fact) == name}
            self._present[name] = found
        return found

    def has(self, fact: Axiom) -> bool:
        """Tell whether a fact holds in the present model."""
        name = subject_of(fact)
        if self._touched is None or self._touched.get(name, 0) & kind_of(fact):
            return fact in self.present(name)
        return fact in self.lasting.get(name, {})


def subject_of(fact: Axiom) -> str:
    """Return the individual that a fact is listed under."""
    if isinstance(fact, ax.ClassAssertion):
        return fact.individual
    if isinstance(fact, ax.SameIndividual):
        return min(fact.individuals)
    assert isinstance(fact, ax.ObjectPropertyAssertion | ax.DataPropertyAssertion)
    return fact.subject
