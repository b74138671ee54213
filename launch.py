#!/usr/bin/env python3
"""Sets the project up and runs it; see `python3 launch.py --help`."""

import signal
import sys

# Ctrl-C ends without a word until the command line has been read; whoever started this program in
# the project's environment held it back meanwhile.
signal.signal(signal.SIGINT, signal.SIG_DFL)
signal.pthread_sigmask(signal.SIG_UNBLOCK, [signal.SIGINT])

if sys.version_info < (3, 11):  # noqa: UP036 - an older Python is told, not met with a traceback
    sys.exit('launch.py: Python 3.11, 3.12 or 3.13 is needed, this is ' + sys.version.split()[0])

from launcher.cli import main  # noqa: E402

if __name__ == '__main__':
    sys.exit(main(sys.argv[1:]))
