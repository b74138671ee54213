"""The command lines of packages: what cannot be understood costs one line, and exit code 2."""

from __future__ import annotations

import argparse
from typing import NoReturn

EXIT_BAD_INPUT = 2


class CommandParser(argparse.ArgumentParser):
    """A command's parser, which ends the process with one line about the first error."""

    def error(self, message: str) -> NoReturn:
        name = self.prog.split()[-1]
        self.exit(EXIT_BAD_INPUT, f'{name}: {message} (see {self.prog} --help)\n')
