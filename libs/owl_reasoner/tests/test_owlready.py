"""What an owlready2 program has from the native reasoner, and from the quads of a World."""

# ruff: noqa: N801, RUF012 - classes as users of owlready2 write them
from __future__ import annotations

import gc
import os
import threading
import weakref
from pathlib import Path
from typing import Any

import owlready2
import pytest
from owlready2 import AllDisjoint, FunctionalProperty, Imp, Not, SymmetricProperty, Thing

from owl_reasoner import read_ontology, sync_reasoner_native
from owl_reasoner.documents.xml_reading import OntologyFileError
from owl_reasoner.owl.axioms import Axiom, Declaration
from owl_reasoner.owl.expressions import Literal
from owl_reasoner.owl.vocabulary import OWL, RDF, XSD
from owl_reasoner.owlready import reasoning
from owl_reasoner.owlready.quads import (
    lexical_form,
    quads_of,
    read_axioms,
    stored_value,
)
from owl_reasoner.reasoner.budget import ReasoningBudgetError

IRI = 'http://example.org/o#'
DATA = Path(__file__).parent / 'data'


class Shop:
    """A World with classes, properties and a rule, made as owlready2's users do."""

    def __init__(self) -> None:
        self.world: Any = owlready2.World()
        self.onto: Any = self.world.get_ontology(IRI)
        with self.onto:

            class Drug(Thing):
                pass

            class price(Drug >> float, FunctionalProperty):
                pass

            class tablets(Drug >> int, FunctionalProperty):
                pass

            class each(Drug >> float, FunctionalProperty):
                pass

            class beside(Thing >> Thing, SymmetricProperty):
                pass

            class Cheap(Drug):
                equivalent_to = [Drug & (each <= 1.0)]  # type: ignore[operator]

            class Contained(Thing):
                equivalent_to = [beside.some(Drug)]

            class Impossible(Drug):
                is_a = [Not(Drug)]

            rule = Imp()
            rule.set_as_rule(
                'Drug(?d), price(?d, ?p), tablets(?d, ?n), divide(?r, ?p, ?n) -> each(?d, ?r)'
            )
            self.aspirin: Any = Drug('aspirin', price=5.0, tablets=10)
            self.box: Any = Thing('box', namespace=self.onto)
            self.box.beside = [self.aspirin]


@pytest.fixture
def shop() -> Shop:
    """Provide the World."""
    return Shop()


def test_classes_values_and_rules_show_in_the_objects(shop: Shop) -> None:
    onto = shop.onto
    sync_reasoner_native(shop.world)
    assert shop.aspirin.is_a == [onto.Cheap]
    assert shop.aspirin.each == 0.5
    assert shop.aspirin.beside == [shop.box]
    assert shop.box.is_a == [onto.Contained]
    assert owlready2.Nothing in onto.Impossible.equivalent_to
    assert onto.Impossible in list(shop.world.inconsistent_classes())


def test_a_further_call_follows_the_changes_and_takes_back_what_follows_no_more(
    shop: Shop, monkeypatch: pytest.MonkeyPatch
) -> None:
    onto = shop.onto
    sync_reasoner_native(shop.world)
    read = 0

    def counted(*args: Any) -> Any:
        nonlocal read
        read += 1
        return read_axioms(*args)

    monkeypatch.setattr(reasoning, 'read_axioms', counted)
    shop.aspirin.price = 50.0
    with onto:
        other = onto.Drug('other', price=1.0, tablets=4)
    sync_reasoner_native(shop.world)
    assert (shop.aspirin.is_a, shop.aspirin.each) == ([onto.Drug], 5.0)
    assert (other.is_a, other.each) == ([onto.Cheap], 0.25)
    shop.box.beside = []
    owlready2.destroy_entity(other)
    sync_reasoner_native(shop.world)
    assert shop.aspirin.beside == []
    assert shop.box.is_a == [Thing]
    assert read == 0, 'facts are not read again'
    with onto:

        class Sold(Thing):
            equivalent_to = [onto.Drug & onto.price.some(float)]

    sync_reasoner_native(shop.world)
    assert read == 1
    assert set(shop.aspirin.is_a) == {Sold}
    before = shop.world.graph.db.total_changes
    sync_reasoner_native(shop.world)
    assert shop.world.graph.db.total_changes == before, 'nothing changed, nothing is written'


