"""The process that nodes run in."""

from __future__ import annotations

import subprocess
import sys

PROGRAM = """
import numpy, scipy.linalg
from threadpoolctl import threadpool_info
from surveillance_runtime.node import StartError
from surveillance_runtime.process import run_nodes

def node():
    print({each['user_api']: each['num_threads'] for each in threadpool_info()})
    raise StartError('enough')

run_nodes([node], [])
"""


def test_nodes_compute_on_one_thread_whatever_was_imported_before() -> None:
    done = subprocess.run(
        [sys.executable, '-c', PROGRAM], capture_output=True, text=True, timeout=60
    )
    assert "{'blas': 1" in done.stdout, done
