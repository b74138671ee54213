"""What a person types takes effect in the node, or costs one line."""

from __future__ import annotations

import subprocess
import sys

import pytest

from tests.launcher.conftest import ROOT

pytestmark = pytest.mark.early


def test_each_value_of_a_command_line_takes_effect_or_costs_one_line():
    words = [sys.executable, 'benchmarks/command_lines.py', '--count', '60', '--seed', '11']
    done = subprocess.run(words, cwd=ROOT, capture_output=True, text=True)
    assert done.returncode == 0, done.stdout
    assert 'took effect' in done.stdout
    assert 'one line' in done.stdout
