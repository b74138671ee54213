"""The demonstration shows moves with their reasons, and follows its options."""

from __future__ import annotations

import pytest

from patrol_policy.demo import main


def test_the_demonstration_shows_each_move_with_its_reason(
    capsys: pytest.CaptureFixture[str],
) -> None:
    assert main(['--moves', '5']) == 0
    shown = capsys.readouterr().out
    assert 'places can be visited within their thresholds' in shown
    assert shown.count(' -> ') == 5
    assert 'after 5 moves the places have waited:' in shown


def test_the_rules_may_be_others(capsys: pytest.CaptureFixture[str]) -> None:
    more = ['--moves', '12', '--threshold', '15', '--policy', 'oldest']
    assert main(['--rules', 'LAB&URGENT', 'URGENT', *more]) == 0
    assert 'C2 -> R4 [LAB&URGENT]' in capsys.readouterr().out
    with pytest.raises(SystemExit):
        main(['--rules', '9 to 5'])
    assert "--rules: '9 to 5' is not the name of a class" in capsys.readouterr().err
