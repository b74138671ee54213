"""The schema and docs/parameters.md say what the nodes declare."""

from __future__ import annotations

import json
import subprocess
import sys

from launcher.parameter_tables import as_markdown
from surveillance_runtime.configuration import SCHEMA, read_schema
from tests.launcher.conftest import ROOT

COLLECT = (
    'import json, sys; from launcher.parameter_tables import collect; '
    'json.dump(collect(), open(sys.argv[1], "w"))'
)


def test_the_schema_is_what_the_nodes_declare(tmp_path):
    path = tmp_path / 'now.json'
    words = [sys.executable, '-c', COLLECT, str(path)]
    subprocess.run(words, cwd=ROOT, check=True, capture_output=True, timeout=100)
    hint = 'write it anew: python3 launch.py params --write'
    assert json.loads(path.read_text()) == json.loads(SCHEMA.read_text()), hint


def test_the_page_of_parameters_is_written_from_the_schema():
    assert (ROOT / 'docs' / 'parameters.md').read_text() == as_markdown(read_schema())


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
