"""References: loading, mounting, saving, logging."""

from __future__ import annotations

import errno
import gc
import queue
import threading
from collections.abc import Callable
from functools import partial
from http.server import SimpleHTTPRequestHandler, ThreadingHTTPServer
from pathlib import Path
from typing import Any

import pytest

from armor_service.access import SafePaths, Settings
from armor_service.protocol import DirectiveRequest
from armor_service.service import ArmorService
from owl_reasoner.documents import reading, writing
from owl_reasoner.owl.axioms import Axiom

from .seven_rooms import FIXTURES, IRI, ONTOLOGY, Ask, asker, names


def test_loading_again_keeps_the_reference_but_takes_the_first_flag(ask: Ask) -> None:
    ask('ADD IND CLASS', 'X', 'DOOR')
    again = ask('LOAD FILE', ONTOLOGY, IRI, 'true', 'PELLET', 'false')
    assert again.success
    assert 'loaded already' in again.error_description
    assert names(ask('QUERY IND CLASS', 'DOOR')) == ['X']
    ask('ADD IND CLASS', 'Y', 'DOOR')
    assert names(ask('QUERY IND CLASS', 'DOOR')) == ['X'], 'buffered now'
    ask('LOAD FILE', ONTOLOGY, IRI, 'false', 'PELLET', 'false')
    assert names(ask('QUERY IND CLASS', 'DOOR')) == ['X', 'Y']


def test_several_references_do_not_mix(ask: Ask) -> None:
    assert ask('LOAD FILE', ONTOLOGY, IRI, 'false', '', 'false', reference='other').success
    ask('ADD IND CLASS', 'X', 'DOOR', reference='other')
    assert names(ask('QUERY IND CLASS', 'DOOR')) == []
    assert ask('GET ALL REFS').queried_objects == ['map', 'other']
    assert ask('DROP', reference='other').success
    assert ask('DROP', reference='other').success
    assert ask('GET ALL REFS').queried_objects == ['map']


def test_only_the_mounted_client_changes_anything(ask: Ask) -> None:
    assert ask('MOUNT', client='a').success
    assert ask('MOUNT', client='a').success
    assert ask('GET REF CLIENT', 'map').queried_objects == ['a']
    refused = ask('MOUNT', client='b')
    assert (refused.success, refused.exit_code) == (False, 203)
    assert refused.error_description == (
        'b cannot be mounted on map. Another client is already mounted on it.'
    )
    for words, args in (('ADD IND', ('X',)), ('APPLY', ()), ('REASON', ())):
        busy = ask(words, *args, client='b')
        assert (busy.success, busy.exit_code) == (False, 102)
        assert busy.error_description == (
            'b cannot connect to map. Another client is already mounted on it.'
        )
    assert ask('QUERY IND CLASS', 'DOOR', client='b').success
    assert ask('ADD IND CLASS', 'X', 'DOOR', client='a').success
    assert ask('UNMOUNT', client='b').success
    assert ask('GET REF CLIENT', 'map').queried_objects == ['a']
    assert ask('UNMOUNT', client='a').success
    assert ask('GET REF CLIENT', 'map').queried_objects == ['none']
    assert ask('ADD IND', 'Y', client='b').success


def test_mounting_what_is_not_there(ask: Ask) -> None:
    assert ask('MOUNT', reference='other').exit_code == 203
    assert ask('GET REF CLIENT', 'other').exit_code == 205


def test_load_mounted(ask: Ask) -> None:
    args = (ONTOLOGY, IRI, 'false', 'PELLET', 'false')
    assert ask('LOAD FILE MOUNTED', *args, client='a', reference='other').success
    assert ask('GET REF CLIENT', 'other').queried_objects == ['a']
    refused = ask('LOAD FILE MOUNTED', *args, client='b', reference='other')
    assert (refused.success, refused.exit_code) == (False, 203)


def test_a_client_called_none_is_not_mounted(ask: Ask) -> None:
    ask('MOUNT', client='none')
    assert ask('ADD IND', 'X', client='b').success


