"""A map that is dropped on the page becomes a place."""

from __future__ import annotations

import base64
import re
from collections.abc import Iterator
from pathlib import Path

import cv2
import numpy as np
import pytest
from PIL import Image

from floor_plans import read_place
from floor_plans.occupancy_map import write_map
from surveillance_operator.page.server import Page
from surveillance_operator.place_page.dropped_map import import_dropped
from surveillance_operator.place_page.edit_command import editor_page
from tests.operator.browser import DESK, PHONE, Viewer
from tests.operator.hand import SEVEN, Hand, in_browser


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
    browser.until(lambda: 'flat.yaml names flat.pgm' in browser.text('#import-said'))
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
    browser.until(lambda: 'is not saved' in browser.text('#import-said'))
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
    browser.until(lambda: 'says nothing of its scale' in browser.text('#import-said'))
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


def test_a_photo_of_a_plan_becomes_a_place(tmp_path: Path) -> None:
    image = np.full((500, 700, 3), 245, np.uint8)
    for start, end in (
        *(((50, 50), (650, 70)), ((50, 430), (650, 450)), ((50, 50), (70, 450))),
        *(((630, 50), (650, 450)), ((340, 50), (360, 200)), ((340, 290), (360, 450))),
    ):
        cv2.rectangle(image, start, end, (10, 10, 10), -1)
    _, data = cv2.imencode('.png', image)
    files = {'plan.png': base64.b64encode(data.tobytes()).decode()}
    with pytest.raises(ValueError, match='says nothing of its scale'):
        import_dropped(files, tmp_path, 0.22)
    place, said = import_dropped(files, tmp_path, 0.22, '', '', '', '50,60 650,60 6')
    assert said.startswith('plan.png: 2 rooms, 1 door')
    assert {each.name for each in tmp_path.iterdir()} == {
        *('plan.png', 'plan_place.yaml', 'plan_place.png'),
        *('plan_place_map.yaml', 'plan_place_map.png'),
    }
    assert len(read_place(place).place.rooms) == 2


def test_a_newer_map_of_the_open_place_keeps_names(tmp_path: Path) -> None:
    plan = read_place(SEVEN).plan.grid()
    write_map(tmp_path / 'new.yaml', plan.cells[::-1], 0.05, (*plan.origin, 0.0))
    files = {
        name: base64.b64encode((tmp_path / name).read_bytes()).decode()
        for name in ('new.yaml', 'new.png')
    }
    desk = tmp_path / 'desk'
    desk.mkdir()
    place, said = import_dropped(files, desk, 0.22, older=SEVEN)
    assert 'rooms kept: ' in said
    assert set(read_place(place).place.rooms) >= {'R1', 'R2', 'R3', 'R4', 'E'}
    assert SEVEN.exists()
    empty = np.zeros((200, 300), np.int8)
    empty[[0, -1]] = empty[:, [0, -1]] = 100
    write_map(tmp_path / 'new.yaml', empty, 0.05, (0.0, 0.0, 0.0))
    files = {
        name: base64.b64encode((tmp_path / name).read_bytes()).decode()
        for name in ('new.yaml', 'new.png')
    }
    with pytest.raises(ValueError, match=r'--update .*expected'):
        import_dropped(files, tmp_path / 'desk2', 0.22, older=SEVEN)
