"""One whole mission, looked at from outside: console and watch on a terminal, the page in Chromium.

Tests without it come first, and those in the browser last, which draws for as long as it is open.
"""

from __future__ import annotations

import os
import signal
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest

from surveillance_runtime.testing import claim_domain
from tests.launcher.conftest import ROOT, Started
from tests.operator.browser import CHROMIUM, DESK, DRIVER, MISSING, PHONE, Viewer
from tests.operator.ports import free_port
from tests.operator.terminal import Terminal

LAUNCH = [str(ROOT / '.venv/bin/python'), str(ROOT / 'launch.py')]
Open = Callable[..., Terminal]


@pytest.fixture(scope='module')
def mission_domain() -> int:
    """Provide a ROS domain that no test in this process uses."""
    return claim_domain()


@pytest.fixture(scope='module')
def mission(mission_domain: int) -> Iterator[Started]:
    """Provide a patrol at twice real time, with a page that may control it."""
    port = free_port(mission_domain)  # a page that is started again keeps its address
    words = ['--composed', '--web-control', '--web-address', f'127.0.0.1:{port}']
    words += ['--domain', str(mission_domain), '--record', 'off']
    words += ['-p', 'speed:=2.0', '--params', str(ROOT / 'config/fast.yaml')]
    # Drawing pictures is most of a mission's work, and what is larger than a datagram gets lost.
    words += ['-p', 'camera.width:=160', '-p', 'camera.height:=120', '-p', 'camera.rate:=5.0']
    started = Started([*LAUNCH, *words])
    started.until('decision 1')
    yield started
    started.end(signal.SIGINT)


@pytest.fixture
def terminal(mission_domain: int, tmp_path: Path) -> Iterator[Open]:
    opened: list[Terminal] = []

    def start(*words: str, columns: int = 80, rows: int = 40) -> Terminal:
        environ = {'XDG_STATE_HOME': str(tmp_path)}
        command = [*LAUNCH, *words, '--domain', str(mission_domain)]
        opened.append(Terminal(command, columns, rows, environ))
        return opened[-1]

    yield start
    for each in opened:
        each.close()


def test_arm_and_battery_are_set_from_the_terminal_of_mode_manual(
    terminal: Open, tmp_path: Path
) -> None:
    words = ['--mode', 'MANUAL', '--behaviour', 'patrol', '--namespace', 'manual']
    nodes = ('console', 'simulator', 'arm_controller', 'battery_controller')
    words += ['--composed', '--only', ','.join(nodes), '--record', str(tmp_path)]
    manual = terminal(*words, columns=120, rows=60)
    manual.until(*(f'{name:<18} | ready' for name in nodes))
    manual.type('arm up\r')
    manual.until("arm: 'up': expected left, home, right, back")
    manual.type('arm left\r')
    manual.until('at pose left')
    manual.type('battery set 10\r')
    manual.until('The battery is at 10 %')
    manual.type('exit\r')
    assert manual.ended() == 0


def test_the_console_answers_completes_remembers_and_ends(mission: Started, terminal: Open) -> None:
    console = terminal('console')
    console.until('why not ROOM', 'console>')
    console.until('· in ', 'battery')  # the status line
    console.type('why\r')
    console.until('decision')
    console.type('why n\t')  # completion
    console.until('console> why not')
    console.type(' R77\r')
    console.until("no place 'R77'", 'expected')
    console.type('door close D4\r')
    console.until('D4 is closed')
    console.type('\x1b[A\x1b[A\x7f\x7f\x7fR4\r')  # history: the line before the last, changed
    console.until('console> why not R4', 'R4')
    console.type('door open D4\r')
    console.until('D4 is open')
    console.type('pause\r')
    console.until('paused', 'PAUSED')
    console.type('resume\r')
    console.until('going on')
    assert all(len(line) <= 80 for line in console.lines)
    console.type('\x04')  # the end of the input
    assert console.ended() == 0

    again = terminal('console')
    again.until('console>')
    again.type('\x1b[A')  # the history outlives the console
    again.until('console> resume')
    again.type('\x03')  # Ctrl-C
    assert again.ended() == 0


