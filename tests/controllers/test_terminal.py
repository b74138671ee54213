"""The operator's terminal: the words that it proposes, and how a charge is shown."""

from __future__ import annotations

import io

from prompt_toolkit.completion import CompleteEvent
from prompt_toolkit.document import Document

from surveillance_controllers.manual.terminal import WordCompleter, charge_display


def test_a_word_is_completed_from_where_it_begins() -> None:
    asked: list[str] = []

    def words(text: str) -> list[str]:
        asked.append(text)
        return ['open', 'close']

    completer = WordCompleter(words)
    for text, typed in (('door o', 1), ('door ', 0), ('', 0)):
        found = list(completer.get_completions(Document(text), CompleteEvent()))
        assert [(each.text, each.start_position) for each in found] == [
            ('open', -typed),
            ('close', -typed),
        ]
    assert asked == ['door o', 'door ', '']


def test_a_charge_without_a_terminal_is_a_line_every_ten_percent() -> None:
    lines: list[str] = []
    with charge_display(37.0, lines.append, io.StringIO()) as show:
        for percent in (38.0, 41.0, 45.0, 70.0, 69.0):
            show(percent)
    assert lines == ['Charging: 30 %', 'Charging: 40 %', 'Charging: 70 %']
