"""What stands behind `launch.py`: set-up of the environment, the command line, the supervisor.

Begin with `cli`, which carries a command out, and `run`, whose record has every option of a run.
`run_mission` is one run from start to summary: `fleet_launch` says which robots there are,
`run_configuration` which parameters their nodes get, `run_processes` which processes that makes,
and `supervisor` runs them. `environment` sets up `.venv` before anything else.
"""

import sys
from pathlib import Path

# The table of the nodes is the runtime package's, which the installed robot has too. It is read
# before anything is set up, and so is the library on whose files the runtime's stand.
_CHECKOUT = Path(__file__).resolve().parent.parent
if (_CHECKOUT / 'surveillance_runtime' / 'surveillance_runtime').exists():  # else from wheels
    sys.path += [str(_CHECKOUT / name) for name in ('surveillance_runtime', 'libs/strict_files')]