def test_a_further_call_follows_changes_of_classes(shop: Shop) -> None:
    onto = shop.onto
    sync_reasoner_native(shop.world)
    onto.Impossible.is_a = [onto.Drug]
    sync_reasoner_native(shop.world)
    assert onto.Impossible.equivalent_to == []
    assert list(shop.world.inconsistent_classes()) == []
    with onto:

        class Ware(Thing):
            pass

        onto.Contained.is_a = [Ware]
        onto.Drug.is_a = [onto.Contained]
    sync_reasoner_native(shop.world)
    assert shop.box.is_a == [onto.Contained]
    assert onto.Drug.is_a == [onto.Contained]
    assert onto.Impossible.is_a == [onto.Drug]
    with onto:
        onto.Impossible.is_a = [onto.Drug, Not(onto.Contained)]
    sync_reasoner_native(shop.world)
    assert owlready2.Nothing in onto.Impossible.equivalent_to


def test_a_declaration_in_the_quads_alone_is_no_fact_about_an_individual(shop: Shop) -> None:
    def say(subject: str, predicate: str, value: str) -> None:
        names = (IRI + subject, predicate, value)
        shop.onto._add_obj_triple_raw_spo(*map(shop.world._abbreviate, names))

    def held() -> set[Axiom]:
        kb = next(iter(reasoning._SESSIONS[shop.world].values()))._kb
        assert kb is not None
        return set(kb.axioms())

    sync_reasoner_native(shop.world)
    before = held()
    say('Fresh', RDF + 'type', OWL + 'Class')
    sync_reasoner_native(shop.world)
    assert held() - before == {Declaration('class', IRI + 'Fresh')}
    say('near', RDF + 'type', OWL + 'SymmetricProperty')
    say('box', IRI + 'near', IRI + 'aspirin')
    say('box', RDF + 'type', IRI + 'Fresh')
    sync_reasoner_native(shop.world)
    assert shop.world['http://example.org/o#Fresh'] in shop.box.is_a
    assert shop.aspirin.near == [shop.box]


def test_a_contradiction_is_an_error_that_says_why_and_can_be_mended(shop: Shop) -> None:
    with shop.onto:

        class Food(Thing):
            pass

        AllDisjoint([Food, shop.onto.Drug])
        shop.aspirin.is_a.append(Food)
    with pytest.raises(owlready2.OwlReadyInconsistentOntologyError, match='aspirin is Food'):
        sync_reasoner_native(shop.world)
    shop.aspirin.is_a.remove(Food)
    sync_reasoner_native(shop.world)
    assert shop.aspirin.is_a == [shop.onto.Cheap]


def test_what_follows_goes_into_the_ontology_that_is_named(shop: Shop) -> None:
    sync_reasoner_native(shop.onto)
    inferred = shop.world.get_ontology(reasoning.INFERRED)
    assert not list(inferred.get_triples(shop.aspirin.storid, None, None))
    assert shop.aspirin.is_a == [shop.onto.Cheap]
    shop.aspirin.price = 50.0
    sync_reasoner_native(shop.onto)
    assert shop.aspirin.is_a == [shop.onto.Drug]
    shop = Shop()
    found = shop.world.get_ontology('http://example.org/found#')
    with found:
        sync_reasoner_native([shop.onto])
    assert list(found.get_triples(shop.aspirin.storid, None, None))


def test_values_are_left_out_on_request(shop: Shop) -> None:
    sync_reasoner_native(shop.world, infer_property_values=False, infer_data_property_values=False)
    assert shop.aspirin.is_a == [shop.onto.Cheap]
    assert shop.aspirin.each is None


def test_it_ends_at_its_time_and_when_it_is_cancelled(shop: Shop) -> None:
    cancel = threading.Event()
    cancel.set()
    with pytest.raises(ReasoningBudgetError, match='cancelled'):
        sync_reasoner_native(shop.world, cancel=cancel)
    with pytest.raises(ReasoningBudgetError, match='more than 0 s'):
        sync_reasoner_native(shop.world, timeout=0.0)
    assert shop.aspirin.is_a == [shop.onto.Drug]
    sync_reasoner_native(shop.world)
    assert shop.aspirin.is_a == [shop.onto.Cheap]


