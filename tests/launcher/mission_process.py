"""A whole launch without the set-up: python mission_process.py RUNS [options of launch.py]."""

from __future__ import annotations

import sys
from pathlib import Path

from launcher import cli

cli.RUNS = Path(sys.argv[1])
cli._enter = lambda argv, extras=(): None
sys.exit(cli.main(sys.argv[2:]))
