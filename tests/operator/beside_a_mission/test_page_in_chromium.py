"""The page in a real Chromium, beside a real mission: everything on it is seen to change."""

from __future__ import annotations

import os
import signal
from collections.abc import Iterator

import pytest

from tests.launcher.conftest import Started
from tests.operator.browser import CHROMIUM, DESK, DRIVER, MISSING, PHONE, Viewer

pytestmark = [
    pytest.mark.skipif(not (CHROMIUM and DRIVER), reason=MISSING),
]


@pytest.fixture(scope='module')
def viewer(mission: Started) -> Iterator[Viewer]:
    address = mission.until(r'the mission is shown at (\S+)')[1]
    viewer = Viewer(address)
    viewer.until(lambda: viewer.count('[data-place]') == 7)
    yield viewer
    viewer.close()


def asked_until(viewer: Viewer, button: str, seen: str, failed: str) -> None:
    """Wait for an answer; ask again where the busy mission gave none within its deadline."""

    def answered() -> int:
        if viewer.count(failed):
            viewer.click(button)
        return viewer.count(seen)

    viewer.until(answered)


def done(viewer: Viewer, words: str) -> None:
    viewer.until(lambda: words in viewer.text('#done'))
    assert viewer.text('#done').startswith('✓')


def test_the_map_shows_the_robot_moving(viewer: Viewer) -> None:
    assert viewer.attribute('#map image', 'href').startswith('data:image/png')
    viewer.changes(lambda: viewer.attribute('.robot', 'style'))
    viewer.until(lambda: 'M' in viewer.attribute('.lidar', 'd'))
    viewer.until(lambda: 'L' in viewer.attribute('path.plan', 'd'))
    viewer.changes(lambda: viewer.attribute('path.driven', 'd'))
    assert viewer.count('.door') == 7
    assert viewer.count('.door-name') == 7
    assert viewer.text('#connection') == 'live'


def test_the_decision_and_the_proof_of_a_fact_can_be_read(viewer: Viewer) -> None:
    viewer.until(lambda: viewer.text('#decision-line').startswith('decision'))
    assert viewer.count('#scores tbody tr') >= 1
    assert len(viewer.text('#reason')) > 20
    viewer.changes(lambda: viewer.text('#decision-line'), 100)  # a whole leg on a busy machine
    viewer.js("document.querySelector('[data-place=R3]').dispatchEvent(new Event('click'))")
    asked_until(viewer, '#ask-facts', '[data-fact]', '#facts .warn')
    viewer.click('[data-fact] summary')
    asked_until(viewer, '[data-fact] summary', '.proof li', '[data-fact] .warn')
    assert 'hasDoor' in viewer.text('.proof')


def test_why_not_is_answered(viewer: Viewer) -> None:
    viewer.js("document.querySelector('#place').value = 'R4'")
    viewer.click('#why-not')
    viewer.until(lambda: 'R4' in viewer.text('#answer'))
    assert 'warn' not in viewer.attribute('#answer p', 'class')


def test_the_machine_is_drawn_and_lit(viewer: Viewer) -> None:
    viewer.until(lambda: viewer.count('#machine .leaf.on'))
    assert viewer.count('#machine .leaf') > 8
    assert viewer.count('#machine path.last') == 1
    assert '→' in viewer.text('#transitions li')
    viewer.changes(lambda: viewer.js('return mission.state.transitions.at(-1)[0]'))


def test_the_strips_of_time_run(viewer: Viewer) -> None:
    assert viewer.count('[data-strip]') == 9
    viewer.changes(lambda: viewer.text('[data-value=E]'))
    viewer.until(lambda: '%' in viewer.text('[data-value=battery]'))
    assert 'L' in viewer.attribute('[data-strip=E] .fill', 'd')


def test_every_node_is_seen_to_be_up(viewer: Viewer) -> None:
    viewer.until(lambda: viewer.count('#nodes .up') >= 6)
    assert 'armor_server' in viewer.text('#nodes')
    viewer.until(lambda: viewer.count('#events li'))


def test_the_camera_shows_images(viewer: Viewer) -> None:
    viewer.js("document.querySelector('#camera-section').scrollIntoView()")
    viewer.until(lambda: viewer.js("return document.querySelector('#camera').naturalWidth"))
    viewer.changes(lambda: viewer.attribute('#camera', 'src'))
    viewer.js('scrollTo(0, 0)')


