"""Stands in for a node's module: it says that it is up, and waits for a signal."""

import signal


def main(arguments: list[str]) -> int:
    print('up with', *arguments, flush=True)
    signal.sigwait([signal.SIGUSR1])
    return 0
