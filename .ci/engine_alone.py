#!/usr/bin/env python3
"""Installs the state machine engine alone in a bare virtual environment, and runs its tutorial.

    python3 .ci/engine_alone.py

`pip install ./surveillance_fsm` must bring nothing else, and `import surveillance_fsm` must need
Python alone. The environment is a new one each time, in a temporary folder.
"""

from __future__ import annotations

import subprocess
import sys
import tempfile
import venv
from pathlib import Path

CHECKOUT = Path(__file__).resolve().parent.parent
TUTORIAL = """
import re, sys
from pathlib import Path
import surveillance_fsm
text = Path(sys.argv[1]).read_text(encoding='utf-8')
code = '\\n'.join(re.findall(r'```python tutorial\\n(.*?)```', text, re.DOTALL))
assert code, 'no tutorial found'
exec(compile(code, sys.argv[1], 'exec'), {'__name__': 'tutorial'})
known = ('surveillance_fsm', 'pip', 'setuptools', '_distutils_hack')
foreign = sorted(
    name for name, module in sys.modules.items()
    if 'site-packages' in (getattr(module, '__file__', None) or '')
    and name.partition('.')[0] not in known
)
assert not foreign, f'imported besides: {foreign}'
print('the tutorial runs with', surveillance_fsm.__file__)
"""


def main() -> int:
    """Installs, runs, and returns the exit code."""
    with tempfile.TemporaryDirectory() as folder:
        # Installed from a copy: building leaves folders beside the sources.
        sources = Path(folder) / 'surveillance_fsm'
        tracked = subprocess.run(
            ['git', 'ls-files', '-co', '--exclude-standard', 'surveillance_fsm'],
            cwd=CHECKOUT,
            capture_output=True,
            text=True,
            check=True,
        ).stdout.split()
        for name in tracked:
            target = Path(folder) / name
            if (CHECKOUT / name).is_file():
                target.parent.mkdir(parents=True, exist_ok=True)
                target.write_bytes((CHECKOUT / name).read_bytes())
        venv.create(Path(folder) / 'venv', with_pip=True)
        python = str(Path(folder) / 'venv' / 'bin' / 'python')
        install = [python, '-m', 'pip', 'install', '--quiet', '--disable-pip-version-check']
        for command in (
            [*install, '--no-deps', str(sources)],
            [python, '-m', 'pip', 'check', '--disable-pip-version-check'],
            [python, '-c', TUTORIAL, str(CHECKOUT / 'docs' / 'fsm.md')],
        ):
            code = subprocess.run(command, cwd=folder).returncode
            if code:
                return code
    return 0


if __name__ == '__main__':
    sys.exit(main())
