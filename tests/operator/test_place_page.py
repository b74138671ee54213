"""A place edited in a real Chromium: by mouse, by keyboard alone, by fingers on a phone."""

from __future__ import annotations

import base64
import re
import shutil
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
from PIL import Image

from floor_plans import read_place
from floor_plans.occupancy_map import write_map
from surveillance_operator.page.server import Page
from surveillance_operator.place_page.dropped_map import import_dropped
from surveillance_operator.place_page.edit_command import editor_page, main
from tests.operator.browser import CHROMIUM, DESK, DRIVER, MISSING, PHONE, Viewer

SEVEN = Path(__file__).parents[2] / 'config' / 'seven_rooms.yaml'
in_browser = pytest.mark.skipif(not (CHROMIUM and DRIVER), reason=MISSING)


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


@pytest.fixture(scope='module')
def browser() -> Iterator[Viewer]:
    viewer = Viewer('about:blank')
    yield viewer
    viewer.close()


class Hand:
    """A person at the editor."""

    def __init__(self, viewer: Viewer, page: Page, size: tuple[int, int] = DESK) -> None:
        self.viewer = viewer
        viewer.size(*size)
        viewer.driver.get(page.address)
        viewer.until(lambda: viewer.js('return Boolean(window.editor?.place)'))

    def at(self, x: float, y: float) -> tuple[float, float]:
        across, down = self.viewer.js('return editor.at(arguments[0], arguments[1])', x, y)
        return float(across), float(down)

    def mouse(self, kind: str, x: float, y: float) -> None:
        across, down = self.at(x, y)
        self.viewer.driver.execute_cdp_cmd(
            'Input.dispatchMouseEvent',
            {'type': kind, 'x': across, 'y': down, 'button': 'left', 'buttons': 1, 'clickCount': 1},
        )

    def drag(self, *points: tuple[float, float]) -> None:
        self.mouse('mousePressed', *points[0])
        for point in points[1:]:
            self.mouse('mouseMoved', *point)
        self.mouse('mouseReleased', *points[-1])

    def click(self, x: float, y: float) -> None:
        self.drag((x, y))

    def touch(self, kind: str, *points: tuple[float, float]) -> None:
        touches = [dict(zip(('x', 'y'), self.at(*point), strict=True)) for point in points]
        self.viewer.driver.execute_cdp_cmd(
            'Input.dispatchTouchEvent', {'type': kind, 'touchPoints': touches}
        )

    def keys(self, *keys: str) -> None:
        from selenium.webdriver.common.action_chains import ActionChains

        ActionChains(self.viewer.driver).send_keys(*keys).perform()

    def chord(self, *keys: str) -> None:
        from selenium.webdriver.common.action_chains import ActionChains

        chain = ActionChains(self.viewer.driver)
        for key in keys[:-1]:
            chain = chain.key_down(key)
        chain = chain.send_keys(keys[-1])
        for key in keys[:-1]:
            chain = chain.key_up(key)
        chain.perform()

    def tool(self, name: str) -> None:
        self.viewer.click(f'[data-tool={name}]')

    def place(self, path: str) -> Any:
        return self.viewer.js(f'return editor.place.{path}')

    def said(self, words: str) -> None:
        self.viewer.until(lambda: words in self.viewer.text('#said'), 20.0)

    def fill(self, field: str, text: str) -> None:
        from selenium.webdriver.common.by import By
        from selenium.webdriver.common.keys import Keys

        selector = f'[data-field={field}]'
        found = self.viewer.driver.find_element(By.CSS_SELECTOR, selector)
        found.send_keys(Keys.CONTROL, 'a')
        found.send_keys(Keys.CONTROL)
        found.send_keys(text)

    @property
    def problem(self) -> str:
        return self.viewer.text('#problem')


