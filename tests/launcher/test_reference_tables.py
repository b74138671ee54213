"""The schema and the pages of reference say what the nodes declare and offer."""

from __future__ import annotations

import json
import re
import socket
import subprocess
import sys
from contextlib import suppress

import pytest
import rclpy

from launcher.reference_tables import parameters_page, survey
from surveillance_runtime.configuration import SCHEMA, read_schema
from surveillance_runtime.discovery import LAST_DOMAIN
from tests.launcher.conftest import ROOT

pytestmark = pytest.mark.early


COMMANDS = """
import json
from launcher.package_commands import HELP
from launcher.reference_tables import cli_page
print(cli_page(json.loads(HELP.read_text())))
"""

SURVEY = """
import json, sys
from launcher.reference_tables import interfaces_page, survey
found = survey()
print(json.dumps([found.parameters, interfaces_page(found)]), file=open(sys.argv[1], 'w'))
"""


def test_schema_and_interfaces_are_those_of_the_nodes(tmp_path):
    path = tmp_path / 'now.json'
    words = [sys.executable, '-c', SURVEY, str(path)]
    done = subprocess.run(words, cwd=ROOT, check=True, capture_output=True, text=True)
    assert (done.stdout, done.stderr) == ('', '')
    parameters, page = json.loads(path.read_text())
    hint = 'write them anew: python3 launch.py params --write'
    assert parameters == json.loads(SCHEMA.read_text()), hint
    assert page == (ROOT / 'docs' / 'reference' / 'interfaces.md').read_text(), hint


def test_nodes_are_made_where_no_claimed_domain_hears_them(monkeypatch):
    class BegunError(Exception):
        pass

    def begin(*, context, domain_id):
        used.append(domain_id)
        raise BegunError

    used = []
    monkeypatch.setattr(rclpy, 'init', begin)
    with socket.socket(socket.AF_UNIX) as claim:
        with suppress(OSError):
            # Either this claim holds, or somebody else's does.
            claim.bind(f'\0surveillance-domain-{LAST_DOMAIN}')
        with pytest.raises(BegunError):
            survey()
    assert used != [LAST_DOMAIN]


def test_the_page_of_parameters_is_written_from_the_schema():
    page = (ROOT / 'docs' / 'reference' / 'parameters.md').read_text()
    assert page == parameters_page(read_schema())


def test_params_prints_each_value_with_its_source():
    words = ['launch.py', 'params', 'battery_controller', '--mode', 'RANDOM']
    words += ['-p', 'battery_initial_value:=50']
    done = subprocess.run(
        [sys.executable, *words], cwd=ROOT, check=True, capture_output=True, text=True, timeout=60
    )
    lines = {line.split()[0]: line for line in done.stdout.splitlines()}
    assert lines['battery_initial_value'].endswith('50  (-p battery_initial_value:=50)')
    assert lines['execution_mode'].endswith('"RANDOM"  (--mode RANDOM)')
    assert 'config/parameters.yaml:' in lines['random_battery_time']
    assert lines['console'].rstrip().endswith(')')


def test_the_page_of_commands_is_what_they_say():
    def said(text):
        # From Python 3.13 on `-o PNG, --output PNG` is `-o, --output PNG`.
        return re.sub(r'(-\w) [A-Z]+, --', r'\1, --', text).split()

    words = [sys.executable, '-c', COMMANDS]
    done = subprocess.run(words, cwd=ROOT, check=True, capture_output=True, text=True)
    page = (ROOT / 'docs' / 'reference' / 'cli.md').read_text()
    hint = 'write it anew: python3 launch.py params --write'
    assert said(done.stdout) == said(page), hint
