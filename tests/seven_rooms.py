"""The seven rooms of the assignment: each room with its doors."""

from __future__ import annotations

SEVEN_ROOMS = {
    'R1': ['D1'],
    'R2': ['D2'],
    'R3': ['D3'],
    'R4': ['D4'],
    'E': ['D6', 'D7'],
    'C1': ['D1', 'D2', 'D5', 'D6'],
    'C2': ['D3', 'D4', 'D5', 'D7'],
}
