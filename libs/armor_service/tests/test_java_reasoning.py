"""The optional Java reasoner; the tests that start a JVM are not in the default run."""

from __future__ import annotations

from pathlib import Path

import pytest

from armor_service.access import Settings
from armor_service.changes import ChangeFeed
from armor_service.service import ArmorService
from armor_service.store import Store
from owl_reasoner.knowledge_base import KnowledgeBase
from owl_reasoner.owl.axioms import ClassAssertion, Rule, SubClassOf
from owl_reasoner.owl.expressions import (
    ClassAtom,
    ObjectComplementOf,
    ObjectUnionOf,
    Variable,
)
from owl_reasoner.reasoner import java_reasoning

from .seven_rooms import FIXTURES, IRI, ONTOLOGY, asker, names

UNION = """<?xml version="1.0"?>
<rdf:RDF xmlns="http://bnc/exp-rob-lab/2022-23#" xml:base="http://bnc/exp-rob-lab/2022-23"
     xmlns:owl="http://www.w3.org/2002/07/owl#" xmlns:rdfs="http://www.w3.org/2000/01/rdf-schema#"
     xmlns:rdf="http://www.w3.org/1999/02/22-rdf-syntax-ns#">
  <owl:ObjectProperty rdf:about="#near"/>
  <owl:ObjectProperty rdf:about="#beside">
    <rdfs:subPropertyOf rdf:resource="#near"/>
  </owl:ObjectProperty>
  <owl:Class rdf:about="#B"><rdfs:subClassOf rdf:resource="#D"/></owl:Class>
  <owl:Class rdf:about="#C"><rdfs:subClassOf rdf:resource="#D"/></owl:Class>
  <owl:Class rdf:about="#A">
    <rdfs:subClassOf>
      <owl:Class>
        <owl:unionOf rdf:parseType="Collection">
          <owl:Class rdf:about="#B"/>
          <owl:Class rdf:about="#C"/>
        </owl:unionOf>
      </owl:Class>
    </rdfs:subClassOf>
  </owl:Class>
  <owl:AllDisjointClasses>
    <owl:members rdf:parseType="Collection">
      <owl:Class rdf:about="#B"/><owl:Class rdf:about="#E"/>
    </owl:members>
  </owl:AllDisjointClasses>
</rdf:RDF>
"""


def test_without_java_the_native_reasoner_takes_over(
    service: ArmorService, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(java_reasoning, 'absent', lambda: 'there is no java on the path')
    ask = asker(service)
    answer = ask('LOAD FILE', ONTOLOGY, IRI, 'false', 'HERMIT', 'false')
    assert answer.success
    assert answer.error_description == (
        "reasoner 'HERMIT' cannot be used, the native one is: hermit: there is no java on the path"
    )
    ask('ADD DATAPROP IND', 'visitedAt', 'R3', 'LONG', '1')
    assert names(ask('QUERY IND CLASS', 'URGENT')) == ['R3']


@pytest.mark.java
def test_a_reference_reasons_with_hermit(tmp_path: Path) -> None:
    if why := java_reasoning.absent():
        pytest.skip(why)
    (tmp_path / 'u.owl').write_text(UNION)

    def start() -> ArmorService:
        limits = Settings(ontologies_folder=tmp_path, read_only_directories=(FIXTURES,))
        return ArmorService(limits, store=Store(tmp_path / 'store'))

    service = start()
    feed = ChangeFeed(lambda: None)
    service.watch(feed.note)
    ask = asker(service)
    ask('LOAD FILE', 'u.owl', IRI, 'false', 'hermit', 'true')
    ask('ADD IND CLASS', 'x', 'A')
    ask('ADD IND CLASS', 'x', 'E')
    ask('ADD OBJECTPROP IND', 'beside', 'x', 'y')
    ask('REASON')
    came = [axiom for change in feed.take() for axiom, derived in change.added if derived]
    assert ClassAssertion(f'{IRI}#C', f'{IRI}#x') in came
    assert names(ask('QUERY IND', 'x')) == ['A', 'C', 'D', 'E']
    assert names(ask('QUERY IND CLASS', 'D')) == ['x']
    assert names(ask('QUERY OBJECTPROP IND', 'near', 'x')) == ['y']
    assert 'A' in names(ask('QUERY CLASS CLASS', 'D'))
    assert 'C(x)' in ask('QUERY FACT', '?(x)').queried_objects
    assert ask('QUERY EXPLAIN', 'C(x)').success
    ask('REMOVE IND CLASS', 'x', 'E')
    ask('REASON')
    assert names(ask('QUERY IND', 'x')) == ['A', 'D'], 'B or C, but not which'
    service.close()
    service = start()
    assert names(asker(service)('QUERY IND', 'x')) == ['A', 'D']
    service.close()


@pytest.mark.java
def test_hermit_derives_what_the_native_reasoner_does_not() -> None:
    """Rules take no part in the native reasoner's cases."""
    if why := java_reasoning.absent():
        pytest.skip(why)
    b, c, d, e, i = (f'{IRI}#{name}' for name in 'bcdei')
    x = Variable(f'{IRI}#x')
    either = ClassAssertion(ObjectUnionOf((b, c)), i)
    axioms = [
        *(Rule((ClassAtom(cls, x),), (ClassAtom(d, x),)) for cls in (b, c)),
        SubClassOf(d, e),
        either,
    ]
    native = KnowledgeBase(IRI, axioms)
    kb = java_reasoning.JavaKnowledgeBase(IRI, axioms)
    assert native.reason()
    assert kb.reason()
    assert native.types(i) == set()
    assert kb.types(i) == {d, e}
    explanation = kb.explain(ClassAssertion(e, i))
    assert explanation is not None
    assert 'hermit infers it' in explanation.sentence()
    no_d = ClassAssertion(ObjectComplementOf(d), i)
    kb.add(no_d)
    assert not kb.reason()
    contradiction = kb.explain_inconsistency()
    assert contradiction is not None
    assert 'hermit infers it' in contradiction.sentence()
    kb.remove(no_d)
    kb.remove(either)
    kb.add(ClassAssertion(e, i))
    assert kb.reason()
    assert kb.types(i) == {e}


@pytest.mark.java
def test_an_ontology_that_the_java_reasoner_refuses_is_reasoned_over_natively(
    service: ArmorService,
) -> None:
    if why := java_reasoning.absent():
        pytest.skip(why)
    ask = asker(service)
    answer = ask('LOAD FILE', ONTOLOGY, IRI, 'false', 'HERMIT', 'false')
    assert answer.success
    assert "reasoner 'HERMIT' cannot be used" in answer.error_description
    assert '\n' not in answer.error_description
    ask('ADD DATAPROP IND', 'visitedAt', 'R3', 'LONG', '1')
    assert names(ask('QUERY IND CLASS', 'URGENT')) == ['R3']
