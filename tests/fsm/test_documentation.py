"""The tutorial's code runs as it stands, block after block."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

DOCUMENT = Path(__file__).resolve().parents[2] / 'docs' / 'fsm.md'
BLOCK = re.compile(r'^```python tutorial\n(.*?)^```$', re.MULTILINE | re.DOTALL)


@pytest.mark.timeout(60)
def test_the_tutorial_runs():
    text = DOCUMENT.read_text(encoding='utf-8')
    blocks = list(BLOCK.finditer(text))
    assert len(blocks) >= 10
    namespace: dict[str, object] = {'__name__': 'tutorial'}
    for block in blocks:
        line = text.count('\n', 0, block.start()) + 1
        # Blank lines in front, so that an error names the line in the document.
        code = compile('\n' * line + block.group(1), str(DOCUMENT), 'exec')
        exec(code, namespace)