def test_a_property_that_relates_nothing_is_the_empty_one_until_it_may_relate_something(
    shop: Shop,
) -> None:
    onto, world = shop.onto, shop.world
    with onto:

        class Shut(Thing):
            is_a = [Not(onto.Drug)]

        class opens(Shut >> Thing):
            range = [onto.Drug]

        class label(Shut >> str):
            pass

        class wrong(Thing >> int):
            range = [str]

        Shut.is_a.append(opens.only(Shut))

    sync_reasoner_native(world)
    assert opens.equivalent_to == [owlready2.bottomObjectProperty]
    assert wrong.equivalent_to == [world['http://www.w3.org/2002/07/owl#bottomDataProperty']]
    assert (label.equivalent_to, onto.beside.equivalent_to) == ([], [])
    Shut.is_a.remove(Not(onto.Drug))
    sync_reasoner_native(world)
    assert (opens.equivalent_to, opens.is_a) == ([], [owlready2.ObjectProperty])


def test_what_is_not_used_is_told(shop: Shop) -> None:
    with shop.onto:
        rule = Imp()
        rule.set_as_rule('Drug(?d), price(?d, ?p) -> Cheap(?d)')
    shop.world.graph.execute(
        'UPDATE resources SET iri=? WHERE iri=?',
        ('http://www.w3.org/2003/11/swrlb#unheardOf', 'http://www.w3.org/2003/11/swrlb#divide'),
    )
    with pytest.warns(reasoning.IncompleteReasoningWarning, match='unheardOf'):
        sync_reasoner_native(shop.world)


def test_a_world_that_nobody_needs_goes_with_its_reasoner() -> None:
    shop = Shop()
    sync_reasoner_native(shop.world)
    session = weakref.ref(next(iter(reasoning._SESSIONS[shop.world].values())))
    del shop
    for _ in range(3):
        gc.collect()
    assert session() is None or session().world is not None


@pytest.mark.parametrize(
    ('lexical', 'datatype', 'stored'),
    [
        ('7', 'integer', 7),
        (str(2**63 - 1), 'integer', 2**63 - 1),
        (str(2**63), 'integer', str(2**63)),
        (str(-(2**63)), 'long', -(2**63)),
        (str(-(2**63) - 1), 'integer', str(-(2**63) - 1)),
        ('few', 'int', 'few'),
        ('0.5', 'double', 0.5),
        ('0.00000012', 'decimal', 1.2e-07),
        ('-12000000000000000000000', 'decimal', -1.2e22),
        ('2.5', 'decimal', 2.5),
        ('2.50', 'decimal', '2.50'),
        ('007', 'long', '007'),
        ('+5', 'integer', '+5'),
        ('1e3', 'double', '1e3'),
        ('0.1234567890123456789', 'decimal', '0.1234567890123456789'),
        ('INF', 'double', 'INF'),
        ('NaN', 'float', 'NaN'),
        ('true', 'boolean', 'true'),
        ('5', 'string', '5'),
    ],
)
def test_a_value_is_stored_as_owlready2_does_where_its_text_stays(
    lexical: str, datatype: str, stored: object
) -> None:
    literal = Literal(lexical, XSD + datatype)
    value = stored_value(literal)
    assert (value, type(value)) == (stored, type(stored))
    assert lexical_form(value, literal.datatype) == lexical


@pytest.mark.parametrize(
    ('value', 'datatype', 'text'),
    [
        (1.2e-07, 'decimal', '0.00000012'),
        (-1.2e22, 'decimal', '-12000000000000000000000'),
        (1.2e-07, 'double', '1.2e-07'),
        (1e22, 'float', '1e+22'),
        (5, 'decimal', '5'),
        (True, 'boolean', 'true'),
        (False, 'boolean', 'false'),
        ('a', 'string', 'a'),
    ],
)
def test_a_stored_value_is_written_as_its_datatype_has_it(
    value: object, datatype: str, text: str
) -> None:
    assert lexical_form(value, XSD + datatype) == text