def test_mounting_can_be_left_unenforced(tmp_path: Path) -> None:
    service = ArmorService(Settings(ontologies_folder=tmp_path, enforce_mount=False))
    ask = asker(service)
    ask('LOAD FILE', ONTOLOGY, IRI, 'false', '', 'false')
    ask('MOUNT', client='a')
    assert ask('ADD IND CLASS', 'X', 'DOOR', client='b').success
    service.close()


@pytest.mark.parametrize(
    ('reasoner', 'note'),
    [
        ('', ''),
        ('pellet', ''),
        ('NATIVE', ''),
        ('HERMIT', "'HERMIT'"),
        ('SNOROCKET', "'SNOROCKET'"),
    ],
)
def test_reasoner_names(service: ArmorService, reasoner: str, note: str) -> None:
    answer = asker(service)('LOAD FILE', ONTOLOGY, IRI, 'false', reasoner, 'false')
    assert answer.success
    assert note in answer.error_description
    assert bool(answer.error_description) == bool(note)


def test_what_cannot_be_loaded_leaves_no_reference(service: ArmorService, tmp_path: Path) -> None:
    ask = asker(service)
    broken = tmp_path / 'broken.owl'
    broken.write_text('<?xml version="1.0"?>\n<rdf:RDF>\n  <oops\n')
    entities = tmp_path / 'entities.owl'
    entities.write_text('<!DOCTYPE x [<!ENTITY a "aa"><!ENTITY b "&a;&a;">]>\n<x>&b;</x>')
    for path, words in (
        (str(broken), 'broken.owl:'),
        (str(entities), 'entities.owl'),
        (str(tmp_path / 'none.owl'), 'does not exist'),
        (str(tmp_path), 'is not a file'),
        ('/etc/passwd', 'may not be read'),
        (f'{tmp_path}/../../../etc/passwd', 'may not be read'),
        ('', 'path is empty'),
        ('a\nb', 'is not a path'),
        ('x' * 300, 'File name too long'),
    ):
        answer = ask('LOAD FILE', path, IRI, 'false', 'PELLET', 'false')
        assert (answer.success, answer.exit_code) == (False, 205), path
        assert words in answer.error_description
        assert '\n' not in answer.error_description
        assert ask('GET ALL REFS').queried_objects == []
    assert ask('LOAD FILE', ONTOLOGY, 'no iri', 'false', '', 'false').exit_code == 205
    assert ask('LOAD FILE', ONTOLOGY, IRI, 'false', '', 'false').success, 'the name is not poisoned'


def test_links_out_of_the_allowed_directories_are_seen_through(
    service: ArmorService, tmp_path: Path
) -> None:
    (tmp_path / 'link.owl').symlink_to('/etc/passwd')
    (tmp_path / 'out').symlink_to('/tmp')
    ask = asker(service)
    assert (
        'may not be read'
        in ask('LOAD FILE', str(tmp_path / 'link.owl'), IRI, 'false', '', 'false').error_description
    )
    ask('LOAD FILE', ONTOLOGY, IRI, 'false', '', 'false')
    for path in (str(tmp_path / 'out' / 'x.owl'), str(tmp_path / 'link.owl'), '/tmp/x.owl'):
        assert 'may not be written' in ask('SAVE', path).error_description


def test_the_packaged_ontology_is_never_overwritten(ask: Ask) -> None:
    before = Path(ONTOLOGY).read_bytes()
    answer = ask('SAVE', '')
    assert not answer.success
    assert 'may not be written' in answer.error_description
    assert Path(ONTOLOGY).read_bytes() == before


def test_the_web_is_closed(ask: Ask) -> None:
    answer = ask('LOAD WEB', 'http://example.org/x.owl', IRI, 'false', '', 'false', reference='web')
    assert (answer.success, answer.exit_code) == (False, 205)
    assert 'allow_web' in answer.error_description


