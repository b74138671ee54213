"""Who may do what on the page: roles, links that can be taken back, and what is kept of them."""

from __future__ import annotations

from pathlib import Path

import pytest

from surveillance_operator.page.access import Links, PageUser, least_role


def test_the_file_has_no_token_and_is_its_owners_alone(tmp_path: Path) -> None:
    path = tmp_path / 'links.json'
    links = Links(path)
    token = links.make('Anna', 'guard')
    assert token not in path.read_text()
    assert path.stat().st_mode & 0o777 == 0o600
    other = Links(path)
    assert other.person(token) == PageUser('Anna', 'guard')
    other.revoke('Anna')
    assert links.person(token) is None
    path.write_text('[{"name": 1}]')
    assert links.person(token) is None


@pytest.mark.parametrize(
    ('name', 'role', 'expected'),
    [('', 'guard', 'a name'), ('operator', 'guard', 'a name'), ('Anna', 'gard', "'guard'")],
)
def test_a_link_that_cannot_be_made_says_why(name: str, role: str, expected: str) -> None:
    with pytest.raises(ValueError, match=expected):
        Links().make(name, role)


def test_a_guard_stops_one_robot_or_all_and_lets_none_go_on() -> None:
    assert least_role('fleet', {'word': 'stop'}) == least_role('stop', {}) == 'guard'
    assert least_role('fleet', {'word': 'go'}) == least_role('machine', {}) == 'operator'


def test_a_damaged_file_lets_nobody_in_and_is_kept_when_another_is_written(tmp_path: Path) -> None:
    path = tmp_path / 'links.json'
    token = Links(path).make('Anna', 'guard')
    whole = path.read_text()
    path.write_text(whole[:-20])
    links = Links(path)
    assert links.person(token) is None
    new = links.make('Bert', 'viewer')
    assert links.person(new) is not None
    assert (tmp_path / 'links.json.unread').read_text() == whole[:-20]
