"""The documentation's words, links, commands and examples: what a reader relies on."""

from __future__ import annotations

import ast
import doctest
import importlib
import importlib.util
import re
import subprocess
import sys
from pathlib import Path
from types import ModuleType
from typing import Any

import pytest
import yaml

from indoor_watch.watch_rules import read_watch_file
from patrol_policy.hours import WeeklyHours
from surveillance_operator.notify.sinks import read_notify_file

ROOT = Path(__file__).parents[1]


def module_of(path: Path) -> ModuleType:
    """Import a script of `.ci`."""
    spec = importlib.util.spec_from_file_location(path.stem, path)
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    sys.modules[path.stem] = module
    spec.loader.exec_module(module)
    return module


words = module_of(ROOT / '.ci' / 'words.py')
PAGES = words.pages(ROOT)
NAMES = [page.name for page in PAGES]
FILES = sorted(
    [*ROOT.glob('docs/**/*.md'), ROOT / 'README.md', ROOT / 'CONTRIBUTING.md', ROOT / 'SECURITY.md']
)
DONE = [path for path in FILES if {'how-to', 'tutorial'} & set(path.parts)]
"""Pages that a reader types from."""


def blocks(path: Path, *languages: str) -> list[str]:
    """Return the code blocks of a page in one of some languages."""
    text = path.read_text(encoding='utf-8')
    found = re.findall(r'^[ \t]*```(\w*)[^\n]*\n(.*?)^[ \t]*```', text, re.MULTILINE | re.DOTALL)
    return [code for language, code in found if language in languages]


@pytest.mark.parametrize('page', PAGES, ids=NAMES)
def test_sentences_are_short(page: Any) -> None:
    assert page.mean <= 15.0, f'{page.mean:.1f} words on average'
    long = [each for each in page.text if len(each.split()) > words.LONG]
    assert page.long < 0.03, long


@pytest.mark.parametrize('page', PAGES, ids=NAMES)
def test_words_are_the_fields(page: Any) -> None:
    found = [
        (word, words.BANNED[word], each)
        for each in page.text
        for word in words.BANNED
        if re.search(rf'\b{word}\b', each, re.IGNORECASE)
    ]
    assert not found


def test_most_sentences_are_active() -> None:
    every = [each for page in PAGES for each in page.text]
    assert sum(bool(words.PASSIVE.search(each)) for each in every) < 0.12 * len(every)
    passive = {page.name: page.passive for page in PAGES if len(page.text) >= 10}
    assert not {name: part for name, part in passive.items() if part > 0.25}


def test_the_whole_is_short_and_has_code() -> None:
    read = [page for page in PAGES if not page.name.endswith('measurements.md')]
    total = sum(page.words for page in read)
    assert total <= 29_500
    assert 1000 * sum(page.marks for page in read) / total >= 20


@pytest.mark.parametrize('path', [p for p in DONE if 'how-to' in p.parts], ids=lambda p: p.stem)
def test_a_how_to_is_short(path: Path) -> None:
    assert words.read(path, ROOT).words <= words.LONGEST_HOW_TO


def anchors(path: Path) -> set[str]:
    """Return the anchors of a page, as GitHub and MkDocs make them of its headings."""
    text = re.sub(r'```.*?```', '', path.read_text(encoding='utf-8'), flags=re.DOTALL)
    heads = re.findall(r'^#+ (.*)$', text, re.MULTILINE)
    plain = (re.sub(r'[^\w\- ]', '', head.replace('`', '').lower()) for head in heads)
    return {head.strip().replace(' ', '-') for head in plain}


@pytest.mark.parametrize('path', FILES, ids=lambda p: str(p.relative_to(ROOT)))
def test_links_lead_somewhere_and_pictures_have_words(path: Path) -> None:
    text = re.sub(r'```.*?```', '', path.read_text(encoding='utf-8'), flags=re.DOTALL)
    for bang, label, target in re.findall(r'(!?)\[([^\]]*)\]\(([^)\s]+)\)', text):
        assert label.strip(), target
        assert not bang or len(label.split()) > 2, f'{target}: no words for who does not see it'
        name, _, anchor = target.partition('#')
        if re.match(r'[a-z]+:', name):
            continue
        there = (path.parent / name).resolve() if name else path
        assert there.exists(), target
        assert not anchor or anchor in anchors(there), target


@pytest.mark.parametrize('path', DONE, ids=lambda p: p.stem)
def test_python_reads_and_imports_what_is_there(path: Path) -> None:
    for code in blocks(path, 'python'):
        flags = ast.PyCF_ALLOW_TOP_LEVEL_AWAIT
        tree = compile(code, str(path), 'exec', flags | ast.PyCF_ONLY_AST)
        if path.stem in ('from_smach', 'from_yasmin'):
            continue  # programs of other libraries, before they are moved; the others are run
        for node in ast.walk(tree):
            if isinstance(node, ast.ImportFrom) and node.module not in ('nearest',):
                there = importlib.import_module(node.module or '')
                for each in node.names:
                    if not hasattr(there, each.name):
                        importlib.import_module(f'{node.module}.{each.name}')


def test_files_of_rules_and_sinks_are_read(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv('OFFICE_TOKEN', 'x')
    (tmp_path / 'mail').write_text('secret')
    (tmp_path / 'boss').write_text('https://example.org/boss')
    count = 0
    for path in FILES:
        for code in blocks(path, 'yaml'):
            table = yaml.safe_load(code)
            file = tmp_path / 'file.yaml'
            there = code.replace('/etc/patrol', str(tmp_path))
            file.write_text(there.replace('/usr/local/bin/blink', '/bin/true'), encoding='utf-8')
            if 'rules' in table:
                assert read_watch_file(file)
            elif 'sinks' in table:
                assert read_notify_file(file)
            elif 'hours' in table:
                assert all(WeeklyHours.parse(each) for each in table['hours'].values())
            else:
                continue
            count += 1
    assert count >= 6


@pytest.mark.parametrize(
    ('page', 'says'),
    [
        ('how-to/write_a_policy', 'nearest  longest idleness'),
        ('tutorial/for_owlready2_users', 'Passage'),
        ('tutorial/for_researchers', ''),
    ],
)
def test_the_scripts_of_a_page_run(page: str, says: str, tmp_path: Path) -> None:
    said = ''
    for code in blocks(ROOT / 'docs' / f'{page}.md', 'python'):
        name = re.match(r'# (\S+\.py)\n', code)
        if name is None:
            continue
        (tmp_path / name[1]).write_text(code, encoding='utf-8')
        done = subprocess.run(
            [sys.executable, name[1]], cwd=tmp_path, capture_output=True, text=True, check=False
        )
        assert done.returncode == 0, done.stderr
        said += done.stdout
    assert says in said


SHOWN = [path for path in FILES if blocks(path, 'pycon')]
"""Pages whose examples show what they print."""


@pytest.mark.parametrize('path', SHOWN, ids=lambda p: f'{p.parent.name}/{p.stem}')
def test_an_example_prints_what_its_page_says(
    path: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    flags = doctest.NORMALIZE_WHITESPACE | doctest.ELLIPSIS
    example = doctest.DocTestParser().get_doctest(
        '\n'.join(blocks(path, 'pycon')), {'__name__': '__main__'}, path.stem, str(path), 0
    )
    said: list[str] = []
    doctest.DocTestRunner(optionflags=flags, verbose=False).run(example, out=said.append)
    assert not said, ''.join(said)
