"""The drawings in the documentation are the machines as they are."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

from state_machines.export import to_mermaid
from surveillance_behaviour.machines import MACHINES

from .scripted_world import World

DOCUMENT = Path(__file__).parents[2] / 'docs' / 'reference' / 'machines.md'


@pytest.mark.parametrize('name', list(MACHINES))
def test_the_drawing_is_the_machine(name: str) -> None:
    drawings = re.findall(r'```mermaid\n(.*?)```', DOCUMENT.read_text(encoding='utf-8'), re.DOTALL)
    assert to_mermaid(MACHINES[name](World().mission(machine=name))) in drawings
