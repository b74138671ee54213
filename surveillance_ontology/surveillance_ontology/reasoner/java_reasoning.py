"""A Java reasoner beside the native one, for ontologies outside the native one's fragment.

owlready2 brings HermiT and Pellet as Java archives and runs them in a JVM for each reasoning, which
takes seconds. Both are sound, so what either reasoner derives is shown. HermiT refuses rules with
built-ins; the Pellet of owlready2 0.50 and later needs Java 25. Both need ``java`` on the path.
"""

from __future__ import annotations

import importlib.util
import io
import itertools
import shutil
import threading
from collections.abc import Callable, Iterable, Iterator
from dataclasses import replace
from typing import Any

from surveillance_ontology.knowledge_base import Changes, Fact, KnowledgeBase
from surveillance_ontology.owl.axioms import (
    Axiom,
    ClassAssertion,
    DataPropertyAssertion,
    ObjectPropertyAssertion,
    SubClassOf,
)
from surveillance_ontology.owl.expressions import Literal
from surveillance_ontology.owl.vocabulary import OWL, RDF, RDFS, THING
from surveillance_ontology.reasoner.datatypes import value_of
from surveillance_ontology.reasoner.explanation import Explanation

KINDS = ('hermit', 'pellet')
_ONE_AT_A_TIME = threading.Lock()
"""owlready2 keeps state of its own while it reasons."""


class JavaReasonerError(Exception):
    """The Java reasoner cannot be used: one line that says why."""


def absent() -> str:
    """Return why no Java reasoner can run here; empty when one can."""
    if importlib.util.find_spec('owlready2') is None:
        return 'owlready2 is not installed'
    if shutil.which('java') is None:
        return 'there is no java on the path'
    return ''


class JavaKnowledgeBase(KnowledgeBase):
    """A `KnowledgeBase` that shows what a Java reasoner derives as well.

    Args:
        iri: The ontology's IRI.
        axioms: The first assertions.
        kind: One of `KINDS`.
    """

    def __init__(self, iri: str, axioms: Iterable[Axiom] = (), kind: str = 'hermit') -> None:
        super().__init__(iri, axioms)
        self._kind = kind
        self._java: frozenset[Axiom] = frozenset()
        self._java_consistent = True
        self._reasoned = False
        self._java_told: list[Callable[[Changes], None]] = []

    def reason(self) -> bool:
        """Bring what is derived up to date; whether the ontology is consistent.

        Raises:
            JavaReasonerError: The Java reasoner failed; what the native one derives is up to date.
        """
        if self._reasoned and not self.stale:
            return self.consistent
        self._reasoned = False
        before, self._java = self._java, frozenset()
        if super().reason():
            found = self._further()
            self._java_consistent = found is not None
            self._java = found or frozenset()
        self._reasoned = True
        come = tuple((axiom, True) for axiom in self._java - before)
        gone = tuple((axiom, True) for axiom in before - self._java)
        if come or gone:
            for tell in tuple(self._java_told):
                tell(Changes(0, come, gone, self.consistent))
        return self.consistent

    def subscribe(self, callback: Callable[[Changes], None]) -> Callable[[], None]:
        """Call back once per batch of assertions and once per reasoner that changed derived facts.

        Returns:
            A function that ends the subscription.
        """
        numbers = itertools.count(1)

        def tell(changes: Changes) -> None:
            number = next(numbers)
            callback(replace(changes, sequence=number, consistent=self.consistent))

        unsubscribe = super().subscribe(tell)
        self._java_told.append(tell)

        def end() -> None:
            unsubscribe()
            if tell in self._java_told:
                self._java_told.remove(tell)

        return end

    def _further(self) -> frozenset[Axiom] | None:
        """Return what holds beyond the native derivations; None: there is a contradiction."""
        found = infer(self._kind, self.iri, self.axioms())
        if found is None:
            return None
        # What Java derives has consequences of its own, for example in superclasses.
        both = KnowledgeBase(self.iri, [*self.axioms(), *found])
        if not both.reason():
            return None
        native = set(super().facts())
        facts = (fact for fact in both.facts() if fact not in native)
        return frozenset([*facts, *(axiom for axiom in found if isinstance(axiom, SubClassOf))])

    @property
    def consistent(self) -> bool:
        """Whether neither reasoner found a contradiction."""
        return super().consistent and self._java_consistent

    @property
    def unsupported(self) -> tuple[str, ...]:
        """Nothing: what the native reasoner does not use, the Java one does."""
        return ()

    def instances(self, cls: str) -> frozenset[str]:
        """Return individuals of a class, direct and indirect."""
        more = (a.individual for a in self._of(ClassAssertion) if a.cls == cls)
        return super().instances(cls) | frozenset(more)

    def types(self, individual: str) -> set[str]:
        """Named classes of an individual, direct and indirect, without owl:Thing."""
        more = {a.cls for a in self._of(ClassAssertion) if a.individual == individual}
        return super().types(individual) | more

    def subclasses(self, cls: str) -> set[str]:
        """Named classes strictly below, direct and indirect."""
        return super().subclasses(cls) | self._linked(cls, 'sup', 'sub')

    def superclasses(self, cls: str) -> set[str]:
        """Named classes strictly above, direct and indirect."""
        return super().superclasses(cls) | self._linked(cls, 'sub', 'sup')

    def object_values(self, prop: str, individual: str) -> set[str]:
        """Return what an individual is related to by an object property."""
        return super().object_values(prop, individual) | {
            a.object
            for a in self._of(ObjectPropertyAssertion)
            if a.prop == prop and a.subject == individual
        }

    def data_values(self, prop: str, individual: str) -> set[Literal]:
        """Return values of a data property."""
        found = super().data_values(prop, individual)
        values = {value_of(literal) for literal in found}
        return found | {
            a.literal
            for a in self._of(DataPropertyAssertion)
            if a.prop == prop and a.subject == individual and value_of(a.literal) not in values
        }

    def object_properties_of(self, individual: str) -> set[str]:
        """Return object properties with at least one value for the individual."""
        more = {a.prop for a in self._of(ObjectPropertyAssertion) if a.subject == individual}
        return super().object_properties_of(individual) | more

    def data_properties_of(self, individual: str) -> set[str]:
        """Return data properties with at least one value for the individual."""
        more = {a.prop for a in self._of(DataPropertyAssertion) if a.subject == individual}
        return super().data_properties_of(individual) | more

    def derived_facts(self) -> Iterator[Fact]:
        """Yield the facts about individuals that follow and are not asserted."""
        yield from super().derived_facts()
        for kind in (ClassAssertion, ObjectPropertyAssertion, DataPropertyAssertion):
            yield from self._of(kind)

    def explain(self, fact: Axiom) -> Explanation | None:
        """Return why a fact holds; of what only the Java reasoner derives no more is known than
        that.
        """
        explanation = super().explain(fact)
        if explanation is None and fact in self._java:
            text = f'{self._kind} infers it'
            return Explanation(str(fact), 'axiom', text)
        return explanation

    def copy(self) -> JavaKnowledgeBase:
        """Another one with the same assertions, nothing derived yet and no subscribers."""
        return JavaKnowledgeBase(self.iri, self.axioms(), self._kind)

    def _of(self, kind: type) -> Iterator[Any]:
        return (axiom for axiom in self._java if type(axiom) is kind)

    def _linked(self, cls: str, known: str, wanted: str) -> set[str]:
        found: set[str] = set()
        queue = [cls]
        while queue:
            current = queue.pop()
            for axiom in self._of(SubClassOf):
                if getattr(axiom, known) == current and getattr(axiom, wanted) not in found:
                    found.add(getattr(axiom, wanted))
                    queue.append(getattr(axiom, wanted))
        return found - {cls, THING}


