"""A Java reasoner beside the native one, for ontologies outside the native one's fragment.

owlready2 brings HermiT and Pellet as Java archives and runs them in a JVM for each reasoning, which
takes seconds. Both are sound: the engine takes what they derive as it takes what reasoning by cases
finds. HermiT refuses rules with built-ins; the Pellet of owlready2 0.50 and later needs Java 25.
Both need ``java`` on the path.
"""

from __future__ import annotations

import importlib.util
import io
import shutil
import threading
from collections.abc import Callable, Iterable, Iterator
from dataclasses import replace
from functools import partial
from typing import Any

from owl_reasoner.knowledge_base import KnowledgeBase
from owl_reasoner.owl.axioms import (
    Axiom,
    ClassAssertion,
    DataPropertyAssertion,
    ObjectPropertyAssertion,
    SubClassOf,
)
from owl_reasoner.owl.expressions import Literal
from owl_reasoner.owl.vocabulary import OWL, RDF, RDFS, THING
from owl_reasoner.reasoner.classification import Classification
from owl_reasoner.reasoner.clauses import closure
from owl_reasoner.reasoner.completion import Completion
from owl_reasoner.reasoner.engine import Engine
from owl_reasoner.reasoner.explanation import Explanation

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
    """A `KnowledgeBase` in which what a Java reasoner derives holds as well.

    Args:
        iri: The ontology's IRI.
        axioms: The first assertions.
        kind: 'hermit' or 'pellet'.
    """

    def __init__(self, iri: str, axioms: Iterable[Axiom] = (), kind: str = 'hermit') -> None:
        super().__init__(iri, axioms)
        self._kind = kind

    def reason(self, *args: Any, **limits: Any) -> bool:
        """Bring what is derived up to date; whether the ontology is consistent.

        The limits are those of the native reasoner; the Java reasoner has a timeout of its own.

        Raises:
            JavaReasonerError: The Java reasoner failed; what the native one derives is up to date.
        """
        consistent = super().reason(*args, **limits)
        assert isinstance(self._completion, _JavaCompletion)
        if self._completion.failure:
            raise JavaReasonerError(self._completion.failure)
        return consistent

    def _completion_of(self, engine: Engine) -> Completion:
        assert self._classification is not None
        infer_from = partial(infer, self._kind, self.iri)
        return _JavaCompletion(self._classification, engine, tuple(self._told.schema), infer_from)

    def _explained(self, goal: Axiom | None) -> Explanation:
        """Return an explanation; of what only the Java reasoner derives no more is known than
        that.
        """
        explanation = super()._explained(goal)
        if not explanation.sources():
            return replace(explanation, because=f'{self._kind} infers it')
        return explanation

    def copy(self) -> JavaKnowledgeBase:
        """Another one with the same assertions, nothing derived yet and no subscribers."""
        return JavaKnowledgeBase(self.iri, self.axioms(), self._kind)


class _JavaCompletion(Completion):
    """Adds to an engine what a Java reasoner derives, too.

    Attributes:
        failure: Why the Java reasoner did not answer the last time; '' where it did.
    """

    def __init__(
        self,
        classification: Classification,
        engine: Engine,
        schema: Iterable[Axiom],
        infer_from: Callable[[Iterable[Axiom]], frozenset[Axiom] | None],
    ) -> None:
        super().__init__(classification, engine, schema)
        self._infer_from = infer_from
        self.failure = ''

    def run(self, axioms: Iterable[Axiom]) -> None:
        """Add what follows from everything that is asserted now."""
        self._forget_classes()
        super().run(axioms)
        self.failure = ''
        if not self._engine.consistent:
            return
        try:
            found = self._infer_from(axioms)
        except JavaReasonerError as error:
            self.failure = str(error)
            return
        self._left_out = ()
        if found is None:
            self._engine.take_from_cases(None)
        else:
            self._take(found)

    def _take(self, found: Iterable[Axiom]) -> None:
        known, engine = self._classification, self._engine
        parents: dict[str, set[str]] = {}
        facts: list[Axiom] = []
        for axiom in found:
            if isinstance(axiom, SubClassOf):
                parents.setdefault(str(axiom.sub), set()).add(str(axiom.sup))
            else:
                facts.append(axiom)
        pairs = [
            (cls, sup)
            for cls in known.classes()
            for sup in closure(cls, lambda one: {*known.superclasses(one), *parents.get(one, ())})
            if sup not in (cls, THING) and not known.below_by_itself(cls, sup)
        ]
        known.complete(pairs)
        self._compared = True
        while facts:
            engine.take_from_cases(facts)
            members = ((sup, x) for cls, sup in pairs for x in engine.program.cls(cls).members)
            facts = [ClassAssertion(sup, x) for sup, x in members]
            facts = [fact for fact in facts if not engine.holds(fact)]


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

    from owl_reasoner.documents.writing import ontology_bytes

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
