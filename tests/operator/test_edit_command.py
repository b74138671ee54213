"""A place edited in a real Chromium: by mouse, by keyboard alone, by fingers on a phone."""

from __future__ import annotations

import shutil
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest

from floor_plans import read_place
from floor_plans.editor import PlaceEditor
from floor_plans.imports import ImportRequest, import_place
from floor_plans.occupancy_map import write_map
from surveillance_operator.page.server import Page
from surveillance_operator.place_page.edit_command import editor_page, main
from tests.operator.browser import PHONE, Viewer
from tests.operator.hand import SEVEN, Hand, in_browser


@pytest.fixture
def file(tmp_path: Path) -> Path:
    shutil.copy(SEVEN, tmp_path / 'place.yaml')
    return tmp_path / 'place.yaml'


@pytest.fixture
def page(file: Path) -> Iterator[Page]:
    page = editor_page(file, '127.0.0.1', 0, 0.22)
    page.start()
    yield page
    page.stop()


@in_browser
def test_a_place_is_changed_by_mouse_and_saved(browser: Viewer, page: Page, file: Path) -> None:
    from selenium.webdriver.common.keys import Keys

    hand = Hand(browser, page)
    hand.tool('cut')
    hand.drag((14.0, 11.0), (14.0, 12.0), (14.0, 13.5))
    hand.said('C2 is cut: the new part is R5')
    hand.tool('select')
    hand.click(8.3, 3.5)
    browser.until(lambda: browser.text('#chosen-h') == 'room R1')
    hand.fill('name', 'R2')
    browser.until(lambda: "there is a 'R2' already" in hand.problem)
    hand.fill('name', 'kitchen')
    browser.until(lambda: not hand.problem)
    browser.js(
        'const send = window.fetch; window.sent = [];'
        'window.fetch = (at, all) => { window.sent.push(at); return send(at, all); };'
        # As browsers do it that send a form by the Enter key: both events come at once.
        'const input = document.querySelector("[data-field=name]"); input.focus();'
        'input.dispatchEvent(new Event("change")); input.form.requestSubmit()'
    )
    hand.said('R1 is kitchen')
    browser.until(lambda: browser.text('#chosen-h') == 'room kitchen')
    assert browser.js('return window.sent').count('/act/edit') == 1
    assert not hand.problem
    hand.fill('hours', 'mon-fri 8')
    browser.until(lambda: hand.problem.startswith('hours.kitchen: '))
    hand.fill('hours', 'mon-fri 08:00-18:00')
    hand.keys(Keys.ENTER)
    hand.said('kitchen: hours')
    x, y = hand.place('doors.D1.at')[:2]
    hand.drag((x, y), (x + 0.5, y + 0.1), (x + 1.0, y + 0.2))
    hand.said('D1 is at (11.00, 6.50)')
    hand.tool('keep_out')
    hand.drag((8.5, 8.8), (9.0, 9.0), (9.5, 9.8))
    hand.said('zone K1')
    browser.until(lambda: browser.text('#chosen-h') == 'zone K1')
    hand.tool('slow')
    for corner in ((16.0, 3.0), (17.0, 3.0), (17.0, 4.0)):
        hand.click(*corner)
    browser.click('#done')
    hand.said('zone S1')
    hand.tool('join')
    hand.click(16.0, 16.0)
    browser.until(lambda: 'R4' in browser.text('#hint'))
    hand.click(16.0, 12.0)
    hand.said('R5 is a part of R4')
    assert browser.text('#changed') == 'changed, not saved'
    assert file.read_text() == SEVEN.read_text(), 'until it is saved'
    browser.click('#save')
    hand.said('written')
    found = read_place(file)
    assert found.plan.zones.slow['S1'].speed == 0.3
    assert set(found.place.rooms) == {'kitchen', 'R2', 'R3', 'R4', 'E', 'C1', 'C2'}
    assert '# A point inside each place' in file.read_text()
    assert browser.axe() == []


@in_browser
def test_what_is_left_out_becomes_a_room_at_one_tap(browser: Viewer, tmp_path: Path) -> None:
    cells = np.zeros((120, 200), np.int8)  # free up to the edge: the paper of a floor plan
    cells[[20, 99], 20:180] = cells[20:100, 20] = cells[20:100, 179] = 100
    cells[20:100, 100] = 100
    cells[50:70, 100] = cells[50:70, 20] = 0
    write_map(tmp_path / 'map.yaml', cells, 0.05, (0.0, 0.0, 0.0))
    import_place(ImportRequest(tmp_path / 'map.yaml', tmp_path / 'place.yaml'))
    page = editor_page(tmp_path / 'place.yaml', '127.0.0.1', 0, 0.22)
    page.start()
    try:
        hand = Hand(browser, page)
        assert hand.place('left_out')['1']['reason'] == 'outside of the building'
        hand.click(*hand.place('left_out')['1']['at'])
        hand.said('R3 is a room, joined by ')
        assert hand.place('left_out') == {}
        browser.click('#undo')
        hand.said('undone: R3 is a room')
        browser.js(
            'const list = document.querySelector("#list"); list.value = "left_out 1";'
            'list.dispatchEvent(new Event("change"))'
        )
        browser.until(lambda: browser.text('#chosen-h') == 'left out 1')
        assert 'outside of the building' in browser.text('[data-field=take]')
        assert browser.axe() == []
    finally:
        page.stop()


