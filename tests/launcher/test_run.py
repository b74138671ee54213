from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import pytest

from launcher.cli import CONFIG
from launcher.run import (
    ALARM,
    MARKERS,
    PAGE,
    RECORDER,
    Run,
    make_parser,
    wanted_run,
)
from surveillance_runtime.command_line import page_address
from tests.launcher.runs import error_of


@pytest.mark.parametrize('namespace', ['', '1robot', 'a b', 'a//b', '/a/', '../x', 'ä'])
def test_a_namespace_that_ros_refuses_is_named(namespace):
    assert f'--namespace {namespace!r}' in error_of(Run(namespace=namespace))


@pytest.mark.parametrize('domain', [-1, 102, 10**6])
def test_a_domain_out_of_range_is_named(domain):
    assert error_of(Run(domain=domain)) == f'--domain {domain}: expected a number from 0 to 101'


@pytest.mark.parametrize(
    'address', ['', ':', '80', '[::1', '[::1:80', '::1:80', 'a:b', 'a@b:80', 'a/b:1', 'a:99999']
)
def test_an_address_of_the_page_that_is_none_is_named(address):
    expected = f'--web-address {address!r}: expected HOST:PORT like 0.0.0.0:8080'
    assert error_of(Run(web_address=address)) == expected


def test_addresses_of_the_page():
    assert page_address('0.0.0.0:8080') == ('0.0.0.0', 8080)
    assert page_address('[::1]:80') == ('::1', 80)
    assert page_address(':80') == ('127.0.0.1', 80)


@pytest.mark.parametrize('alarm', ["call '", 'no-such-program', '/etc/passwd now'])
def test_an_alarm_that_cannot_be_raised_is_named(alarm):
    assert error_of(Run(alarm=alarm)).startswith(f'--alarm {alarm!r}: ')


def test_a_place_that_is_none_is_named_with_file_and_line(tmp_path):
    assert 'no.yaml: No such file' in error_of(Run(place=tmp_path / 'no.yaml'))
    bad = tmp_path / 'bad.yaml'
    text = (CONFIG / 'seven_rooms.yaml').read_text()
    bad.write_text(text.replace('R4: [D4]', 'R4: [D9]'))
    assert 'bad.yaml:' in error_of(Run(place=bad))
    assert 'D9' in error_of(Run(place=bad))


def test_the_options_of_the_command_line_become_a_run():
    options = make_parser().parse_args(
        ['--mode', 'random', '--map', 'm.yaml', '--params', 'p.yaml', '--only', 'a,b', '--for', '3']
    )
    assert wanted_run(options) == Run(
        mode='RANDOM',
        place=Path('m.yaml'),
        parameters=Path('p.yaml'),
        remaps=[],
        only=['a', 'b'],
        without=[],
        assignments=[],
        seconds=3.0,
        record=None,
    )


def test_only_starts_what_is_named_and_may_be_repeated():
    options = make_parser().parse_args(['--only', 'planner_controller', '--only', 'armor_server'])
    run = wanted_run(options)
    assert {node.name for node in run.nodes()} == {'planner_controller', 'armor_server'}
    assert run.observers() == ()
    assert [node.name for node in Run(record=None).observers()] == [ALARM, RECORDER, MARKERS]
    assert [node.name for node in replace(run, web=True).observers()] == [PAGE]
    assert [node.name for node in replace(run, web_address=':80').observers()] == [PAGE]


def test_an_address_behind_a_switch_names_the_option_that_takes_it(capsys):
    with pytest.raises(SystemExit):
        make_parser().parse_args(['--web', '0.0.0.0:8080'])
    assert '--web takes no value, expected --web-address 0.0.0.0:8080' in capsys.readouterr().err
