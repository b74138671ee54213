#!/usr/bin/env python3
"""Write docs/reference/state_machines.md: what each name of the state machine engine takes.

    .venv/bin/python docs/makers/fsm_reference.py

It is made of the docstrings; a test holds that the page is current.
"""

from __future__ import annotations

import importlib
import inspect
import re
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Any

CHECKOUT = Path(__file__).resolve().parents[2]
sys.path.insert(0, str(CHECKOUT / 'libs' / 'state_machines'))

PAGE = CHECKOUT / 'docs' / 'reference' / 'state_machines.md'
MODULES = {
    'state_machines': None,
    'state_machines.execution': ['Control'],
    'state_machines.verify': ['verify', 'Finding'],
    'state_machines.export': [
        'to_ascii',
        'to_mermaid',
        'to_graphviz',
    ],
    'state_machines.transitions': ['Transition', 'TransitionFeed'],
    'state_machines.checkpoint': ['Checkpointer', 'save', 'load', 'capture', 'restore'],
    'state_machines.testing': ['FakeClock', 'script', 'watching', 'Watched'],
    'state_machines.ros': None,
}
"""The modules, and the names that are meant for users; None for all that the module exports."""


def page() -> str:
    """Return the page's text."""
    lines = [
        '# Reference of the state machine engine',
        '',
        'Written by docs/makers/fsm_reference.py from the docstrings. The ideas are in',
        '[State machines](../explanation/state_machines.md).',
    ]
    for module_name, chosen in MODULES.items():
        module = importlib.import_module(module_name)
        lines += ['', f'## `{module_name}`', '', inspect.getdoc(module) or '']
        for name in chosen if chosen is not None else sorted(module.__all__, key=str.lower):
            lines += ['', *_entry(name, getattr(module, name))]
    return re.sub(r'\n{3,}', '\n\n', '\n'.join(lines)) + '\n'


def _entry(name: str, thing: Any) -> Iterator[str]:
    """Yield what a name stands for."""
    if not callable(thing):
        yield f'### `{name}`'
        yield ''
        yield f'The constant `{thing!r}`.'
        return
    yield f'### `{name}{_signature(thing)}`'
    yield ''
    yield _shown(inspect.getdoc(thing) or '')
    if not inspect.isclass(thing):
        return
    methods = [f'- `{label}`: {text}' for label, text in _methods(thing)]
    if methods:
        yield ''
        yield from methods


def _methods(kind: type) -> Iterator[tuple[str, str]]:
    """Yield the public methods and properties that a class has itself, and what each does."""
    for label, member in vars(kind).items():
        if label.startswith(('_', 'fsm_')):
            continue
        if isinstance(member, property):
            yield label, _first_line(member.fget)
            continue
        function = getattr(member, '__func__', member)
        if inspect.isfunction(function):
            yield label + _signature(function), _first_line(function)


def _signature(thing: Any) -> str:
    """Return the names and defaults of arguments; types are in the text."""
    try:
        signature = inspect.signature(thing)
    except (TypeError, ValueError):
        return ''
    plain = [
        parameter.replace(annotation=inspect.Parameter.empty)
        for parameter in signature.parameters.values()
        if parameter.name != 'self'
    ]
    text = str(signature.replace(parameters=plain, return_annotation=inspect.Signature.empty))
    # An object's address is another one in each process.
    return re.sub(r'<([\w.]+) (?:<\w+>|[^<>])* at 0x[0-9a-f]+>', r'<\1>', text)


def _first_line(function: Any) -> str:
    return (inspect.getdoc(function) or '').split('\n\n')[0].replace('\n', ' ')


def _shown(text: str) -> str:
    """Return a docstring as Markdown: its sections as lists."""
    lines, section = [], False
    for line in text.splitlines():
        if re.fullmatch(r'(Args|Returns|Raises|Attributes):', line):
            section = True
            lines += ['', f'**{line[:-1]}**', '']
        elif section and line.startswith('    ') and not line.startswith('     '):
            lines.append(f'- {line.strip()}')
        elif section and line.startswith('     '):
            lines.append(f'  {line.strip()}')
        else:
            section = section and not line.strip()
            lines.append(line)
    return '\n'.join(lines)


if __name__ == '__main__':
    PAGE.write_text(page(), encoding='utf-8')
    print(f'{PAGE}: {len(page().splitlines())} lines')