def test_ontologies_that_were_not_chosen_say_nothing() -> None:
    world: Any = owlready2.World()
    first, second = (world.get_ontology(f'http://example.org/{name}#') for name in 'ab')
    with first:

        class Drug(Thing):
            pass

        class Cheap(Drug):
            pass

        aspirin: Any = Cheap('aspirin')
        box: Any = Thing('box', namespace=first)

    sync_reasoner_native([first])
    assert box not in Drug.instances()
    with second:
        box.is_a.append(Cheap)
    sync_reasoner_native([first])
    target = world.get_ontology(reasoning.INFERRED)
    asked = 'SELECT s, o FROM objs WHERE c=?'
    told = world.graph.execute(asked, (target.graph.c,)).fetchall()
    assert all(subject != box.storid for subject, _ in told)
    sync_reasoner_native([first, second])
    assert aspirin in Drug.instances()
    assert box in Drug.instances()


def test_what_follows_goes_where_the_innermost_with_says(shop: Shop) -> None:
    outer, inner = (shop.world.get_ontology(f'http://example.org/{name}#') for name in 'ab')
    with outer, inner:
        sync_reasoner_native(shop.world, infer_data_property_values=True)
    header, *others = quads_of(shop.world, [outer.graph.c])
    assert (header[0], others) == (outer.storid, [])
    assert len(list(quads_of(shop.world, [inner.graph.c]))) > 2


def differences(world: Any) -> dict[str, set[Any]]:
    """Return what a reasoner left of each entity."""
    return {
        entity.name: {*map(str, entity.is_a), *map(str, entity.equivalent_to)}
        for entity in (*world.classes(), *world.individuals())
    }


FOREIGN = sorted(Path(os.environ.get('OWLREADY2_TESTS', '/nowhere')).glob('*.owl'))


@pytest.mark.java
@pytest.mark.parametrize('path', FOREIGN, ids=lambda path: path.name)
def test_owlready2s_own_ontologies_come_out_as_with_pellet(path: Path) -> None:
    """Set OWLREADY2_TESTS to the folder ``test`` of owlready2's source package."""
    results: list[object] = []
    for sync in (sync_reasoner_native, owlready2.sync_reasoner_pellet):
        world = owlready2.World()
        try:
            world.get_ontology(path.as_uri()).load(only_local=True)
            sync(world, infer_property_values=True, infer_data_property_values=True, debug=0)
            results.append(differences(world))
        except owlready2.OwlReadyInconsistentOntologyError:
            results.append('inconsistent')
        except owlready2.OwlReadyOntologyParsingError:
            pytest.skip('owlready2 does not read it')
        except owlready2.OwlReadyJavaError as error:
            pytest.skip(f'Pellet does not run: {str(error)[-80:]}')
        world.close()
    assert results[0] == results[1]


def test_a_world_that_owlready2_writes_as_n_quads_is_read_by_the_iri_of_its_ontology(
    shop: Shop, tmp_path: Path
) -> None:
    path = tmp_path / 'shop.nq'
    sync_reasoner_native(shop.world)
    shop.world.save(str(path), format='nquads')
    found = read_ontology(path, IRI.rstrip('#'))
    assert (found.format, found.iri) == ('nquads', IRI.rstrip('#'))
    told = read_axioms(shop.world, [shop.onto.graph.c]).axioms
    assert {*found.axioms} == {*told}
    with pytest.raises(OntologyFileError, match=r'one named <urn:x>, got <.*>, <http://inferr'):
        read_ontology(path, 'urn:x')


def test_n_quads_of_one_graph_are_read_whatever_it_is_named() -> None:
    triple = f'<urn:a> <{RDF}type> <{OWL}NamedIndividual>'
    for graph in ('', ' <urn:g>'):
        document = read_ontology(f'{triple}{graph} .\n'.encode(), 'urn:x')
        assert document.axioms == [Declaration('individual', 'urn:a')]
    with pytest.raises(OntologyFileError, match='not N-Quads'):
        read_ontology(f'{triple} <urn:g> .\n{triple} <urn:g> <urn:h> .\n'.encode(), 'urn:x')
