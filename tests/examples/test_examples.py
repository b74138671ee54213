"""Each script in `examples/` runs by itself, in seconds, and says something."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import pytest

CHECKOUT = Path(__file__).resolve().parents[2]
EXAMPLES = sorted([*CHECKOUT.glob('examples/*.py'), *CHECKOUT.glob('libs/*/examples/*.py')])


@pytest.mark.parametrize('script', EXAMPLES, ids=lambda script: script.stem)
def test_the_example_runs(script: Path, tmp_path: Path) -> None:
    done = subprocess.run(
        [sys.executable, str(script)],
        cwd=tmp_path,
        env={**os.environ, 'PYTHONDONTWRITEBYTECODE': '1'},
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == 0, done.stderr
    assert done.stdout.strip()
    assert 'Traceback' not in done.stderr


def test_every_example_is_in_the_index() -> None:
    index = (CHECKOUT / 'examples' / 'README.md').read_text(encoding='utf-8')
    assert [script.name for script in EXAMPLES if script.name not in index] == []
