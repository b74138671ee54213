// The timeline of the shift: a mark for each event, and a slider that shows the page as it was.
import {$, h, s, ask, shown, timeOfDay} from './dom.js';
import {level} from './alarms.js';
import {headline} from './head.js';

const PERIOD = 10000;
const MOST = 1000;
const STEPS = 1000;
const WIDTH = 1000, HEIGHT = 24;

export class Shift {
  // `past` is shown parts as they were at a time; null: as they are now.
  constructor({wall, past, choose}) {
    Object.assign(this, {wall, past, choose, looks: 0});
    $('shift-section').hidden = false;
    $('shift-hours').addEventListener('change', () => this.draw());
    $('shift-slider').addEventListener('input', () => this.scrub());
    $('shift-live').addEventListener('click', () => this.live());
    setInterval(() => { if (!document.hidden) this.draw(); }, PERIOD);
    this.draw();
  }

  get span() {
    const end = this.wall();
    return [end - 3600 * $('shift-hours').value, end];
  }

  async draw() {
    if (this.looking) return;
    const [begin, end] = this.span;
    const found = await ask('search', {begin, end, severity: 'notice', most: MOST});
    if (!found.ok) return;
    this.between = [begin, end];
    const x = (at) => WIDTH * Math.max(0, Math.min(1, (at - begin) / (end - begin)));
    const svg = $('shift-marks');
    svg.setAttribute('viewBox', `0 0 ${WIDTH} ${HEIGHT}`);
    // The worst on top.
    const marks = found.events.toSorted((a, b) => a.severity - b.severity);
    svg.replaceChildren(...marks.map((event) => s('rect', {class: `bar ${level(event)}${event.state === 'over' ? ' past' : ''}`, x: x(event.began), y: 2, height: HEIGHT - 4,
      width: Math.max(3, x(event.ended ?? (event.state === 'over' ? event.last : end)) - x(event.began)), 'data-mark': event.key, onclick: () => this.choose(event)},
    s('title', {}, `${timeOfDay(event.began)} ${headline(event)}`))));
    $('shift-from').textContent = `${new Date(1000 * begin).toLocaleDateString('en-GB')} ${timeOfDay(begin)}`;
    $('shift-to').textContent = `${new Date(1000 * end).toLocaleDateString('en-GB')} ${timeOfDay(end)}`;
  }

  scrub() {
    const share = $('shift-slider').value / STEPS;
    if (share === 1) { this.live(); return; }
    const [begin, end] = this.between ?? this.span;
    this.look(begin + share * (end - begin));
  }

  // One question at a time: while one is answered, the newest wish waits.
  async look(at) {
    this.wanted = at;
    this.looking = true;
    if (this.busy) return;
    this.busy = true;
    while (this.wanted !== null) {
      const asked = this.wanted;
      this.wanted = null;
      const found = await ask('past', {at: asked, robot: shown.robot});
      if (!this.looking) break;
      $('shift-live').hidden = false;
      $('shift-moment').textContent = found.ok ? `as it was at ${timeOfDay(asked)}` : found.text;
      if (found.ok) this.past(found, asked);
    }
    this.busy = false;
  }

  live() {
    if (!this.looking) return;
    this.looking = false;
    this.wanted = null;
    $('shift-slider').value = STEPS;
    $('shift-live').hidden = true;
    $('shift-moment').textContent = '';
    this.past(null);
    this.draw();
  }
}