@in_browser
def test_a_place_is_changed_by_mouse_and_saved(browser: Viewer, page: Page, file: Path) -> None:
    from selenium.webdriver.common.keys import Keys

    hand = Hand(browser, page)
    hand.tool('cut')
    hand.drag((14.0, 11.0), (14.0, 12.0), (14.0, 13.5))
    hand.said('C2 is cut: the new part is R5')
    hand.tool('select')
    hand.click(8.3, 3.5)
    browser.until(lambda: browser.text('#chosen-h') == 'room R1', 20.0)
    hand.fill('name', 'R2')
    browser.until(lambda: "there is a 'R2' already" in hand.problem, 20.0)
    hand.fill('name', 'kitchen')
    browser.until(lambda: not hand.problem, 20.0)
    browser.js(
        'const send = window.fetch; window.sent = [];'
        'window.fetch = (at, all) => { window.sent.push(at); return send(at, all); };'
        # As browsers do it that send a form by the Enter key: both events come at once.
        'const input = document.querySelector("[data-field=name]"); input.focus();'
        'input.dispatchEvent(new Event("change")); input.form.requestSubmit()'
    )
    hand.said('R1 is kitchen')
    browser.until(lambda: browser.text('#chosen-h') == 'room kitchen', 20.0)
    assert browser.js('return window.sent').count('/act/edit') == 1
    assert not hand.problem
    hand.fill('hours', 'mon-fri 8')
    browser.until(lambda: hand.problem.startswith('hours.kitchen: '), 20.0)
    hand.fill('hours', 'mon-fri 08:00-18:00')
    hand.keys(Keys.ENTER)
    hand.said('kitchen: hours')
    x, y = hand.place('doors.D1.at')[:2]
    hand.drag((x, y), (x + 0.5, y + 0.1), (x + 1.0, y + 0.2))
    hand.said('D1 is at (11.00, 6.50)')
    hand.tool('keep_out')
    hand.drag((8.5, 8.8), (9.0, 9.0), (9.5, 9.8))
    hand.said('zone K1')
    browser.until(lambda: browser.text('#chosen-h') == 'zone K1', 20.0)
    hand.tool('slow')
    for corner in ((16.0, 3.0), (17.0, 3.0), (17.0, 4.0)):
        hand.click(*corner)
    browser.click('#done')
    hand.said('zone S1')
    hand.tool('join')
    hand.click(16.0, 16.0)
    browser.until(lambda: 'R4' in browser.text('#hint'), 20.0)
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
    browser.until(lambda: browser.text('#chosen-h') != 'Nothing chosen', 20.0)
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
    browser.until(lambda: browser.text('#chosen-h') == 'room R4', 20.0)
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


def drop_of(browser: Viewer, *paths: Path) -> None:
    """Drop files on the page, as a browser tells of it."""
    files = [[path.name, base64.b64encode(path.read_bytes()).decode()] for path in paths]
    browser.js(
        """
        const data = new DataTransfer();
        for (const [name, text] of arguments[0]) {
          const bytes = Uint8Array.from(atob(text), (sign) => sign.charCodeAt(0));
          data.items.add(new File([bytes], name));
        }
        document.body.dispatchEvent(new DragEvent('drop', {dataTransfer: data, bubbles: true, cancelable: true}));
        """,  # noqa: E501
        files,
    )


@pytest.fixture
def open_page(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Page]:
    (tmp_path / 'desk').mkdir()
    monkeypatch.chdir(tmp_path / 'desk')
    page = editor_page(None, '127.0.0.1', 0, 0.22)
    page.start()
    yield page
    page.stop()


