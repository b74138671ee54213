"""The commands that belong to packages, and their help."""

from __future__ import annotations

import json
import re
import shutil
import subprocess
import sys

import pytest

from launcher.package_commands import HELP, all_helps
from tests.launcher.conftest import ROOT

pytestmark = pytest.mark.early


def test_the_helps_of_the_packages_commands_are_theirs():
    def said(helps):
        # From Python 3.13 on `-o PNG, --output PNG` is `-o, --output PNG`.
        texts = {name: re.sub(r'(-\w) [A-Z]+, --', r'\1, --', text) for name, text in helps.items()}
        return {name: text.split() for name, text in texts.items()}

    hint = 'write them anew: python3 launch.py params --write'
    assert said(json.loads(HELP.read_text())) == said(all_helps()), hint


def test_every_help_is_said_soon_and_needs_no_set_up(tmp_path):
    # A copy without an environment, and without the packages that need one.
    for part in ('launcher', 'surveillance_runtime', 'libs/strict_files'):
        shutil.copytree(ROOT / part, tmp_path / part)
    shutil.copyfile(ROOT / 'launch.py', tmp_path / 'launch.py')
    for command in ('', 'run', 'node', 'list', 'params', 'service', 'setup', 'test', 'lint', 'map'):
        words = [sys.executable, '-S', 'launch.py', *command.split(), '--help']
        done = subprocess.run(words, cwd=tmp_path, capture_output=True, text=True, timeout=60.0)
        assert (done.returncode, done.stderr) == (0, '')
        assert 'usage:' in done.stdout
    assert not (tmp_path / '.venv').exists()
