"""Changes on their way to subscribers, and several clients at once."""

from __future__ import annotations

import threading

from hypothesis import given, settings
from hypothesis import strategies as st

from armor_service.changes import LARGE, ChangeFeed
from armor_service.client import ArmorClient, InProcessTransport
from armor_service.facts import FactSet, ShortFact, parse_fact
from armor_service.service import ArmorService
from armor_service.store.records import decode, encode
from libs.armor_service.tests.seven_rooms import IRI, ONTOLOGY, asker, build_seven_rooms
from surveillance_interfaces.msg import ArmorDirectiveRes
from surveillance_ontology.conversions import (
    changes_from_ros,
    changes_to_ros,
    fill_response,
    request_from_ros,
    request_to_ros,
    response_from_ros,
)


def test_changes_are_numbered_and_say_what_is_derived(
    service: ArmorService, client: ArmorClient
) -> None:
    announced: list[int] = []
    feed = ChangeFeed(lambda: announced.append(1))
    service.watch(feed.note)
    build_seven_rooms(client, False, True)
    loaded, *changes = feed.take()
    assert (loaded.reference_name, loaded.sequence) == ('map', 0)
    assert [change.sequence for change in changes] == list(range(2, len(changes) + 2))
    assert announced == [1], 'once, until it is taken'
    client.manipulation.replace_one_dataprop_b2_ind('visitedAt', 'R2', 'LONG', '1')
    client.utils.sync_buffered_reasoner()
    asserted, derived = (changes_to_ros(change) for change in feed.take())
    assert [(str(f), came, d) for f, came, d in changes_from_ros(asserted)] == [
        ('visitedAt(R2, "1665579740"^^xsd:long)', False, False),
        ('visitedAt(R2, "1"^^xsd:long)', True, False),
    ]
    assert ('URGENT(R2)', True, True) in [
        (str(fact), came, d) for fact, came, d in changes_from_ros(derived)
    ]
    assert derived.is_consistent
    client.utils.drop_ref()
    assert [change.sequence for change in feed.take()] == [0]


def test_a_change_too_large_for_a_message_leaves_a_gap(
    service: ArmorService, client: ArmorClient
) -> None:
    client.utils.load_ref_from_file(ONTOLOGY, IRI, True)
    feed = ChangeFeed(lambda: None)
    service.watch(feed.note)
    for number in range(LARGE + 1):
        client.manipulation.add_ind_to_class(f'X{number}', 'THING')
    client.utils.apply_buffered_changes()
    first = feed.take()[0]
    assert (first.sequence, first.added) == (2, ())


def test_a_fact_set_follows_messages_and_asks_when_it_cannot() -> None:
    facts = FactSet('URGENT(?)')
    one, two = parse_fact('URGENT(R1)'), parse_fact('URGENT(R2)')
    other = parse_fact('ROOM(R1)')
    assert facts.follow(5, [(one, True, True)]) is None, 'it does not know what was before'
    assert facts.replace([one], []) == [(one, True)]
    assert facts.follow(6, [(two, True, True), (other, True, True)]) == [(two, True)]
    assert facts.follow(7, [(two, True, False)]) == [], 'asserted as well now'
    assert facts.follow(8, [(two, False, True)]) == [], 'asserted still'
    assert facts.follow(9, [(two, False, False), (two, True, True)]) == [], 'derived instead'
    assert facts.follow(10, [(two, False, True)]) == [(two, False)]
    assert facts.follow(12, []) is None, 'one was missed'
    assert facts.replace([two], [two]) == [(one, False), (two, True)]
    assert facts.follow(13, [(two, False, False)]) == [(two, False)]
    assert facts.facts == set()


def test_messages_round_trip(service: ArmorService, client: ArmorClient) -> None:
    build_seven_rooms(client, False, True)
    request = client.request('QUERY SPARQL FORMATTED', 'SELECT * { ?a ?b ?c } LIMIT 2')
    back = request_from_ros(request_to_ros(request))
    assert (back.words, list(back.args)) == (request.words, list(request.args))
    for response in (service.execute(request), asker(service)('NO SUCH'), asker(service)('REASON')):
        assert response_from_ros(fill_response(ArmorDirectiveRes(), response)) == response


