"""The three sizes in which a benchmark runs, and the options that choose one.

Without an option a benchmark measures what the documentation tells. `--quick` measures less, in
about a minute. `--smoke` measures next to nothing, in a few seconds: it shows that the benchmark
still runs, and `.ci/benchmarks.py` starts each script so.
"""

from __future__ import annotations

import argparse
from enum import Enum
from typing import Any, NoReturn, TypeVar

Value = TypeVar('Value')


class Size(Enum):
    """How much a benchmark measures."""

    FULL = 0
    QUICK = 1
    SMOKE = 2

    def of(self, full: Value, quick: Value, smoke: Value) -> Value:
        """Return the value for this size."""
        return (full, quick, smoke)[self.value]


def sized_parser(
    document: str | None, *, quick: str | None = None, **options: Any
) -> argparse.ArgumentParser:
    """Return a parser whose `size` is what `--quick` and `--smoke` choose.

    Args:
        document: The script's docstring, whose first line is the description.
        quick: What `--quick` does; None: the script has no such size.
        **options: Of the parser.
    """
    first = (document or '').strip().partition('\n')[0]
    parser = argparse.ArgumentParser(**{'description': first, **options})
    sizes = parser.add_mutually_exclusive_group()
    chosen: dict[str, Any] = {'action': 'store_const', 'dest': 'size', 'default': Size.FULL}
    if quick is not None:
        sizes.add_argument('--quick', const=Size.QUICK, help=quick, **chosen)
    sizes.add_argument('--smoke', const=Size.SMOKE, help='a few seconds: it still runs', **chosen)
    return parser


def skip(why: str) -> NoReturn:
    """End in one line that says why there is nothing to measure here."""
    print(f'skipped: {why}')
    raise SystemExit(0)
