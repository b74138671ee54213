"""The command `fleet`."""

from __future__ import annotations

import pytest

from surveillance_operator import fleet_command


@pytest.mark.parametrize('name', ['rob ot', '', 'röbot', 'a' * 61, 'simulator', 'a/b'])
def test_the_command_fleet_says_in_one_line_that_a_name_is_none(
    name: str, capsys: pytest.CaptureFixture[str]
) -> None:
    with pytest.raises(SystemExit) as ended:
        fleet_command.main(['stop', name])
    assert ended.value.code == 2
    assert 'expected' in capsys.readouterr().err
