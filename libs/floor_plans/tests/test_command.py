"""The command of an import: its words, and what it says of wrong ones."""

from __future__ import annotations

import argparse
import subprocess
import sys

import pytest

from floor_plans.imports.command import main


def test_it_is_there_without_a_robot() -> None:
    done = subprocess.run(
        [sys.executable, '-m', 'floor_plans.imports', 'nowhere.yaml'],
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == 2
    assert done.stderr == 'import: nowhere.yaml: No such file or directory\n'


def test_another_program_gives_it_its_parser(capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(SystemExit) as ended:
        main(['map.yaml', '--robot-radius', '9'], argparse.ArgumentParser(prog='patrol import'))
    assert ended.value.code == 2
    assert 'patrol import: error: --robot-radius 9: expected 0.01 to 5' in capsys.readouterr().err