@in_browser
def test_a_map_dropped_on_the_page_becomes_a_place(
    browser: Viewer, open_page: Page, tmp_path: Path
) -> None:
    # As map_saver leaves it: a pgm, named by its path on the robot.
    grid = read_place(SEVEN).plan.grid(0.1)
    write_map(tmp_path / 'flat.yaml', grid.cells[::-1], 0.1, (*grid.origin, 0.0))
    with Image.open(tmp_path / 'flat.png') as image:
        image.save(tmp_path / 'flat.pgm')
    text = (tmp_path / 'flat.yaml').read_text()
    (tmp_path / 'flat.yaml').write_text(text.replace('flat.png', '/home/robot/maps/flat.pgm'))
    browser.size(*DESK)
    browser.driver.get(open_page.address)
    browser.until(lambda: browser.js('return Boolean(window.editor)'))
    assert not browser.js('return document.querySelector("#floor-section").checkVisibility()')
    drop_of(browser, tmp_path / 'flat.yaml')
    browser.until(lambda: 'flat.yaml names flat.pgm' in browser.text('#import-said'), 20.0)
    drop_of(browser, tmp_path / 'flat.pgm')
    browser.until(lambda: '7 doors' in browser.text('#import-said'), 60.0)
    assert len(browser.js('return Object.keys(editor.place.rooms)')) == 7
    folder = tmp_path / 'desk'
    assert {path.name for path in folder.iterdir()} == {
        *('flat.yaml', 'flat.pgm', 'flat_place.yaml', 'flat_place.png'),
    }
    # It is edited and saved as any place.
    hand = Hand.__new__(Hand)
    hand.viewer = browser
    room = str(browser.js('return Object.keys(editor.place.rooms)[0]'))
    browser.js(
        'const list = document.querySelector("#list"); list.value = arguments[0];'
        'list.dispatchEvent(new Event("change"))',
        f'room {room}',
    )
    hand.fill('name', 'kitchen\n')
    hand.said(f'{room} is kitchen')
    drop_of(browser, tmp_path / 'flat.yaml', tmp_path / 'flat.pgm')
    browser.until(lambda: 'is not saved' in browser.text('#import-said'), 20.0)
    browser.click('#save')
    hand.said('written: ')
    assert 'kitchen' in read_place(folder / 'flat_place.yaml').plan.place.rooms
    # What is there is not written over.
    drop_of(browser, tmp_path / 'flat.yaml', tmp_path / 'flat.pgm')
    browser.until(lambda: 'flat_place' in browser.text('#import-said'), 60.0)
    assert 'is there already' in browser.text('#import-said')
    log = browser.driver.get_log('browser')
    assert [each for each in log if each['source'] == 'javascript'] == []


@in_browser
def test_a_chosen_picture_needs_its_scale(browser: Viewer, open_page: Page, tmp_path: Path) -> None:
    from selenium.webdriver.common.by import By

    grid = read_place(SEVEN).plan.grid(0.1)
    write_map(tmp_path / 'plan.yaml', grid.cells[::-1], 0.1, (*grid.origin, 0.0))
    browser.size(*PHONE)
    browser.driver.get(open_page.address)
    browser.until(lambda: browser.js('return Boolean(window.editor)'))
    browser.driver.find_element(By.ID, 'files').send_keys(str(tmp_path / 'plan.png'))
    browser.until(lambda: 'says nothing of its scale' in browser.text('#import-said'), 20.0)
    assert browser.js('return document.documentElement.scrollWidth') <= PHONE[0]
    browser.driver.find_element(By.ID, 'scale').send_keys('0.1')
    browser.click('#import-now')
    browser.until(lambda: '7 doors' in browser.text('#import-said'), 60.0)


@pytest.mark.parametrize(
    ('files', 'words'),
    [
        ({}, 'no file came'),
        ({'../x.yaml': ''}, 'expected a file of a map'),
        ({'run.sh': ''}, 'expected a file of a map'),
        ({'map.yaml': '*'}, 'did not arrive whole'),
        ({'map.yaml': 'aW1hZ2U6IG0ucGdtCg=='}, 'map.yaml names m.pgm: expected it with map.yaml'),
        ({'a.yaml': '', 'b.yaml': ''}, 'expected one map at a time'),
        ({'map.yaml': ''}, 'map.yaml'),
        ({'map.pgm': 'UDUK'}, 'says nothing of its scale'),
    ],
)
def test_what_is_dropped_and_is_no_map_costs_one_line(
    files: dict[str, str], words: str, tmp_path: Path
) -> None:
    with pytest.raises(ValueError, match=re.escape(words)) as caught:
        import_dropped(files, tmp_path, 0.22)
    assert '\n' not in str(caught.value)
    assert 'dropped-' not in str(caught.value)
    assert list(tmp_path.iterdir()) == []


