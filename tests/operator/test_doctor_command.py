"""The command `doctor`."""

from __future__ import annotations

from pathlib import Path

import pytest

from strict_files.files import FileError
from surveillance_operator.doctor_command import _amend, main
from surveillance_runtime.profile import check_base, read_profile
from surveillance_runtime.profile.truth_check import RobotDoubt


@pytest.mark.parametrize(
    ('arguments', 'wrong'),
    [
        (['--seconds', '0'], '--seconds 0: expected 0.5 to 3600'),
        (['--robot', 'turtlebt4'], 'turtlebot4'),
    ],
)
def test_a_wrong_option_is_one_line(
    arguments: list[str], wrong: str, capsys: pytest.CaptureFixture[str]
) -> None:
    with pytest.raises(SystemExit) as ended:
        main(arguments)
    assert ended.value.code == 2
    assert wrong in capsys.readouterr().err


def test_the_measured_time_out_is_written_into_the_profile(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    path = tmp_path / 'robot.yaml'
    path.write_text('name: mine\ndrive: {speed: 0.3}\n')
    doubt = RobotDoubt('cmd_vel: stands 0.3 s after silence', 'drive.command_timeout', '0.3')
    _amend(path, [doubt], writes=False)
    assert '--write writes it' in capsys.readouterr().out
    with pytest.raises(FileError, match='command_timeout is missing'):
        check_base(read_profile(path), 'ROBOT')
    _amend(path, [doubt], writes=True)
    check_base(read_profile(path), 'ROBOT')
    assert read_profile(path).profile.drive.command_timeout == 0.3
    assert read_profile(path).profile.drive.speed == 0.3
