#!/usr/bin/env python3
"""Measure and check the words of the documentation.

    python3 .ci/words.py               # a row for each page, and the sums
    python3 .ci/words.py FOLDER        # the same of another checkout

Prose is what stands outside code blocks, tables and headings. Written by a program, and left out:
the pages of `GENERATED`, and what stands between marks in others. `tests/test_words.py` holds the
bounds.
"""

from __future__ import annotations

import re
import sys
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

CHECKOUT = Path(__file__).resolve().parent.parent
GENERATED = {'parameters', 'interfaces', 'alarms', 'state_machines', 'cli', 'changelog'}
"""Names of pages of `docs/reference` that a program writes."""

LONGEST_HOW_TO = 600
"""Words of a how-to page, without its code blocks."""

LONG = 30
"""A sentence above this number of words is long."""

BANNED = {
    'whoever': 'name who',
    'as ever': 'leave it out',
    'for ever': 'forever, or without end',
    'is told': 'is published, or is reported',
    'are told': 'are published, or are reported',
    'taken back': 'rolled back',
    'put aside': 'quarantined',
    'by the way': 'leave it out',
    'utilize': 'use',
    'in order to': 'to',
    'simply': 'leave it out',
    'obviously': 'leave it out',
    'please': 'leave it out',
    'sees to it': 'name what it does',
    'stays put': 'stands',
    'has somebody': 'name who',
}
"""What a reader does not search for, or what says nothing, with what to write."""


PASSIVE = re.compile(
    r'\b(?:is|are|was|were|be|been|being)\s+'
    r'(?:(?:not|never|also|only|then|still|often|always|first|already|once|so|at once)\s+)*'
    r'(?:\w+ed|known|seen|found|made|given|taken|kept|held|built|sent|read|written|driven|drawn'
    r'|shown|told|said|left|lost|cut|set|put|run|begun|done|met|heard|shut|bound|caught)\b',
    re.IGNORECASE,
)
"""A form of "be" with a participle: a passive, mostly; "is closed" of a door counts as well."""

ITEM = re.compile(r'^\s*([-*]|\d+\.)\s+')
"""How an item of a list begins."""


@dataclass(frozen=True)
class Page:
    """A page and its figures.

    Attributes:
        name: Its path below the checkout.
        words: Words outside code blocks, tables among them.
        marks: Fence lines of code blocks: two for each block.
        sentences: The number of words of each sentence of its prose.
        text: Its prose, sentence by sentence.
    """

    name: str
    words: int
    marks: int
    sentences: tuple[int, ...]
    text: tuple[str, ...]

    @property
    def mean(self) -> float:
        """Return the mean length of a sentence, words."""
        return sum(self.sentences) / max(1, len(self.sentences))

    @property
    def passive(self) -> float:
        """Return which part of the sentences has a passive."""
        return sum(bool(PASSIVE.search(each)) for each in self.text) / max(1, len(self.text))

    @property
    def long(self) -> float:
        """Return which part of the sentences is long."""
        return sum(each > LONG for each in self.sentences) / max(1, len(self.sentences))


def pages(checkout: Path) -> list[Page]:
    """Return the pages that people write."""
    found = [*checkout.glob('docs/**/*.md'), *checkout.glob('*.md')]
    return [
        read(path, checkout)
        for path in sorted(found)
        if path.stem not in GENERATED | {'fsm_reference', 'CHANGELOG', 'CODE_OF_CONDUCT'}
        or path.parent.name == 'explanation'
    ]


def read(path: Path, checkout: Path) -> Page:
    """Return a page with its figures."""
    text = re.sub(
        r'<!-- begin.*?<!-- end -->', '', path.read_text(encoding='utf-8'), flags=re.DOTALL
    )
    blocks = re.findall(r'^[ \t]*```.*?^[ \t]*```', text, re.MULTILINE | re.DOTALL)
    outside = re.sub(r'^[ \t]*```.*?^[ \t]*```', '\n\n', text, flags=re.MULTILINE | re.DOTALL)
    prose = tuple(sentences(outside))
    return Page(
        str(path.relative_to(checkout)),
        len(outside.split()),
        2 * len(blocks),
        tuple(len(each.split()) for each in prose),
        prose,
    )


def sentences(text: str) -> Iterator[str]:
    """Yield the sentences of Markdown without tables, headings and code."""
    lines = (
        '' if re.match(r'\s*(\||#|<|!\[|    \S)', line) else re.sub(ITEM, '\n\n', line)
        for line in text.splitlines()
    )
    plain = re.sub(r'!?\[([^\]]*)\]\([^)]*\)', r'\1', '\n'.join(lines))
    plain = re.sub(r'`[^`]*`', 'code', plain)
    for paragraph in re.split(r'\n\s*\n', plain):
        joined = ' '.join(paragraph.split())
        for sentence in re.split(r'(?<=[.!?])\)?\s+(?=[A-Z(*"c])', joined):
            if re.search(r'[a-z]', sentence):
                yield sentence


def main() -> int:
    """Print the figures."""
    checkout = Path(sys.argv[1]).resolve() if len(sys.argv) > 1 else CHECKOUT
    found = pages(checkout)
    print(f'{"page":44} words  marks/1,000  sentence  over {LONG}  passive')
    every = Page(
        'all',
        sum(page.words for page in found),
        sum(page.marks for page in found),
        tuple(each for page in found for each in page.sentences),
        tuple(each for page in found for each in page.text),
    )
    for page in [*found, every]:
        marks = 1000 * page.marks / max(1, page.words)
        print(
            f'{page.name:44} {page.words:5}  {marks:11.1f}  {page.mean:8.1f}  {page.long:6.1%}'
            f'  {page.passive:6.1%}'
        )
    return 0


if __name__ == '__main__':
    sys.exit(main())
