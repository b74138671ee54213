"""A supervisor over small scripts, for the tests: python supervised.py NAME=SCRIPT ..."""

from __future__ import annotations

import os
import sys

from launcher import supervisor as module
from launcher.log_merge import MergedLog
from launcher.supervisor import ManagedProcess, Supervisor

seconds = float(os.environ['SECONDS_TO_RUN']) if 'SECONDS_TO_RUN' in os.environ else None
module.STOP_AT_MOST = float(os.environ.get('STOP_AT_MOST', module.STOP_AT_MOST))
at_once = int(os.environ.get('AT_ONCE', '0'))
programs = []
for argument in sys.argv[1:]:
    name, _, script = argument.partition('=')
    command = [sys.executable, '-u', '-c', script]
    programs.append(
        ManagedProcess(
            name,
            command,
            os.environ,
            nodes=name.split('+') if '+' in name else (),
            takes_input=True,
            leads=name.startswith('lead'),
            ends_run=name.startswith('job'),
            can_be_missed=name.startswith('page'),
            memory=int(os.environ.get('MEMORY', '0')),
        )
    )
log = MergedLog(None, [p.name for p in programs], colour=False)
supervisor = Supervisor(
    programs,
    log,
    pauses=(0.01, 0.02),
    at_once=at_once or None,
    on_trouble=lambda _nodes, text: print('alarm:', text, flush=True),
)
supervisor.read_from(
    0, lambda line: print('sent', supervisor.send(*line.split(' ', 1)), flush=True)
)
sys.exit(supervisor.run(seconds))
