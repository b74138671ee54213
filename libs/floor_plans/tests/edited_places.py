"""What each change of a place makes of its file, and what it says, as text.

`python -m libs.floor_plans.tests.edited_places` writes the text anew, after a change that is meant.
"""

from __future__ import annotations

import copy
from pathlib import Path
from typing import Any

import yaml

from floor_plans import RoomMap, read_place
from floor_plans.editor.operations import OPERATIONS, Draft, checked_fields

CONFIG = Path(__file__).with_name('places')
RECORD = Path(__file__).with_name('edited_places.txt')
STATIONS = {
    'E': {'pose': [5.0, 10.0, 0.0], 'rate': 4.0},
    'R1': {'pose': [10.0, 4.0, 1.0]},
}
ZONES = {
    'keep_out_zones': {'K1': [8.0, 3.0, 9.0, 3.0, 9.0, 4.0]},
    'slow_zones': {'S1': [0.2, 10.0, 8.0, 11.0, 8.0, 11.0, 9.0]},
}
CORNERS = [[1.0001, 2], [3, 2], [3, 4.5678]]
CHANGES: list[tuple[dict[str, Any], list[tuple[str, dict[str, Any]]]]] = [
    (
        {},
        [
            ('cut', {'x1': 14, 'y1': 11, 'x2': 14, 'y2': 13}),
            ('cut', {'x1': 10, 'y1': 3.1, 'x2': 10.4, 'y2': 5.9}),
            ('cut', {'x1': 4, 'y1': 9, 'x2': 4, 'y2': 11}),
            ('join', {'first': 'C1', 'second': 'R1'}),
            ('join', {'first': 'C1', 'second': 'E'}),
            ('join', {'first': 'R1', 'second': 'R3'}),
            ('join', {'first': 'R1', 'second': 'R1'}),
            ('join', {'first': 'R1', 'second': 'Q1'}),
            ('move_door', {'name': 'D1', 'x': 11.0, 'y': 6.7}),
            ('move_door', {'name': 'D1', 'x': 9.0, 'y': 6.4}),
            ('move_door', {'name': 'DD', 'x': 9.0, 'y': 6.4}),
            ('set_door', {'name': 'D2', 'x': 1.00001, 'y': 2, 'yaw': '0.5', 'width': 1.239}),
            ('set_door', {'name': 'E2', 'x': 1, 'y': 2, 'yaw': 0.5, 'width': 1.239}),
            ('add_door', {'x': 8.0, 'y': 6.5}),
            ('add_door', {'x': 7.0, 'y': 10.0}),
            ('add_door', {'x': 10.0, 'y': 2.0}),
            ('remove_door', {'name': 'D3'}),
            ('remove_door', {'name': 'X'}),
            ('rename', {'kind': 'room', 'name': 'E', 'new': 'dock'}),
            ('rename', {'kind': 'room', 'name': 'R2', 'new': 'D1'}),
            ('rename', {'kind': 'room', 'name': 'R2', 'new': 'R2'}),
            ('rename', {'kind': 'room', 'name': 'R2', 'new': 'a/b'}),
            ('rename', {'kind': 'door', 'name': 'D6', 'new': 'flap'}),
            ('rename', {'kind': 'door', 'name': 'D6', 'new': 'D7'}),
            ('rename', {'kind': 'roof', 'name': 'D6', 'new': 'D8'}),
            ('move_point', {'room': 'R1', 'x': 9.1234, 'y': 4}),
            ('move_point', {'room': 'R1', 'x': 9, 'y': 8}),
            ('move_point', {'room': 'R1', 'x': -90, 'y': 8}),
            ('move_station', {'x': 8.5, 'y': 4.5, 'yaw': 0.12345}),
            ('move_station', {'x': 5.25, 'y': 10.5}),
            ('move_station', {'x': -50, 'y': 10.5}),
            ('move_station', {'x': 5.25, 'y': 10.5, 'room': 'R1'}),
            ('add_station', {'x': 8.5, 'y': 4.5, 'yaw': 0.12345}),
            ('add_station', {'x': 5.25, 'y': 10.5}),
            ('remove_station', {'room': 'E'}),
            ('remove_station', {'room': 'R1'}),
            ('set_zone', {'kind': 'keep_out', 'corners': CORNERS}),
            ('set_zone', {'kind': 'slow', 'corners': CORNERS, 'name': 'wet', 'speed': 0.3}),
            ('set_zone', {'kind': 'slow', 'corners': CORNERS}),
            ('set_zone', {'kind': 'fast', 'corners': CORNERS}),
            ('remove_zone', {'name': 'K1'}),
            ('set_rule', {'room': 'R1', 'key': 'thresholds', 'value': '600'}),
            ('set_rule', {'room': 'R1', 'key': 'hours', 'value': 'Mon-Fri 8:00-17:00'}),
            ('set_rule', {'room': 'R1', 'key': 'thresholds', 'value': ''}),
            ('set_rule', {'room': 'R1', 'key': 'thresholds', 'value': 'long'}),
            ('set_rule', {'room': 'R1', 'key': 'colours', 'value': 1}),
            ('set_keep_out', {'room': 'R3', 'on': True}),
            ('set_keep_out', {'room': 'R3', 'on': False}),
            ('set_text', {'key': 'quiet_hours', 'value': '22:00-6:00'}),
            ('set_text', {'key': 'robot_room', 'value': ''}),
            ('set_text', {'key': 'noise', 'value': ''}),
            ('set_marker', {'id': 7.0, 'x': 1.00004, 'y': 2, 'z': 1, 'yaw': 0.5}),
            ('set_marker', {'id': 7, 'x': 1, 'y': 2, 'z': 1, 'yaw': 0.5, 'name': 'a b/'}),
            ('set_marker', {'id': 7.5, 'x': 1, 'y': 2, 'z': 1, 'yaw': 0.5}),
            ('remove_marker', {'name': 'M1'}),
        ],
    ),
    (
        {'station': None, 'stations': STATIONS, 'recharge_rooms': ['E', 'R1'], 'keep_out': ['R2']}
        | ZONES,
        [
            ('join', {'first': 'C1', 'second': 'R1'}),
            ('join', {'first': 'C1', 'second': 'R2'}),
            ('rename', {'kind': 'room', 'name': 'R1', 'new': 'dock'}),
            ('rename', {'kind': 'room', 'name': 'R2', 'new': 'lab'}),
            ('rename', {'kind': 'zone', 'name': 'K1', 'new': 'K9'}),
            ('rename', {'kind': 'zone', 'name': 'K1', 'new': 'S1'}),
            ('move_station', {'x': 9.0, 'y': 4.0}),
            ('move_station', {'x': 9.0, 'y': 8.0}),
            ('move_station', {'x': 9.0, 'y': 8.0, 'room': 'E'}),
            ('move_station', {'x': 9.0, 'y': 4.0, 'room': 'E'}),
            ('remove_station', {'room': 'E'}),
            ('remove_station', {'room': 'R1'}),
            ('add_station', {'x': 9.0, 'y': 8.0}),
            ('cut', {'x1': 9.5, 'y1': 3.1, 'x2': 9.6, 'y2': 5.9}),
            ('set_zone', {'kind': 'keep_out', 'corners': CORNERS}),
            ('set_zone', {'kind': 'keep_out', 'corners': CORNERS, 'name': 'S1'}),
            ('remove_zone', {'name': 'S1'}),
            ('remove_zone', {'name': 'S2'}),
            ('set_keep_out', {'room': 'R3', 'on': True}),
            ('set_keep_out', {'room': 'R2', 'on': False}),
            ('set_keep_out', {'room': 'R2', 'on': 'yes'}),
        ],
    ),
]