def infer(kind: str, iri: str, axioms: Iterable[Axiom]) -> frozenset[Axiom] | None:
    """Have a Java reasoner derive what follows from axioms and is not among them.

    Returns:
        Derived class memberships, property values and subclass relations; None when the axioms
        contradict each other.

    Raises:
        JavaReasonerError: It cannot run, or refuses the ontology.
    """
    if why := absent():
        raise JavaReasonerError(f'{kind}: {why}')
    import owlready2

    from surveillance_ontology.documents.writing import ontology_bytes

    document = ontology_bytes(axioms, iri, 'ntriples')
    world = owlready2.World()
    try:
        with _ONE_AT_A_TIME:
            world.get_ontology(iri).load(fileobj=io.BytesIO(document))
            inferred = world.get_ontology('urn:inferred')
            with inferred:
                if kind == 'hermit':
                    owlready2.sync_reasoner_hermit(world, infer_property_values=True, debug=0)
                else:
                    owlready2.sync_reasoner_pellet(
                        world,
                        infer_property_values=True,
                        infer_data_property_values=True,
                        debug=0,
                    )
            return frozenset(_axioms(world, inferred))
    except owlready2.OwlReadyInconsistentOntologyError:
        return None
    except Exception as error:
        lines = [line.strip() for line in str(error).splitlines() if line.strip()]
        reason = next((line for line in lines if 'xception' in line or 'rror:' in line), '')
        raise JavaReasonerError(f'{kind}: {reason or type(error).__name__}') from None
    finally:
        world.close()


def _axioms(world: Any, inferred: Any) -> Iterator[Axiom]:
    name = world._unabbreviate
    for subject, predicate, value in inferred._get_obj_triples_spo_spo(None, None, None):
        # Negative numbers stand for blank nodes.
        if min(subject, value) < 0:
            continue
        s, p, o = name(subject), name(predicate), name(value)
        if p == RDF + 'type':
            if not o.startswith(OWL):
                yield ClassAssertion(o, s)
        elif p == RDFS + 'subClassOf':
            yield SubClassOf(s, o)
        elif p == OWL + 'equivalentClass':
            yield from (SubClassOf(s, o), SubClassOf(o, s))
        elif not p.startswith((OWL, RDFS)):
            yield ObjectPropertyAssertion(p, s, o)
    for subject, predicate, value, datatype in inferred._get_data_triples_spod_spod(
        None, None, None, None
    ):
        if subject > 0 and isinstance(datatype, int) and datatype:
            literal = Literal(str(value), name(datatype))
            yield DataPropertyAssertion(name(predicate), name(subject), literal)