def test_every_axiom_can_be_journalled(service: ArmorService, client: ArmorClient) -> None:
    build_seven_rooms(client, False, True)
    for axiom in service.workspace.references.find('map').kb.axioms():
        assert decode(encode(axiom)) == axiom


def test_clients_at_once_do_not_disturb_each_other(service: ArmorService) -> None:
    clients = [ArmorClient(f'c{n}', 'map', InProcessTransport(service)) for n in range(4)]
    errors: list[BaseException] = []
    start = threading.Barrier(len(clients))

    def work(number: int, client: ArmorClient) -> None:
        try:
            start.wait()
            client.utils.load_ref_from_file(ONTOLOGY, IRI)
            for value in range(60):
                client.manipulation.replace_one_dataprop_b2_ind(
                    'visitedAt', f'R{number}', 'LONG', str(value)
                )
                client.manipulation.add_objectprop_to_ind('hasDoor', f'R{number}', f'D{value}')
                assert f'R{number}' in client.query.ind_b2_class('ROOM')
                client.manipulation.remove_objectprop_from_ind('hasDoor', f'R{number}', f'D{value}')
        except BaseException as error:
            errors.append(error)

    threads = [
        threading.Thread(target=work, args=(number, client))
        for number, client in enumerate(clients)
    ]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert errors == []
    ask = clients[0].query
    assert ask.facts('visitedAt(?, ?)') == [
        ShortFact('visitedAt', (f'R{n}', '"59"^^xsd:long')) for n in range(4)
    ]
    assert ask.facts('hasDoor(?, ?)') == []
    assert clients[0].utils.sync_buffered_reasoner()


STEPS = st.one_of(
    st.tuples(
        st.sampled_from(['ADD DATAPROP IND', 'REMOVE DATAPROP IND']),
        st.tuples(
            st.just('visitedAt'),
            st.sampled_from(['R1', 'E']),
            st.just('LONG'),
            st.sampled_from(['1665579740', '5']),
        ),
    ),
    st.tuples(
        st.sampled_from(['ADD IND CLASS', 'REMOVE IND CLASS']),
        st.tuples(st.sampled_from(['R1', 'X']), st.sampled_from(['URGENT', 'ROOM'])),
    ),
    st.tuples(
        st.sampled_from(['ADD OBJECTPROP IND', 'REMOVE OBJECTPROP IND']),
        st.one_of(
            st.tuples(st.just('hasDoor'), st.sampled_from(['R1', 'E']), st.sampled_from(['D1'])),
            st.tuples(st.just('canReach'), st.just('Robot1'), st.sampled_from(['R1', 'C1'])),
            st.tuples(st.just('isIn'), st.just('Robot1'), st.sampled_from(['E', 'R1'])),
        ),
    ),
    st.just(('REASON', ())),
    st.just(('REASON', ())),
)
PATTERNS = ('URGENT(?)', 'canReach(Robot1, ?)', 'visitedAt(?, ?)', 'ROOM(?)', 'owl:sameAs(?, ?)')


@settings(max_examples=40)
@given(st.lists(STEPS, max_size=14))
def test_followed_facts_are_those_that_the_server_has(
    steps: list[tuple[str, tuple[str, ...]]],
) -> None:
    service = ArmorService(warn=lambda _: None)
    client = ArmorClient('test', 'map', InProcessTransport(service))
    build_seven_rooms(client, False, True)
    feed = ChangeFeed(lambda: None)
    service.watch(feed.note)
    sets = [FactSet(pattern) for pattern in PATTERNS]
    for facts in sets:
        facts.follow(0, [])
        facts.replace(*client.query.facts_by_origin(str(facts.pattern)))
    for words, args in steps:
        service.execute(client.request(words, *args))
        for change in feed.take():
            told = changes_from_ros(changes_to_ros(change))
            for facts in sets:
                assert facts.follow(change.sequence, told) is not None
        for facts in sets:
            assert facts.facts == set(client.query.facts(str(facts.pattern))), facts.pattern
    service.close()
