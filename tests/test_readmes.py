"""The example in a library's README runs, word for word, in an empty folder."""

from __future__ import annotations

import re
import subprocess
import sys
from pathlib import Path

import pytest

LIBRARIES = Path(__file__).parents[1] / 'libs'
NAMES = sorted(path.parent.name for path in LIBRARIES.glob('*/README.md'))


def run(folder: Path, *arguments: str) -> str:
    """Run Python in a folder; return what it printed."""
    done = subprocess.run([sys.executable, *arguments], cwd=folder, capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    return done.stdout


@pytest.mark.parametrize('name', NAMES)
def test_the_readmes_example_runs(name: str, tmp_path: Path) -> None:
    text = (LIBRARIES / name / 'README.md').read_text(encoding='utf-8')
    examples = re.findall(r'```python\n(.*?)```', text, re.DOTALL)
    assert examples, f'{name}: no example'
    (tmp_path / 'example.py').write_text('\n'.join(examples), encoding='utf-8')
    assert run(tmp_path, 'example.py').strip(), f'{name}: the example prints nothing'
