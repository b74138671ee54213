"""Two rooms and a corridor: directives and answers, what a kill leaves, and a program of owlready2.

python -m armor_service.demo
"""

from __future__ import annotations

from pathlib import Path
from tempfile import TemporaryDirectory
from time import monotonic, sleep

from armor_service import ArmorClient, ArmorService, InProcessTransport, Settings, Store

IRI = 'http://example.org/map'
MAP = """
Prefix: : <http://example.org/map#>
Ontology: <http://example.org/map>
Class: ROOM
Class: DOOR
Class: CORRIDOR
    EquivalentTo: ROOM and (hasDoor min 2 DOOR)
ObjectProperty: hasDoor
    Domain: ROOM
    Range: DOOR
DataProperty: visitedAt
DifferentIndividuals: D1, D2
"""


def main() -> None:
    """Serve, change, ask why, restart, and let another program write."""
    with TemporaryDirectory() as name:
        folder = Path(name)
        (folder / 'map.omn').write_text(MAP)
        settings = Settings(ontologies_folder=folder)
        service = ArmorService(settings, store=Store(folder / 'state'))
        service.watch(_told)
        armor = ArmorClient('demo', 'map', InProcessTransport(service))
        armor.utils.load_ref_from_file('map.omn', IRI)
        for room, door in (('Hall', 'D1'), ('Hall', 'D2'), ('R1', 'D1')):
            answer = armor.call('ADD', 'OBJECTPROP', 'IND', ['hasDoor', room, door])
            print(f'ADD OBJECTPROP IND hasDoor {room} {door}: success={answer.success}')
        print('QUERY IND CLASS CORRIDOR:', armor.query.ind_b2_class('CORRIDOR'))
        why = armor.query.explain('CORRIDOR(Hall)')
        print(why[0] if why else '')

        service.close()
        store = Store(folder / 'state')
        service = ArmorService(settings, store=store)
        armor = ArmorClient('demo', 'map', InProcessTransport(service))
        print('\nStarted again:', armor.query.ind_b2_class('CORRIDOR'))
        _another_program(store.path('map'))
        end = monotonic() + 5.0
        while 'R1' not in armor.query.ind_b2_class('CORRIDOR') and monotonic() < end:
            sleep(0.02)
        print('CORRIDOR now:', armor.query.ind_b2_class('CORRIDOR'))
        service.close()


def _told(reference: str, changes: object) -> None:
    added = getattr(changes, 'added', ())
    print(
        f'  ({reference} tells its subscribers of {len(added)} new axioms)' if added else '', end=''
    )
    print('\n' if added else '', end='')


def _another_program(path: Path) -> None:
    import owlready2

    world = owlready2.World(filename=str(path), exclusive=False)
    onto = world.get_ontology(IRI).load()
    print('owlready2 reads:', onto.Hall, onto.Hall.hasDoor)
    onto.R1.hasDoor.append(onto.D2)
    world.save()
    world.close()
    print('owlready2 wrote: R1 hasDoor D2')


if __name__ == '__main__':
    main()
