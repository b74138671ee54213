"""A whole launch without the set-up: python mission_process.py RUNS [options of launch.py]."""

from __future__ import annotations

import signal
import sys
from pathlib import Path

from launcher.commands import CONFIG, make_parser, wanted_run
from launcher.mission import run_mission

signal.signal(signal.SIGINT, signal.SIG_IGN)
options = make_parser().parse_args(sys.argv[2:])
sys.exit(run_mission(wanted_run(options), CONFIG, Path(sys.argv[1])))