def test_hands_change_the_mission_and_say_what_came_of_it(viewer: Viewer) -> None:
    viewer.js("document.querySelector('select[name=door]').value = 'D4'")
    viewer.js("[...document.querySelectorAll('[data-act=door]')].at(1).click()")
    done(viewer, 'D4')
    viewer.until(lambda: 'shut' in viewer.attribute('[data-door=D4]', 'class'))
    viewer.js("document.querySelector('[data-act=door]').click()")
    viewer.until(lambda: 'shut' not in viewer.attribute('[data-door=D4]', 'class'))

    viewer.click('[data-act=obstacle]')  # x and y are missing: the browser says so
    for name, value in (('x', '16'), ('y', '16')):
        viewer.js(f"document.querySelector('input[name={name}]').value = '{value}'")
    viewer.click('[data-act=obstacle]')
    done(viewer, 'obstacle box')
    viewer.click('[data-act=remove_obstacle]')
    done(viewer, 'gone')

    viewer.js("document.querySelector('input[name=seconds]').value = '90'")
    viewer.click('[data-act=threshold]')
    done(viewer, 'urgency_threshold is 90 s')
    viewer.until(lambda: viewer.js('return mission.state.mission.threshold') == 90)
    viewer.js("document.querySelector('select[name=place]').value = 'R2'")
    viewer.click('[data-act=go]')
    done(viewer, 'R2')
    viewer.js("document.querySelector('input[name=seconds]').value = '-5'")
    viewer.click('[data-act=threshold]')
    viewer.until(lambda: viewer.text('#done').startswith('✗'))


def test_the_machine_pauses_and_goes_on(viewer: Viewer) -> None:
    viewer.click('[data-machine=pause]')
    viewer.until(lambda: not viewer.js("return document.querySelector('#paused').hidden"))
    viewer.click('[data-machine=resume]')
    viewer.until(lambda: viewer.js("return document.querySelector('#paused').hidden"))


def test_a_room_is_chosen_by_keyboard(viewer: Viewer) -> None:
    from selenium.webdriver.common.keys import Keys

    viewer.js("document.querySelector('[data-place]').focus()")
    reached = []
    for _ in range(7):
        focused = viewer.driver.switch_to.active_element
        reached.append(focused.get_attribute('data-place'))
        if reached[-1] == 'E':
            focused.send_keys(Keys.ENTER)
            break
        focused.send_keys(Keys.TAB)
    assert reached[-1] == 'E', reached
    viewer.until(lambda: 'What is known of E' in viewer.text('#facts'))


def test_without_the_token_nobody_can_act(viewer: Viewer) -> None:
    viewer.driver.delete_all_cookies()
    viewer.driver.get(viewer.address.partition('?')[0])
    viewer.until(lambda: viewer.count('[data-place]') == 7)
    assert viewer.js("return document.querySelector('#hands').hidden")
    script = """
        const [done] = arguments;
        fetch('/act/door', {method: 'POST', body: '{"door": "D1", "open": false}'})
          .then((answer) => done(answer.status));
    """
    assert viewer.driver.execute_async_script(script) == 403
    viewer.driver.get(viewer.address)
    viewer.until(lambda: viewer.count('[data-place]') == 7)
    assert not viewer.js("return document.querySelector('#hands').hidden")


@pytest.mark.parametrize('size', [PHONE, DESK], ids=['phone', 'desk'])
@pytest.mark.parametrize('dark', [False, True], ids=['light', 'dark'])
def test_axe_finds_nothing(viewer: Viewer, size: tuple[int, int], dark: bool) -> None:
    viewer.size(*size, dark=dark)
    assert viewer.js('return document.documentElement.scrollWidth') <= size[0]
    found = viewer.axe()
    viewer.size(*DESK)
    assert found == []


def complaints(viewer: Viewer, *expected: str) -> list[str]:
    """Return the errors in the browser's log since the last look, but for expected words."""
    messages = [
        each['message'] for each in viewer.driver.get_log('browser') if each['level'] == 'SEVERE'
    ]
    # Refused actions are answered with 4xx, which browsers log.
    return [each for each in messages if not any(w in each for w in ('status of 4', *expected))]


def test_a_lost_connection_is_shown_and_mended(viewer: Viewer, mission: Started) -> None:
    assert complaints(viewer) == []
    process = int(mission.until(r'started mission_page \(process (\d+)\)')[1])
    os.kill(process, signal.SIGKILL)
    viewer.until(lambda: 'lost' in viewer.text('#connection'))
    viewer.until(lambda: viewer.text('#connection') == 'live')
    viewer.changes(lambda: viewer.attribute('.robot', 'style'))


def test_the_browser_has_nothing_to_complain_about(viewer: Viewer) -> None:
    # The server was killed: whatever was on its way failed, in any of Chromium's words for that.
    assert complaints(viewer, 'net::ERR_') == []
