"""Command lines: what cannot be understood costs one line, and exit code 2."""

from __future__ import annotations

import argparse
from collections.abc import Sequence
from typing import NoReturn

from surveillance_runtime.suggestions import nearest

EXIT_BAD_INPUT = 2


class CommandParser(argparse.ArgumentParser):
    """A command's parser, which ends the process with one line about the first error."""

    def parse_args(  # type: ignore[override]
        self, args: Sequence[str] | None = None
    ) -> argparse.Namespace:
        """Return what the words say; an unknown option is answered with the nearest known."""
        options, unknown = self.parse_known_args(args)
        for word in unknown:
            if not word.startswith('-'):
                self.error(f'unexpected word {word!r}')
            name = word.split('=')[0]
            known = (each for each in self._option_string_actions if each.startswith('--'))
            self.error(f'unknown option {name!r}: expected {nearest(name, known)}')
        return options

    def error(self, message: str) -> NoReturn:
        name = self.prog.split()[-1]
        self.exit(EXIT_BAD_INPUT, f'{name}: {message} (see {self.prog} --help)\n')
