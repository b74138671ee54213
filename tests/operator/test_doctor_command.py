"""The command `doctor`."""

from __future__ import annotations

import pytest

from surveillance_operator.doctor_command import main


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
