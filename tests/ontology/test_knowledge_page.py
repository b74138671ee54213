"""The page on opening the robot's knowledge in Python has a script that does what it says."""

from __future__ import annotations

import re
import subprocess
import sys
import time
from pathlib import Path

from armor_service.access import Settings
from armor_service.client import ArmorClient, InProcessTransport
from armor_service.service import ArmorService
from armor_service.store.store import Store
from libs.armor_service.tests.seven_rooms import build_seven_rooms

PAGE = Path(__file__).parents[2] / 'docs' / 'how-to' / 'knowledge_in_python.md'


def test_the_script_prints_the_urgent_rooms_and_adds_a_rule(tmp_path: Path) -> None:
    (script,) = re.findall(r'```python\n(.*?)```', PAGE.read_text(), re.DOTALL)
    (tmp_path / 'urgent.py').write_text(script)
    store = Store(tmp_path / 'store')
    service = ArmorService(Settings(ontologies_folder=tmp_path), store=store)
    armor = ArmorClient('me', 'surveillance', InProcessTransport(service))
    build_seven_rooms(armor, False, True)
    assert 'R1' not in armor.query.ind_b2_class('URGENT')
    urgent = sorted(armor.query.ind_b2_class('URGENT'))
    done = subprocess.run(
        [sys.executable, 'urgent.py', str(store.path('surveillance'))],
        cwd=tmp_path,
        capture_output=True,
        text=True,
        timeout=60,
    )
    assert done.returncode == 0, done.stderr
    assert done.stdout.split() == ['URGENT:', *urgent]
    while 'R1' not in armor.query.ind_b2_class('URGENT'):
        time.sleep(0.01)
    service.close()
