// What the head of each page has while a mission runs: the bar of open alarms, and Stop.
import {$, h, act, age, shown} from './dom.js';

const LOUD = ['unacknowledged', 'returned'];
const BAR = 3;

export const headline = (event) => `${event.robot ? event.robot + ': ' : ''}${event.text}${event.place ? ' in ' + event.place : ''}`;
export const loudOf = (events) => events.filter((each) => each.severity >= 3 && LOUD.includes(each.state));

// The alarms that wait for somebody. `desk` is the address of their cards, `choose` is told which one was pressed, `told` what came of an answer.
export class AlarmBar {
  constructor({may, wall, desk, told, choose = () => {}}) {
    Object.assign(this, {may, wall, desk, told, choose});
  }

  show(loud) {
    const now = this.wall();
    const rest = loud.length - BAR;
    const lines = loud.slice(0, BAR).map((event) => h('li', {'data-bar': event.key},
      h('a', {href: this.desk, onclick: () => this.choose(event.key)}, h('b', {}, event.state === 'returned' ? 'WAS' : 'ALARM'), ` ${headline(event)}`),
      h('span', {class: 'age', 'data-since': event.began}, ` ${age(now - event.began)}`),
      this.may ? h('button', {type: 'button', 'data-verb': 'acknowledge', 'aria-label': `Acknowledge ${event.text}`, onclick: async () => this.told(await act('alarm', {verb: 'acknowledge', key: event.key}))}, 'Acknowledge') : null));
    if (rest > 0) lines.push(h('li', {}, h('a', {href: this.desk}, `and ${rest} more`)));
    const text = lines.map((each) => each.dataset.bar ?? each.textContent).join() + loud.map((each) => each.state).join();
    $('bar').hidden = !lines.length;
    if (text === this.shown) return;
    this.shown = text;
    $('bar').replaceChildren(...lines);
  }

  tick() {
    const now = this.wall();
    for (const each of document.querySelectorAll('[data-since]')) each.textContent = ` ${age(now - each.dataset.since)}`;
  }
}

// Stop and release, which a guard may, too.
export function startStop() {
  for (const [id, on] of [['stop', true], ['release', false]]) {
    $(id).addEventListener('click', async () => {
      $('stop-answer').textContent = (await act('stop', {on})).text;
    });
  }
  // The key stops, wherever one is on the page; not while one types.
  document.addEventListener('keydown', (event) => {
    if (event.key.toLowerCase() !== 's' || event.ctrlKey || event.metaKey || event.altKey || event.repeat) return;
    if (event.target.closest?.('input, select, textarea')) return;
    const button = event.shiftKey && !$('stop-all').hidden ? $('stop-all') : $('stop');
    if (!button.hidden) button.click();
  });
}

// The head of a page that shows nothing else of the mission, as the editor's.
export function startHead({control, guard}) {
  const title = document.title;
  const robots = new Set();
  const say = (found) => { $('stop-answer').textContent = (found.ok ? '✓ ' : '✗ ') + found.text; };
  let behind = 0;
  const bar = new AlarmBar({may: guard, wall: () => Date.now() / 1000 + behind, desk: '/#/desk', told: say});
  $('stop-box').hidden = !guard;
  if (guard) startStop();
  $('stop-all').addEventListener('click', async () => say(await act('fleet', {word: 'stop', robot: 'all'})));
  const source = new EventSource('/events');
  const lost = 'connection lost, trying again';
  source.onerror = () => { $('stop-answer').textContent = lost; };
  source.onopen = () => { if ($('stop-answer').textContent === lost) $('stop-answer').textContent = ''; };
  source.onmessage = ({data}) => {
    const {p: {desk, stopped}, r, robot} = JSON.parse(data);
    shown.robot = robot;
    for (const name of [robot, ...Object.keys(r)]) if (name) robots.add(name);
    $('stop').textContent = robot ? `STOP ${robot}` : 'STOP';
    $('stop').hidden = robots.size > 0 && !robot;
    $('stop-all').hidden = !control || !robots.size;
    if (stopped !== undefined) $('release').hidden = !stopped;
    if (!desk) return;
    behind = desk.at - Date.now() / 1000;
    const loud = loudOf(desk.open);
    document.title = (loud.length ? `(${loud.length}) ` : '') + title;
    bar.show(loud);
  };
  setInterval(() => bar.tick(), 1000);
}
