"""What stands behind `launch.py`: set-up of the environment, the command line, the supervisor."""

import sys
from pathlib import Path

# The table of the nodes is the runtime package's, which the installed robot has too. It is read
# before anything is set up.
sys.path.append(str(Path(__file__).resolve().parent.parent / 'surveillance_runtime'))
