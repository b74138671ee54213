from __future__ import annotations

import pytest

from launcher.environment import INTERFACES, SetUpJournal, complete, requirements

PROJECT = """
[project]
dependencies = ["one==1"]
[project.optional-dependencies]
test = ["two"]
lint = ["three"]
"""


@pytest.fixture
def checkout(tmp_path):
    (tmp_path / 'pyproject.toml').write_text(PROJECT)
    (tmp_path / INTERFACES / 'msg').mkdir(parents=True)
    (tmp_path / INTERFACES / 'msg' / 'A.msg').write_text('int32 a\n')
    return tmp_path


def test_requirements_are_the_projects_with_those_of_the_extras(checkout):
    assert requirements(checkout, ['test']) == ['one==1', 'two']
    assert requirements(checkout, ['lint', 'test']) == ['one==1', 'three', 'two']


def test_a_change_of_an_interface_shows(checkout):
    before = complete(checkout, ['test'])
    (checkout / INTERFACES / 'msg' / 'A.msg').write_text('int64 a\n')
    after = complete(checkout, ['test'])
    assert after.interfaces != before.interfaces
    assert after.packages == before.packages


def test_a_renamed_interface_shows(checkout):
    before = complete(checkout, ['test'])
    (checkout / INTERFACES / 'msg' / 'A.msg').rename(checkout / INTERFACES / 'msg' / 'B.msg')
    assert complete(checkout, ['test']).interfaces != before.interfaces


def test_a_change_of_a_dependency_shows_and_one_elsewhere_does_not(checkout):
    before = complete(checkout, ['test'])
    file = checkout / 'pyproject.toml'
    file.write_text(file.read_text() + '[tool.x]\ny = 1\n')
    assert complete(checkout, ['test']) == before
    file.write_text(file.read_text().replace('one==1', 'one==2'))
    assert complete(checkout, ['test']).packages != before.packages


def test_what_a_build_leaves_behind_does_not_show(checkout):
    before = complete(checkout, ['test'])
    (checkout / INTERFACES / 'build').mkdir()
    (checkout / INTERFACES / 'build' / 'made').write_text('x')
    assert complete(checkout, ['test']) == before


def test_a_journal_is_kept_and_complete_only_when_nothing_is_under_way(tmp_path, checkout):
    journal = complete(checkout, ['test'])
    journal.write(tmp_path)
    assert SetUpJournal.read(tmp_path) == journal
    journal.working = 'packages'
    assert journal != complete(checkout, ['test'])


@pytest.mark.parametrize('content', ['', '{', '[]', '{"unknown": 1}', '\x00'])
def test_a_broken_journal_counts_as_none(content, tmp_path):
    SetUpJournal('x').write(tmp_path)
    next(tmp_path.iterdir()).write_text(content)
    assert SetUpJournal.read(tmp_path) == SetUpJournal()