_REST = 'resolution: 0.05\norigin: [0, 0, 0]\nnegate: 0\noccupied_thresh: 0.65\nfree_thresh: 0.2\n'


def two_rooms(path: Path) -> None:
    """Write the picture of two rooms with a door of 1 m."""
    image = Image.new('L', (162, 82), 0)
    for box in ((2, 2, 80, 80), (82, 2, 160, 80), (80, 30, 82, 50)):
        image.paste(254, box)
    image.save(path)


def as_dropped(text: str, name: str, **pictures: Path) -> dict[str, str]:
    contents = {name: text.encode()}
    contents |= {f'{stem}.png': path.read_bytes() for stem, path in pictures.items()}
    return {name: base64.b64encode(data).decode() for name, data in contents.items()}


@pytest.mark.parametrize(
    ('image', 'name'),
    [
        ('image: m.png # of the ground floor', 'm.yaml'),
        ('image: ../../elsewhere/m.png', 'm.yaml'),
        ('"image": "C:\\\\maps\\\\m.png"', 'm.yaml'),
        ('image: >-\n  /elsewhere/m.png', 'm.yaml'),
        ('image: ../m.png', 'm.YAML'),
    ],
)
def test_a_picture_is_taken_from_what_was_dropped(image: str, name: str, tmp_path: Path) -> None:
    two_rooms(tmp_path / 'm.png')
    files = as_dropped(f'{image}\n{_REST}', name, m=tmp_path / 'm.png')
    out, said = import_dropped(files, tmp_path, 0.22)
    assert '2 rooms, 1 door' in said
    assert len(read_place(out).plan.place.rooms) == 2


@pytest.mark.parametrize('form', ['image: {}\n', '"image": {}\n', 'image:\n  {}\n'])
def test_no_picture_of_another_folder_is_read(form: str, tmp_path: Path) -> None:
    two_rooms(tmp_path / 'other.png')
    (tmp_path / 'here').mkdir()
    files = as_dropped(form.format(tmp_path / 'other.png') + _REST, 'm.yaml')
    with pytest.raises(ValueError, match=r'm\.yaml names other\.png: expected it with'):
        import_dropped(files, tmp_path / 'here', 0.22)
    assert list((tmp_path / 'here').iterdir()) == []


def test_the_drawing_is_not_written_over_the_picture_of_the_map(tmp_path: Path) -> None:
    two_rooms(tmp_path / 'm_place.png')
    before = (tmp_path / 'm_place.png').read_bytes()
    files = as_dropped(f'image: m_place.png\n{_REST}', 'm.yaml', m_place=tmp_path / 'm_place.png')
    import_dropped(files, tmp_path, 0.22)
    assert (tmp_path / 'm_place.png').read_bytes() == before
    assert (tmp_path / 'm_place_drawn.png').exists()


def test_a_place_that_cannot_be_written_whole_leaves_nothing(tmp_path: Path) -> None:
    two_rooms(tmp_path / 'm.png')
    here = tmp_path / 'here'
    here.mkdir()
    (here / 'm_place.yaml').symlink_to(tmp_path / 'gone' / 'm_place.yaml')
    files = as_dropped(f'image: m.png\n{_REST}', 'm.yaml', m=tmp_path / 'm.png')
    with pytest.raises(ValueError, match='No such file'):
        import_dropped(files, here, 0.22)
    assert list(here.iterdir()) == []
    import_dropped(files, here, 0.22)
