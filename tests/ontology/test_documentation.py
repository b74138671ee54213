"""The manual says what the table of directives says."""

from __future__ import annotations

import importlib.util
import re
from pathlib import Path

from armor_service.access import Settings

DOCS = Path(__file__).parents[2] / 'docs'
MANUAL = (DOCS / 'reference' / 'directives.md').read_text(encoding='utf-8')


def test_the_directives_are_those_of_the_table() -> None:
    path = DOCS / 'makers' / 'armor_directives.py'
    spec = importlib.util.spec_from_file_location('armor_directives', path)
    assert spec is not None
    assert spec.loader is not None
    script = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(script)
    assert script.updated(MANUAL) == MANUAL, 'run docs/makers/armor_directives.py'


def test_bounds_are_those_of_the_settings() -> None:
    numbers = set(re.findall(r'[\d,]+', MANUAL))
    default = Settings()
    assert f'{default.max_arguments:,}' in numbers
    assert f'{default.max_batch:,}' in numbers
    assert f'{default.sparql_rows:,}' in numbers
    assert f'{default.max_file_bytes >> 20}' in numbers
    assert f'{default.max_characters >> 20}' in numbers
