#!/usr/bin/env python3
"""Write what docs/reference/directives.md says of each directive, between its two marks.

    .venv/bin/python docs/makers/armor_directives.py

It is made of the table of directives; a test holds that the page is current.
"""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path

from armor_service.client import Manipulation, Operation, Query, Utils
from armor_service.directives import TABLE, Kind
from armor_service.protocol import ExitCode
from armor_service.rendering import TYPES

BEGIN = '<!-- begin: written by docs/makers/armor_directives.py -->'
END = '<!-- end -->'
PAGE = Path(__file__).parents[1] / 'reference' / 'directives.md'
_HEAD = ('directive', 'arguments', 'what it does', 'method of the Python client')
_TITLES = {
    Kind.MANIPULATION: 'Manipulations',
    Kind.CONTROL: 'Applying and reasoning',
    Kind.QUERY: 'Queries',
    Kind.UTILITY: 'References, files and logging',
}
_CODES = {
    ExitCode.OK: 'done; also QUERY IND of an individual without a class (success is false)',
    ExitCode.UNSUPPORTED_TYPE: 'a value type outside the table below; success is true for ADD and '
    'REMOVE, false for REPLACE',
    ExitCode.REFERENCE_BUSY: 'a change while another client is mounted',
    ExitCode.NO_REFERENCE_NAME: 'no reference name, whatever the command',
    ExitCode.NO_COMMAND: 'no command',
    ExitCode.MOUNT_REFUSED: 'MOUNT while another client is mounted, or on an unknown reference',
    ExitCode.NOT_IMPLEMENTED: 'defined by ARMOR, never sent',
    ExitCode.INVALID_COMMAND: 'unknown command or reference; too few or wrong arguments; a file '
    'that cannot be loaded or saved; the description says which',
    ExitCode.SEVERAL_VALUES: 'raised by the client: one value was to be replaced, there are more',
}


def directives_text() -> str:
    """Return the tables of directives, exit codes and value types, as Markdown."""
    parts = []
    methods = _methods()
    for kind, title in _TITLES.items():
        rows = [
            (
                f'`{directive.words}`' + ('' if directive.native else ' ★'),
                directive.signature or '–',
                directive.summary
                + (f' *Differs from ARMOR 2.2: {directive.differs}*' if directive.differs else ''),
                ', '.join(f'`{method}`' for method in methods.get(directive.words, ())) or '–',
            )
            for directive in TABLE.values()
            if directive.kind is kind
        ]
        parts.append(f'### {title}\n\n' + _table(_HEAD, rows))
    codes = [(str(int(code)), meaning) for code, meaning in _CODES.items()]
    parts.append('### Exit codes\n\n' + _table(('code', 'when'), codes))
    types = [(f'`{word}`', f'`xsd:{datatype}`') for word, datatype in TYPES.items()]
    parts.append('### Value types\n\n' + _table(('type', 'stored as'), types))
    return '\n\n'.join(parts)


def _methods() -> dict[str, list[str]]:
    """Return the methods of the Python client that send each directive."""
    found: dict[str, list[str]] = {}
    for part in (Manipulation, Query, Utils):
        for name, method in vars(part).items():
            if isinstance(method, Operation):
                for words in method.words:
                    found.setdefault(words, []).append(f'{part.__name__.lower()}.{name}')
    return found


def updated(manual: str) -> str:
    """Return the manual with the text between its marks written anew.

    Raises:
        ValueError: A mark is missing.
    """
    if BEGIN not in manual or END not in manual:
        raise ValueError(f'expected the marks {BEGIN} and {END}')
    head, _, rest = manual.partition(BEGIN)
    _, _, tail = rest.partition(END)
    return f'{head}{BEGIN}\n\n{directives_text()}\n\n{END}{tail}'


def _table(head: tuple[str, ...], rows: Iterable[tuple[str, ...]]) -> str:
    lines = [head, tuple('---' for _ in head), *rows]
    escaped = [[cell.replace('|', '\\|') for cell in row] for row in lines]
    return '\n'.join(f'| {" | ".join(row)} |' for row in escaped)


def main() -> None:
    """Rewrite the page."""
    PAGE.write_text(updated(PAGE.read_text(encoding='utf-8')), encoding='utf-8')


if __name__ == '__main__':
    main()