@in_browser
def test_what_a_newer_map_changed_is_decided_piece_by_piece(
    browser: Viewer, file: Path, tmp_path: Path
) -> None:
    newer = tmp_path / 'newer.yaml'
    shutil.copy(file, newer)
    editor = PlaceEditor(newer)
    for x, y1, y2 in ((13.7, 10.0, 14.5), (13.7, 6.5, 10.0)):
        editor.apply('cut', {'x1': x, 'y1': y1, 'x2': x, 'y2': y2})
    editor.save()
    page = editor_page(newer, '127.0.0.1', 0, 0.22, older=file)
    page.start()
    try:
        hand = Hand(browser, page)
        browser.until(lambda: 'R5 is new' in browser.text('#changes'))
        assert browser.axe() == []
        browser.click('#changes [aria-label="Keep as it was: room R5"]')
        hand.said('as before: room R5')
        assert 'R5' not in hand.place('rooms')
        browser.click('#changes [aria-label="Take: room R6"]')
        hand.said('taken: room R6 is new')
        assert hand.place('changes') == []
    finally:
        page.stop()


@in_browser
def test_a_place_is_changed_without_a_mouse(browser: Viewer, page: Page, file: Path) -> None:
    from selenium.webdriver.common.keys import Keys

    hand = Hand(browser, page)
    before = hand.place('picture.box')
    browser.js('document.querySelector("#floor").focus()')
    middle = [(before[0] + before[2]) / 2, (before[1] + before[3]) / 2]
    hand.keys('c', Keys.ENTER)
    hand.keys(Keys.ARROW_RIGHT, Keys.ENTER)
    hand.said('✗')
    hand.keys(Keys.ESCAPE, '+', '+', '-')
    hand.keys('d')
    assert browser.attribute('[data-tool=door]', 'aria-pressed') == 'true'
    hand.keys('v', Keys.ENTER)
    browser.until(lambda: browser.text('#chosen-h') != 'Nothing chosen')
    assert middle
    browser.js(
        'const list = document.querySelector("#list"); list.value = "room R3";'
        'list.dispatchEvent(new Event("change"))'
    )
    hand.fill('threshold', '600')
    hand.keys(Keys.ENTER)
    hand.said('R3: thresholds 600')
    browser.js('document.querySelector("#floor").focus()')
    hand.chord(Keys.CONTROL, 'z')
    hand.said('undone: R3')
    hand.chord(Keys.CONTROL, Keys.SHIFT, 'z')
    hand.said('done again: R3')
    hand.chord(Keys.CONTROL, 's')
    hand.said('written')
    assert read_place(file).rules.thresholds == {'R3': 600.0}


@in_browser
def test_a_place_is_changed_with_fingers_on_a_phone(browser: Viewer, page: Page) -> None:
    hand = Hand(browser, page, PHONE)
    width = browser.js('return document.documentElement.scrollWidth')
    assert width <= PHONE[0], 'nothing runs out of the screen'
    hand.tool('cut')
    for point in ((14.0, 11.0), (14.0, 13.5)):
        hand.touch('touchStart', point)
        hand.touch('touchEnd')
    hand.said('C2 is cut')
    hand.tool('select')
    gap = hand.at(10, 10)[0] - hand.at(5, 10)[0]
    hand.touch('touchStart', (6.0, 10.0), (12.0, 10.0))
    for step in range(1, 5):
        hand.touch('touchMove', (6.0 - 0.4 * step, 10.0), (12.0 + 0.4 * step, 10.0))
    hand.touch('touchEnd')
    assert hand.at(10, 10)[0] - hand.at(5, 10)[0] > 1.2 * gap, 'two fingers zoom'
    browser.click('#whole')
    hand.touch('touchStart', (15.0, 16.0))
    hand.touch('touchEnd')
    browser.until(lambda: browser.text('#chosen-h') == 'room R4')
    browser.click('#undo')
    hand.said('undone')


@in_browser
def test_who_has_no_token_may_only_look(browser: Viewer, page: Page) -> None:
    viewer = browser
    viewer.driver.delete_all_cookies()
    viewer.driver.get(f'http://127.0.0.1:{page.port}/')
    viewer.until(lambda: viewer.js('return Boolean(window.editor?.place)'))
    assert viewer.attribute('html', 'data-edit') == '0'
    assert viewer.count('[data-tool]:not([disabled])') == 1


def test_what_cannot_be_edited_is_said_in_one_line(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main([str(tmp_path / 'none.yaml')]) == 2
    assert capsys.readouterr().err.startswith('edit: ')
    with pytest.raises(SystemExit):
        main([str(SEVEN), '--web-address', '8080'])
    assert 'expected HOST:PORT' in capsys.readouterr().err
    with pytest.raises(SystemExit):
        main(['--older', str(SEVEN)])
    assert '--older: expected the newer place with it' in capsys.readouterr().err
