"""What a client may write and read: nothing of a peer's choice reaches code, devices or logs."""

from __future__ import annotations

import os
import resource
from pathlib import Path

import pytest

from armor_service.access import CODE, Settings, state_folder
from armor_service.service import ArmorService

from .seven_rooms import FIXTURES, IRI, ONTOLOGY, Ask, asker

PAYLOAD = 'x\nimport os; os.system("id")\n'


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    """Provide the ontologies folder of the run, in a folder that stands for a checkout."""
    return tmp_path / 'run' / 'ontologies'


@pytest.fixture
def ask(folder: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Ask:
    """Provide a client of a service with the default settings, started in a checkout."""
    monkeypatch.chdir(tmp_path)
    service = ArmorService(
        Settings(folder, read_only_directories=(FIXTURES,)),
        screen=lambda _: None,
        warn=lambda _: None,
    )
    send = asker(service)
    assert send('LOAD FILE', ONTOLOGY, IRI, 'false', 'PELLET', 'false').success
    return send


@pytest.mark.parametrize(
    'path',
    [
        '{checkout}/site-packages/x.pth',
        '{checkout}/launch.py',
        '{checkout}/config.owl',
        '../launch.owl',
        '{folder}/x.pth',
        '{folder}/x.py',
        '{folder}/x.owl.sh',
        '{folder}/.x.owl',
        '{folder}/.git/x.owl',
        '{folder}/x',
        '~/x.owl',
    ],
)
@pytest.mark.parametrize('words', ['SAVE', 'SAVE INFERENCE', 'LOG FILE ON'])
def test_nothing_is_written_but_ontologies_and_logs_below_the_folder(
    ask: Ask, folder: Path, tmp_path: Path, words: str, path: str
) -> None:
    folder.mkdir(parents=True)
    (folder / '.git').mkdir()
    (tmp_path / 'site-packages').mkdir()
    before = sorted(tmp_path.rglob('*'))
    answer = ask(words, path.format(checkout=tmp_path, folder=folder))
    assert (answer.success, answer.exit_code) == (False, 205)
    assert 'may not be written' in answer.error_description
    assert sorted(tmp_path.rglob('*')) == before


def test_logs_and_ontologies_do_not_take_each_others_endings(ask: Ask) -> None:
    assert ask('SAVE', 'map.log').exit_code == 205
    assert ask('LOG FILE ON', 'log.owl').exit_code == 205
    assert ask('SAVE', 'map.owl').success, 'the folder is made when it is needed'
    assert ask('LOG FILE ON', 'armor.log').success


def test_no_link_leads_out_of_the_folder(ask: Ask, folder: Path, tmp_path: Path) -> None:
    folder.mkdir(parents=True)
    outside = tmp_path / 'launch.owl'
    outside.write_text('code')
    (folder / 'file.owl').symlink_to(outside)
    (folder / 'dir').symlink_to(tmp_path)
    for path in ('file.owl', 'dir/launch.owl', 'dir/new.owl'):
        assert 'may not be written' in ask('SAVE', path).error_description
    assert outside.read_text() == 'code'
    assert not (tmp_path / 'new.owl').exists()


@pytest.mark.parametrize('leads', ['by its file IRI', 'by a link'])
def test_no_import_leads_out_of_the_folders(
    ask: Ask, folder: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, leads: str
) -> None:
    away = tmp_path / 'run' / 'away'
    away.mkdir(parents=True)
    secret = away / 'secret.ofn'
    secret.write_text('Ontology(<http://x/secret> ClassAssertion(<http://x#S> <http://x#hidden>))')
    folder.mkdir(parents=True)
    (folder / 'secret.ofn').symlink_to(secret)
    monkeypatch.chdir(away)
    service = ArmorService(
        Settings(folder, (str(folder),)), screen=lambda _: None, warn=lambda _: None
    )
    send = asker(service)
    name = secret.as_uri() if leads == 'by its file IRI' else 'http://x/secret'
    text = f'Ontology(<http://x> Import(<{name}>) ClassAssertion(<http://x#C> <http://x#i>))'
    (folder / 'main.ofn').write_text(text)
    answer = send('LOAD FILE', 'main.ofn', 'http://x', 'false', 'PELLET', 'false')
    assert answer.success
    assert f'owl:imports <{name}> is not followed' in answer.error_description
    assert 'secret.ofn may not be read' in answer.error_description
    assert send('QUERY IND', 'hidden').queried_objects == []


def test_a_line_of_the_log_is_one_line_whatever_the_client_sends(ask: Ask, folder: Path) -> None:
    assert ask('LOG FILE ON', 'armor.log').success
    for words, args in (
        ('QUERY IND', (PAYLOAD,)),
        ('ADD DATAPROP IND', ('p', 'R1', 'STRING', PAYLOAD)),
        ('QUERY DATAPROP IND', ('p', 'R1')),
        ('QUERY SPARQL', (PAYLOAD + '\x1b[2J',)),
        ('GET REF CLIENT', (PAYLOAD,)),
        (f'{PAYLOAD.replace(" ", chr(9))}', ()),
    ):
        ask(words, *args, client=PAYLOAD)
    ask('GET ALL REFS', reference=PAYLOAD)
    lines = (folder / 'armor.log').read_text().split('\n')
    assert len(lines) == 9
    assert all(line.isprintable() for line in lines)
    assert all(line[:2] == '20' for line in lines[:-1])


def test_warnings_and_descriptions_hold_no_control_characters(tmp_path: Path) -> None:
    said: list[str] = []
    service = ArmorService(Settings(tmp_path), screen=said.append, warn=said.append)
    ask = asker(service)
    (tmp_path / 'x.owl').write_text('<a>\x1b[2J')
    asked = ask('LOAD FILE', 'x.owl', IRI, 'false', '\x1b[2J\nFAKE LINE', 'false')
    assert asked.error_description.isprintable()
    ask('LOAD FILE', ONTOLOGY, IRI, 'false', '\x1b[2J\nFAKE LINE', 'false')
    ask('LOG SCREEN ON')
    ask('MOUNT', client='\x1b]0;title\x07')
    assert said
    assert all(line.isprintable() for line in said)


def test_a_log_file_is_closed_before_it_fills_the_disk(tmp_path: Path) -> None:
    said: list[str] = []
    service = ArmorService(Settings(tmp_path, max_file_bytes=1000), screen=said.append)
    ask = asker(service)
    assert ask('LOG FILE ON', 'armor.log').success
    for _ in range(100):
        ask('GET ALL REFS')
    assert (tmp_path / 'armor.log').stat().st_size < 1300
    assert said == ['directive log: 1000 bytes are reached; the log file is closed']


def test_directives_are_answered_when_the_log_file_takes_no_more(tmp_path: Path) -> None:
    said: list[str] = []
    ask = asker(ArmorService(Settings(tmp_path), screen=said.append))
    assert ask('LOG FILE ON', 'armor.log').success
    before = resource.getrlimit(resource.RLIMIT_FSIZE)
    # A file at its size limit takes what fits, as a disk does that is almost full.
    resource.setrlimit(resource.RLIMIT_FSIZE, (170, before[1]))
    try:
        assert all(ask('GET ALL REFS').success for _ in range(9))
        assert ask('LOG FILE OFF').success
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, before)
    assert said == ['directive log: No space left on device; the log file is closed']


