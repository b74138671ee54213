"""The launch file for an installed ROS starts what `launch.py` starts."""

from __future__ import annotations

import ast

import pytest

from launcher.node_table import BEHAVIOURS, DEFAULT_MODE, MODES, select
from launcher.run import PLACES
from tests.launcher.conftest import ROOT

SOURCE = ROOT / 'surveillance_behaviour' / 'launch' / 'surveillance.launch.py'


@pytest.fixture(scope='module')
def tree() -> ast.Module:
    return ast.parse(SOURCE.read_text())


@pytest.fixture(scope='module')
def constants(tree) -> dict[str, object]:
    found = {}
    for statement in tree.body:
        if isinstance(statement, ast.Assign) and isinstance(statement.targets[0], ast.Name):
            try:
                found[statement.targets[0].id] = ast.literal_eval(statement.value)
            except ValueError:
                continue
    return found


@pytest.mark.parametrize('behaviour', BEHAVIOURS)
@pytest.mark.parametrize('mode', MODES)
def test_it_starts_the_same_nodes(constants, mode, behaviour):
    parts = [constants['ALWAYS']]
    if behaviour == 'patrol':
        parts.append(constants['PATROL'])
    if behaviour == 'patrol' or mode == 'SIMULATED':
        parts.append(constants['SIMULATION'])
    listed = {(package, name) for part in parts for package in part for name in part[package]}
    assert listed == {(node.package, node.name) for node in select(mode, behaviour)}


def test_it_knows_the_same_places(constants):
    assert constants['PLACES'] == PLACES


def test_its_arguments_have_the_same_values_and_defaults(tree):
    arguments = {}
    for call in ast.walk(tree):
        if isinstance(call, ast.Call) and getattr(call.func, 'id', '') == 'DeclareLaunchArgument':
            name = ast.literal_eval(call.args[0])
            arguments[name] = {k.arg: ast.literal_eval(k.value) for k in call.keywords}
    assert arguments['mode']['default_value'] == DEFAULT_MODE
    assert set(arguments['mode']['choices']) == set(MODES)
    assert set(arguments['behaviour']['choices']) == set(BEHAVIOURS)
    assert all(argument['description'] for argument in arguments.values())


def test_it_is_installed_with_the_parameter_files():
    setup = (ROOT / 'surveillance_behaviour' / 'setup.py').read_text()
    assert "glob('launch/*.launch.py')" in setup
    assert "glob('../config/*.yaml')" in setup