def test_saving_and_loading_again(ask: Ask, tmp_path: Path) -> None:
    ask('ADD DATAPROP IND', 'visitedAt', 'R3', 'LONG', '1')
    ask('ADD OBJECTPROP IND', 'hasDoor', 'R3', 'D1')
    assert ask('SAVE', 'plain.owl').success
    assert ask('SAVE INFERENCE', str(tmp_path / 'derived.owl')).success
    assert '#URGENT' in (tmp_path / 'derived.owl').read_text()
    ask('REPLACE DATAPROP IND', 'visitedAt', 'R3', 'LONG', '1665579740', '1')
    assert names(ask('QUERY IND CLASS', 'URGENT')) == [], 'saving asserted nothing'
    for name, urgent in (('plain', []), ('derived', ['R3'])):
        path = str(tmp_path / f'{name}.owl')
        assert ask('LOAD FILE', path, IRI, 'false', '', 'false', reference=name).success
        assert names(ask('QUERY IND CLASS', 'ROOM', reference=name)) == ['R3']
        ask('REMOVE DATAPROP IND', 'visitedAt', 'R3', 'LONG', '1', reference=name)
        assert names(ask('QUERY IND CLASS', 'URGENT', reference=name)) == urgent
        assert ask('SAVE', '', reference=name).success, 'an empty path is the file it came from'


