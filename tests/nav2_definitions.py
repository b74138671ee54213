"""The actions of nav2_msgs that this project uses (`launcher.nav2_messages`), for tests.

nav2_msgs is no wheel and no package of an index, so that it is made here: `stand_in` gives classes
at once, `build` compiles real types as `surveillance_interfaces` is compiled, which takes a minute.
"""

from __future__ import annotations

import ctypes
import shutil
import subprocess
import sys
import zipfile
from hashlib import sha256
from pathlib import Path
from types import SimpleNamespace
from typing import Any

from launcher.nav2_messages import ACTIONS as ACTIONS
from launcher.nav2_messages import write_package

CHECKOUT = Path(__file__).parents[1]
LIBRARIES = (
    'generator_c',
    'typesupport_fastrtps_c',
    'typesupport_introspection_c',
    'typesupport_c',
    'generator_py',
)
"""Those of nav2_msgs, each before the ones that need it."""
_DEFAULTS = {'bool': False, 'string': '', 'float32': 0.0}


def stand_in(action: str) -> SimpleNamespace:
    """Return classes that stand in for an action's Goal and Result; as rosidl's do, they refuse a
    field that they do not have.
    """
    goal, result, _ = ACTIONS[action].split('---')
    return SimpleNamespace(Goal=_message_type(goal), Result=_message_type(result))


def _message_type(section: str) -> Any:
    fields: dict[str, Any] = {}
    constants: dict[str, int] = {}
    for line in section.split('\n'):
        kind, _, rest = line.partition(' ')
        name, _, value = rest.partition('=' if '=' in rest else ' ')
        if '=' in rest:
            constants[name] = int(value)
        elif kind:
            plain = 0 if 'int' in kind else [] if kind.endswith('[]') else _DEFAULTS.get(kind)
            fields[name] = plain if not value else value == 'true' or float(value)

    def fill(self: Any, **given: Any) -> None:
        for name, value in (fields | given).items():
            setattr(self, name, value)

    return type('Message', (), {'__slots__': tuple(fields), '__init__': fill, **constants})


def build() -> Path:
    """Compile nav2_msgs, once for each state of the definitions; return where it can be imported.

    It is loaded into this process, too: its libraries lie beside no others of ROS.
    """
    packages = 'lib/python*/site-packages'
    state = sha256(f'{sys.version}{ACTIONS}'.encode()).hexdigest()[:16]
    folder = CHECKOUT / 'build' / 'nav2_msgs' / state
    if not list(folder.glob(packages)):
        sources = folder.with_suffix('.new')
        write_package(sources, CHECKOUT / 'surveillance_interfaces')
        pip = [sys.executable, '-m', 'pip', '--disable-pip-version-check', 'wheel', '-q']
        words = [*pip, '--no-deps', '-w', str(sources), str(sources)]
        subprocess.run(words, check=True, stdin=subprocess.DEVNULL)
        (wheel,) = sources.glob('*.whl')
        with zipfile.ZipFile(wheel) as archive:
            archive.extractall(sources / 'wheel')
        (data,) = (sources / 'wheel').glob('*.data/data')
        shutil.rmtree(folder, ignore_errors=True)
        data.rename(folder)
        shutil.rmtree(sources)
    for kind in LIBRARIES:
        ctypes.CDLL(str(folder / f'lib/libnav2_msgs__rosidl_{kind}.so'), ctypes.RTLD_GLOBAL)
    (found,) = folder.glob(packages)
    return found
