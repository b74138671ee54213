"""Command lines: what cannot be understood costs one line, and exit code 2."""

from __future__ import annotations

import argparse
import sys
from collections.abc import Sequence
from typing import NoReturn
from urllib.parse import urlsplit

from strict_files.suggestions import nearest

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
                self.error(f'unexpected word {word!r}{self._meant(word, args)}')
            name = word.split('=')[0]
            known = (each for each in self._option_string_actions if each.startswith('--'))
            self.error(f'unknown option {name!r}: expected {nearest(name, known)}')
        return options

    def _meant(self, word: str, args: Sequence[str] | None) -> str:
        """Name the option that takes the value which was given to a switch, as after `--web`."""
        words = list(sys.argv[1:] if args is None else args)
        switch = words[words.index(word) - 1] if word in words[1:] else ''
        takes_one = [
            name
            for name, action in self._option_string_actions.items()
            if switch.startswith('--') and name.startswith(f'{switch}-') and action.nargs is None
        ]
        return f': {switch} takes no value, expected {takes_one[0]} {word}' if takes_one else ''

    def error(self, message: str) -> NoReturn:
        name = self.prog.split()[-1]
        self.exit(EXIT_BAD_INPUT, f'{name}: {message} (see {self.prog} --help)\n')


def page_address(text: str) -> tuple[str, int]:
    """Return host and port of the page's address.

    Raises:
        ValueError: It is not of the form HOST:PORT.
    """
    try:
        found = urlsplit(f'//{text}')
        port = found.port
    except ValueError:  # of the port, or of brackets that are not closed
        port = None
    if port is None or found.netloc != text or found.username is not None:
        raise ValueError(f'--web-address {text!r}: expected HOST:PORT like 0.0.0.0:8080')
    return found.hostname or '127.0.0.1', port
