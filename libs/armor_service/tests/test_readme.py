"""The README's example runs word for word in an empty folder, and so does the demo."""

from __future__ import annotations

import re
import subprocess
import sys
from pathlib import Path

README = Path(__file__).parent.parent / 'README.md'


def run(folder: Path, *arguments: str) -> str:
    """Run Python in a folder; return what it printed."""
    done = subprocess.run(
        [sys.executable, *arguments], cwd=folder, capture_output=True, text=True, timeout=120
    )
    assert done.returncode == 0, done.stderr
    return done.stdout


def test_the_readmes_example_runs(tmp_path: Path) -> None:
    (example,) = re.findall(r'```python\n(.*?)```', README.read_text(), re.DOTALL)
    (tmp_path / 'example.py').write_text(example)
    said = run(tmp_path, 'example.py')
    assert "['R1']" in said
    assert 'R1 is ROOM because' in said


def test_the_demo_runs(tmp_path: Path) -> None:
    said = run(tmp_path, '-m', 'armor_service.demo')
    assert "Started again: ['Hall']" in said
    assert "CORRIDOR now: ['Hall', 'R1']" in said
