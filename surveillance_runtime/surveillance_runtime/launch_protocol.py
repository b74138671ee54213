"""What the launcher and the processes that it starts say to each other: variables and single bytes.

A process gets descriptors of pipes and its limits in environment variables.
"""

from __future__ import annotations

UP = 'LAUNCH_UP'
"""A descriptor that a process closes to say that the bulk of its start is done."""
HEARTBEAT = 'LAUNCH_HEARTBEAT'
"""A descriptor that a process writes `BEAT`, `SLEPT` or `FINISHED` to."""
RESTARTS = 'LAUNCH_RESTARTS'
"""How often the process has been started again."""
MEMORY = 'LAUNCH_MEMORY'
"""The bytes of data that the process may map."""

BEAT = b'.'
"""The process runs."""
SLEPT = b'S'
"""It did not run for so long that its peers may have forgotten it."""
FINISHED = b'F'
"""It ends on purpose."""
