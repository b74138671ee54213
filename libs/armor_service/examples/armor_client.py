"""Directives of ARMOR in one process: load, add, reason, ask, explain. No ROS, no Java."""

from __future__ import annotations

import tempfile
from pathlib import Path

from armor_service import (
    ArmorClient,
    ArmorService,
    ArmorServiceInternalError,
    InProcessTransport,
    Settings,
    Store,
)

PATROL = Path(__file__).resolve().parents[1] / 'tests' / 'fixtures' / 'patrol.owl'

IRI = 'http://bnc/exp-rob-lab/2022-23'


def main() -> None:
    """Build a map by directives, and ask what follows from it."""
    with tempfile.TemporaryDirectory() as folder:
        store = Store(Path(folder) / 'store')  # every change is on the disk before it is answered
        service = ArmorService(
            Settings(Path(folder), read_only_directories=(PATROL.parent,)), store=store
        )
        armor = ArmorClient('example', 'map', InProcessTransport(service))

        # A map of three rooms around a corridor; the robot is in the corridor.
        armor.utils.load_ref_from_file(str(PATROL), IRI)
        for room, door in (('R1', 'D1'), ('R2', 'D2'), ('R3', 'D3')):
            armor.manipulation.add_objectprop_to_ind('hasDoor', room, door)
            armor.manipulation.add_objectprop_to_ind('hasDoor', 'C1', door)
            armor.manipulation.add_dataprop_to_ind('visitedAt', room, 'LONG', '100')
        armor.manipulation.disj_inds(['D1', 'D2', 'D3'])
        armor.manipulation.disj_inds(['R1', 'R2', 'R3', 'C1'])
        armor.manipulation.add_objectprop_to_ind('isIn', 'Robot1', 'C1')
        armor.manipulation.replace_one_dataprop_b2_ind('now', 'Robot1', 'LONG', '105')
        print('consistent:', armor.utils.sync_buffered_reasoner())
        print('the robot can reach', armor.query.objectprop_b2_ind('canReach', 'Robot1'))

        # Rooms become urgent by time alone: a rule of the ontology compares two data properties.
        armor.manipulation.replace_one_dataprop_b2_ind('now', 'Robot1', 'LONG', '200')
        armor.utils.sync_buffered_reasoner()
        print('urgent:', armor.query.ind_b2_class('URGENT'))
        reason = armor.query.explain('URGENT(R1)')
        assert reason is not None
        print('why:', reason[0])

        # What cannot be done says what was expected, with ARMOR's exit code.
        try:
            armor.manipulation.add_dataprop_to_ind('visitedAt', 'R1', 'LONG', 'yesterday')
        except ArmorServiceInternalError as error:
            print(f'exit code {error.code:d}: {error.msg}')
        service.close()


if __name__ == '__main__':
    main()