def test_watch_fits_eighty_columns_and_its_keys_change_it(mission: Started, terminal: Open) -> None:
    watch = terminal('watch', rows=30)
    shown = watch.until('q quit', 'e events', 'battery', 'decision', 'R1')
    assert '…' not in shown.splitlines()[0]
    assert shown.rstrip().endswith('e events')
    watch.type('d')
    watch.until('policy tour', 'chosen')
    watch.type('n')
    watch.until('armor_server', 'up')
    watch.type('e')
    watch.until('arrived in')
    watch.type('ep')
    watch.until('HELD')
    watch.type('q')
    assert watch.ended() == 0


@pytest.fixture(scope='module')
def viewer(mission: Started) -> Iterator[Viewer]:
    if not (CHROMIUM and DRIVER):
        pytest.skip(MISSING)
    shown = mission.until(r'the mission is shown at (\S+) \(its token is in ([^)]+)\)')
    viewer = Viewer(f'{shown[1]}?token={Path(shown[2]).read_text().strip()}')
    viewer.until(lambda: viewer.count('[data-place]') == 7)
    yield viewer
    viewer.close()


def leg(viewer: Viewer) -> tuple[str, str]:
    """Return the decision and the last transition that the page shows."""
    last = viewer.js('return mission.state.transitions.at(-1)[0]')
    return viewer.text('#decision-line'), last


@pytest.fixture(scope='module')
def first_leg(viewer: Viewer) -> tuple[str, str]:
    """Provide what a page that was just opened shows of the mission's leg."""
    viewer.until(lambda: viewer.count('#machine path.last'))
    return leg(viewer)


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


@pytest.mark.usefixtures('first_leg')
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
    viewer.js("document.querySelector('[data-place=R3]').dispatchEvent(new Event('click'))")
    asked_until(viewer, '#ask-facts', '[data-fact]', '#facts .warn')
    # The first fact may be that it is URGENT, which follows from times.
    viewer.click('[data-fact^=ROOM] summary')
    asked_until(viewer, '[data-fact^=ROOM] summary', '.proof li', '[data-fact] .warn')
    assert 'hasDoor' in viewer.text('.proof')


def test_why_not_is_answered(viewer: Viewer) -> None:
    viewer.js("document.querySelector('#place').value = 'R4'")
    viewer.click('#why-not')
    asked_until(viewer, '#why-not', '#answer .strong', '#answer .warn')
    assert 'R4' in viewer.text('#answer')


def test_the_machine_is_drawn_and_lit(viewer: Viewer) -> None:
    viewer.until(lambda: viewer.count('#machine .leaf.on'))
    assert viewer.count('#machine .leaf') > 8
    assert viewer.count('#machine path.last') == 1
    assert '→' in viewer.text('#transitions li')


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


def test_control_changes_the_mission_and_say_what_came_of_it(viewer: Viewer) -> None:
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
    done(viewer, 'urgency_threshold of robot_behavior is 90')
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
    assert viewer.js("return document.querySelector('#control').hidden")
    script = """
        const [done] = arguments;
        fetch('/act/door', {method: 'POST', body: '{"door": "D1", "open": false}'})
          .then((answer) => done(answer.status));
    """
    assert viewer.driver.execute_async_script(script) == 403
    viewer.driver.get(viewer.address)
    viewer.until(lambda: viewer.count('[data-place]') == 7)
    assert not viewer.js("return document.querySelector('#control').hidden")


# test_page_states.py has dark phones and light desks.
@pytest.mark.parametrize(
    ('size', 'dark'), [(PHONE, False), (DESK, True)], ids=['light phone', 'dark desk']
)
def test_axe_finds_nothing(viewer: Viewer, size: tuple[int, int], dark: bool) -> None:
    viewer.size(*size, dark=dark)
    assert viewer.js('return document.documentElement.scrollWidth') <= size[0]
    found = viewer.axe()
    viewer.size(*DESK)
    assert found == []


def test_decision_and_machine_follow_the_mission_to_its_next_leg(
    viewer: Viewer, first_leg: tuple[str, str]
) -> None:
    def both_changed() -> bool:
        decision, transition = leg(viewer)
        return decision != first_leg[0] and transition != first_leg[1]

    viewer.until(both_changed)


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