def test_devices_and_pipes_are_neither_read_nor_written(ask: Ask, folder: Path) -> None:
    folder.mkdir(parents=True)
    os.mkfifo(folder / 'pipe.owl')
    os.mkfifo(folder / 'pipe.log')
    loaded = ask('LOAD FILE', 'pipe.owl', IRI, '', '', '', reference='x')
    assert 'is not a file' in loaded.error_description
    assert 'a device or pipe' in ask('SAVE', 'pipe.owl').error_description
    assert 'a device or pipe' in ask('LOG FILE ON', 'pipe.log').error_description
    for device in ('/dev/zero', '/proc/self/mem'):
        assert ask('LOAD FILE', device, IRI, '', '', '', reference='x').exit_code == 205


def test_save_without_a_path_leaves_the_loaded_file_unless_that_is_allowed(tmp_path: Path) -> None:
    for allowed in (False, True):
        ask = asker(ArmorService(Settings(tmp_path, overwrite_loaded=allowed)))
        (tmp_path / 'map.owl').write_bytes(Path(ONTOLOGY).read_bytes())
        before = (tmp_path / 'map.owl').read_bytes()
        assert ask('LOAD FILE', 'map.owl', IRI, 'false', '', 'false').success
        ask('ADD IND CLASS', 'R9', 'ROOM')
        answer = ask('SAVE', '')
        assert answer.success == allowed
        assert allowed or 'overwrite_loaded' in answer.error_description
        assert (before != (tmp_path / 'map.owl').read_bytes()) == allowed


@pytest.mark.parametrize('folder', [CODE, CODE / 'data', CODE.parent, Path('/'), Path(os.__file__)])
def test_a_folder_of_code_is_refused(folder: Path) -> None:
    folder = folder.parent if folder.is_file() else folder
    with pytest.raises(ValueError, match=r'ontologies_folder: .* is a folder of code'):
        Settings(folder)


def test_the_default_is_the_users_state_folder(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv('XDG_STATE_HOME', '/some/where')
    assert state_folder() == Path('/some/where/surveillance')
    assert Settings().writable == Path('/some/where/surveillance/ontologies')
    monkeypatch.setenv('XDG_STATE_HOME', 'relative')
    assert state_folder() == Path.home() / '.local/state/surveillance'


def test_what_is_mounted_is_not_dropped_loaded_over_or_saved_by_others(
    ask: Ask, folder: Path
) -> None:
    assert ask('MOUNT', client='owner').success
    for words, args in (
        ('DROP', ()),
        ('SAVE', ('map.owl',)),
        ('SAVE INFERENCE', ('map.owl',)),
        ('LOAD FILE', (ONTOLOGY, IRI, 'true', '', 'false')),
    ):
        answer = ask(words, *args, client='other')
        assert (answer.success, answer.exit_code) == (False, 102), words
    same = ask('LOAD FILE', ONTOLOGY, IRI, 'false', '', 'false', client='other')
    assert same.success, 'a second LOAD that changes nothing is no offence'
    assert ask('GET ALL REFS').queried_objects == ['map']
    assert not folder.exists()
    for words, args in (('SAVE', ('map.owl',)), ('DROP', ())):
        assert ask(words, *args, client='owner').success