def test_an_older_state_never_replaces_a_newer_one(
    ask: Ask, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    compose, begun, go_on = writing.ontology_bytes, threading.Event(), threading.Event()

    def slowly(axioms: list[Axiom], *rest: Any) -> bytes:
        data = compose(axioms, *rest)
        if not begun.is_set():
            begun.set()
            assert go_on.wait(30)
        return data

    monkeypatch.setattr(writing, 'ontology_bytes', slowly)
    older, newer = (threading.Thread(target=ask, args=('SAVE', 'map.owl')) for _ in range(2))
    older.start()
    assert begun.wait(30)
    ask('ADD IND CLASS', 'X', 'DOOR')
    newer.start()
    assert ask('SAVE', 'other.owl').success, 'another file does not wait'
    go_on.set()
    for save in (older, newer):
        save.join()
    assert (tmp_path / 'map.owl').read_bytes() == (tmp_path / 'other.owl').read_bytes()
    assert {path.name for path in tmp_path.iterdir()} == {'map.owl', 'other.owl'}, 'no draft'


def test_a_state_that_was_taken_before_the_newest_is_not_written_after_it(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    service = ArmorService(Settings(str(tmp_path)))
    ask = asker(service)
    assert ask('LOAD FILE', ONTOLOGY, IRI, 'false', 'PELLET', 'false').success
    saving, taken, go_on = service.workspace.saving, threading.Event(), threading.Event()

    def late(path: Path) -> threading.Lock:
        if not taken.is_set():
            taken.set()
            assert go_on.wait(30)
        return saving(path)

    monkeypatch.setattr(service.workspace, 'saving', late)
    older = threading.Thread(target=ask, args=('SAVE', 'map.owl'))
    older.start()
    assert taken.wait(30)
    ask('ADD IND CLASS', 'X', 'DOOR')
    assert ask('SAVE', 'map.owl').success
    newest = (tmp_path / 'map.owl').read_bytes()
    go_on.set()
    older.join()
    assert (tmp_path / 'map.owl').read_bytes() == newest


def test_a_list_that_saves_waits_for_no_save_that_waits_for_it(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    service = ArmorService(Settings(str(tmp_path)))
    assert asker(service)('LOAD FILE', ONTOLOGY, IRI, 'false', 'PELLET', 'false').success
    request = DirectiveRequest('me', 'map', 'SAVE', args=('map.owl',))
    waiting, answers = threading.Semaphore(0), queue.SimpleQueue[Any]()
    saving = service.workspace.saving

    def told(path: Path) -> threading.Lock:
        waiting.release()
        return saving(path)

    monkeypatch.setattr(service.workspace, 'saving', told)

    def save(execute: Callable[[Any], Any], argument: Any) -> None:
        answers.put(execute(argument))

    with saving(tmp_path / 'map.owl'):
        for call in ((service.execute, request), (service.execute_list, [request])):
            threading.Thread(target=save, args=call, daemon=True).start()
            assert waiting.acquire(timeout=30)
    for _ in range(2):
        assert answers.get(timeout=30).success


@pytest.mark.parametrize('step', ['looked for', 'written', 'read'])
def test_a_disk_that_does_not_answer_keeps_neither_readers_nor_the_collector(
    ask: Ask, step: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    waiting, goes_on = threading.Semaphore(0), threading.Event()

    def hanging(*_: Any, **__: Any) -> Any:
        waiting.release()
        assert goes_on.wait(30)
        raise OSError(errno.EIO, 'it broke')

    def looked_for(path: Path) -> Any:
        return hanging() if path.name == 'map.owl' else exists(path)

    exists = Path.exists
    words: tuple[str, ...] = ('SAVE', 'map.owl')
    if step == 'looked for':
        monkeypatch.setattr(Path, 'exists', looked_for)
    elif step == 'written':
        monkeypatch.setattr(writing, 'replace_file', hanging)
    else:
        monkeypatch.setattr(reading, 'open', hanging, raising=False)
        words = ('LOAD FILE', ONTOLOGY, IRI, 'false', '', 'false')
    answers = queue.SimpleQueue[Any]()
    reference = 'other' if step == 'read' else 'map'
    hung = [
        threading.Thread(target=lambda: answers.put(ask(*words, reference=reference)))
        for _ in range(2)
    ]
    for save in hung:
        save.start()
    for _ in range(1 if step == 'written' else 2):
        assert waiting.acquire(timeout=30)
    reader = threading.Thread(target=lambda: answers.put(ask('QUERY IND CLASS', 'ROOM')))
    reader.start()
    assert answers.get(timeout=30).success
    assert gc.isenabled()
    goes_on.set()
    for save in hung:
        assert 'it broke' in answers.get(timeout=30).error_description
        save.join()
    assert gc.isenabled()


def test_what_was_loaded_meanwhile_is_not_saved_into_the_file_of_what_was_dropped(
    ask: Ask, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    for name in 'ab':
        text = f'Ontology(<{IRI}> ClassAssertion(<{IRI}#C> <{IRI}#{name}>))'
        (tmp_path / f'{name}.owl').write_text(text)
    assert ask('DROP').success
    assert ask('LOAD FILE', 'a.owl', IRI, 'false', '', 'false').success
    before = (tmp_path / 'a.owl').read_bytes()
    to_write = SafePaths.to_write

    def late(paths: SafePaths, *args: Any) -> Path:
        monkeypatch.undo()
        done = threading.Thread(target=meanwhile)
        done.start()
        done.join(30)
        return to_write(paths, *args)

    def meanwhile() -> None:
        ask('DROP')
        ask('LOAD FILE', 'b.owl', IRI, 'false', '', 'false')

    monkeypatch.setattr(SafePaths, 'to_write', late)
    assert ask('SAVE').error_description == 'SAVE: map was loaded again meanwhile'
    assert (tmp_path / 'a.owl').read_bytes() == before
    assert ask('SAVE').success


def test_names_that_rdf_xml_cannot_hold_are_saved_as_ntriples(ask: Ask) -> None:
    ask('ADD DATAPROP IND', '42', 'R1', 'LONG', '1')
    refused = ask('SAVE', 'map.owl')
    assert (refused.success, refused.exit_code) == (False, 205)
    assert refused.error_description == (
        f'SAVE: RDF/XML cannot name <{IRI}#42>; save it as N-Triples (.nt)'
    )
    assert ask('SAVE', 'map.nt').success
    assert ask('LOAD FILE', 'map.nt', IRI, 'false', '', 'false', reference='again').success
    values = ask('QUERY DATAPROP IND', '42', 'R1', reference='again').queried_objects
    assert values == ['"1"^^xsd:long']


@pytest.mark.parametrize(
    ('name', 'text'),
    [
        ('t.ttl', f'@prefix : <{IRI}#> .\n:R1 a :ROOM .\n'),
        ('t.owl', f'Ontology(<{IRI}> ClassAssertion(<{IRI}#ROOM> <{IRI}#R1>))'),
    ],
)
def test_a_document_of_a_format_that_is_only_read_is_saved_in_another(
    service: ArmorService, tmp_path: Path, name: str, text: str
) -> None:
    ask = asker(service)
    (tmp_path / name).write_text(text)
    args = (IRI, 'false', '', 'false')
    assert ask('LOAD FILE', name, *args).success
    ask('ADD IND CLASS', 'R2', 'ROOM')
    assert ask('SAVE', '').success
    assert ask('LOAD FILE', name, *args, reference='again').success
    assert names(ask('QUERY IND CLASS', 'ROOM', reference='again')) == ['R1', 'R2']


def test_logging_to_a_file_and_the_console(service: ArmorService, ask: Ask, tmp_path: Path) -> None:
    assert ask('LOG FILE ON', 'armor.log').success
    ask('QUERY IND CLASS', 'DOOR')
    assert ask('LOG FILE OFF').success
    ask('QUERY IND CLASS', 'ROOM')
    text = (tmp_path / 'armor.log').read_text()
    assert "'tester' on 'map': QUERY IND CLASS [DOOR] -> ok" in text
    assert 'ROOM' not in text
    assert ask('LOG FILE ON', '/etc/armor.log').exit_code == 205
    shown: list[str] = []
    noisy = ArmorService(Settings(), screen=shown.append)
    asker(noisy)('LOG SCREEN ON')
    asker(noisy)('QUERY IND', 'x')
    asker(noisy)('LOG SCREEN OFF')
    assert any('exit code 205' in line for line in shown)
    assert not any('inconsistent' in line for line in shown), 'of no ontology'
    noisy.close()


UNSUPPORTED = """<?xml version="1.0"?>
<rdf:RDF xmlns="http://example.org/u#" xml:base="http://example.org/u"
     xmlns:owl="http://www.w3.org/2002/07/owl#" xmlns:rdfs="http://www.w3.org/2000/01/rdf-schema#"
     xmlns:rdf="http://www.w3.org/1999/02/22-rdf-syntax-ns#">
  <swrl:Imp xmlns:swrl="http://www.w3.org/2003/11/swrl#">
    <swrl:body rdf:parseType="Collection">
      <swrl:BuiltinAtom><swrl:builtin rdf:resource="#unknown"/>
        <swrl:arguments rdf:parseType="Collection"><swrl:Variable rdf:about="#x"/></swrl:arguments>
      </swrl:BuiltinAtom>
    </swrl:body>
    <swrl:head rdf:parseType="Collection">
      <swrl:ClassAtom>
        <swrl:classPredicate rdf:resource="#A"/><swrl:argument1 rdf:resource="#x"/>
      </swrl:ClassAtom>
    </swrl:head>
  </swrl:Imp>
</rdf:RDF>
"""


def test_what_the_reasoner_does_not_support_is_reported_at_load(
    service: ArmorService, tmp_path: Path
) -> None:
    (tmp_path / 'u.owl').write_text(UNSUPPORTED)
    ask = asker(service)
    answer = ask('LOAD FILE', 'u.owl', 'http://example.org/u', 'false', '', 'false')
    assert answer.success
    assert 'not supported by the reasoner' in answer.error_description
    listed = ask('QUERY UNSUPPORTED').queried_objects
    assert listed
    assert listed[0] in answer.error_description


def test_the_web_when_it_is_allowed(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv('no_proxy', '*')

    class Quiet(SimpleHTTPRequestHandler):
        def log_message(self, *_: object) -> None:
            pass

    handler = partial(Quiet, directory=str(FIXTURES))
    with ThreadingHTTPServer(('127.0.0.1', 0), handler) as server:
        threading.Thread(target=server.serve_forever, daemon=True).start()
        base = f'http://127.0.0.1:{server.server_address[1]}'
        service = ArmorService(Settings(ontologies_folder=tmp_path, allow_web=True))
        ask = asker(service)
        good = ask('LOAD WEB MOUNTED', f'{base}/patrol.owl', IRI, 'false', '', 'false')
        assert good.success
        assert ask('GET REF CLIENT', 'map').queried_objects == ['tester']
        assert 'expected a path' in ask('SAVE', '').error_description
        for url, words in (
            (f'{base}/none.owl', 'not found'),
            ('file:///etc/passwd', 'not an http address'),
            ('http://127.0.0.1:1/x', 'refused'),
        ):
            bad = ask('LOAD WEB', url, IRI, 'false', '', 'false', reference='bad')
            assert (bad.success, bad.exit_code) == (False, 205)
            assert words in bad.error_description
        server.shutdown()
        service.close()