def flat(described: dict[str, Any]) -> dict[str, str]:
    """Return the entries of a file, a text for each; an empty table is none."""
    found = {}
    for key, value in described.items():
        if isinstance(value, dict):
            found |= {f'{key}.{name}': str(entry) for name, entry in value.items()}
        else:
            found[key] = str(value)
    return found


def recorded() -> list[str]:
    """Return what each change says, and what it changes."""
    plan = read_place(CONFIG / 'seven_rooms.yaml').plan
    assert plan is not None
    text = (CONFIG / 'seven_rooms.yaml').read_text('utf-8')
    parameters = yaml.safe_load(text)['/**']['ros__parameters']
    lines = []
    for more, changes in CHANGES:
        before = {k: v for k, v in {**parameters, **more}.items() if v is not None}
        described = copy.deepcopy(before)
        changed_plan = type(plan).from_parameters(described) if more else plan
        regions = RoomMap(changed_plan)
        for name, fields in changes:
            draft = Draft(copy.deepcopy(before), {}, changed_plan, regions, 0.22)
            lines.append(f'{name} {fields}')
            try:
                lines.append(f'  {OPERATIONS[name](draft, **checked_fields(fields))}')
            except ValueError as error:
                lines.append(f'  refused: {error}')
                continue
            old, new = flat(before), flat(draft.described)
            lines += [f'  - {key}: {old[key]}' for key in old if old[key] != new.get(key)]
            lines += [f'  + {key}: {new[key]}' for key in new if new[key] != old.get(key)]
            lines += [f'  {new} was {old}' for new, old in draft.renamed.items()]
    return lines


def main() -> None:
    """Write what each change does now."""
    RECORD.write_text('\n'.join(recorded()) + '\n', 'utf-8')


if __name__ == '__main__':
    main()
