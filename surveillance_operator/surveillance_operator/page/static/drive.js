// Driving by hand, as long as a button or a key is held; and telling the robot where it is.
import {$, h, act} from './dom.js';

const PERIOD = 100;
const WAYS = {
  forward: ['▲', 'Drive ahead', 1, 0, 'ArrowUp'], left: ['◀', 'Turn left', 0, 1, 'ArrowLeft'],
  right: ['▶', 'Turn right', 0, -1, 'ArrowRight'], back: ['▼', 'Drive back', -.6, 0, 'ArrowDown'],
};

export class Drive {
  constructor(map) {
    this.held = new Set();
    const said = h('output', {id: 'drive-said'});
    this.said = said;
    const speed = this.speed = h('input', {type: 'range', min: .1, max: .6, step: .05, value: .25, 'aria-label': 'Speed, metres per second'});
    const pads = Object.entries(WAYS).map(([name, [sign, label]]) => {
      const pad = h('button', {type: 'button', class: `pad ${name}`, 'data-drive': name, 'aria-label': `${label} while held`}, sign);
      pad.addEventListener('pointerdown', (event) => { event.preventDefault(); pad.setPointerCapture(event.pointerId); this.hold(name); });
      for (const end of ['pointerup', 'pointercancel', 'lostpointercapture']) pad.addEventListener(end, () => this.release(name));
      pad.addEventListener('contextmenu', (event) => event.preventDefault());
      return pad;
    });
    const box = h('div', {class: 'pads', tabindex: 0, role: 'group', 'aria-label': 'Drive by hand: hold an arrow key'}, ...pads);
    box.addEventListener('keydown', (event) => this.key(event, true));
    box.addEventListener('keyup', (event) => this.key(event, false));
    // Whatever takes the hand off the page stops the robot.
    for (const what of ['blur', 'pagehide']) addEventListener(what, () => this.stop());
    box.addEventListener('focusout', () => this.stop());
    document.addEventListener('visibilitychange', () => { if (document.hidden) this.stop(); });
    $('drive').append(h('details', {}, h('summary', {}, 'Drive by hand'), h('p', {class: 'note'}, 'It pauses the mission and drives as long as you hold; what stands in the way stops it. Go on ends it.'), box, h('label', {}, 'Speed ', speed), said),
      h('div', {class: 'row'}, h('button', {type: 'button', id: 'set-pose', onclick: () => this.pose(map)}, 'Set where it is'), h('output', {id: 'pose-said'})));
  }

  key(event, down) {
    const way = Object.keys(WAYS).find((name) => WAYS[name][4] === event.key);
    if (!way) return;
    event.preventDefault();
    if (down) this.hold(way); else this.release(way);
  }

  hold(way) {
    this.held.add(way);
    if (this.timer) return;
    this.timer = setInterval(() => this.send(), PERIOD);
    this.send();
  }

  release(way) {
    if (this.held.delete(way) && !this.held.size) this.stop();
  }

  stop() {
    if (!this.timer) return;
    clearInterval(this.timer);
    this.timer = null;
    this.held.clear();
    this.send();
  }

  async send() {
    // No second one while one is on its way: what is late is not queued.
    if (this.sending && this.held.size) return;
    this.sending = true;
    const ways = [...this.held].map((name) => WAYS[name]);
    const sum = (place) => Math.max(-1, Math.min(1, ways.reduce((all, each) => all + each[place], 0)));
    const found = await act('drive', {speed: sum(2) * this.speed.value, turn: .8 * sum(3)});
    this.sending = false;
    this.said.textContent = found.ok ? found.text : `✗ ${found.text}`;
    if (!found.ok) this.stop();
  }

  pose(map) {
    map.aim('press where the robot is, and drag to where it looks', async ([x, y, yaw]) => {
      const found = await act('pose', {x, y, yaw});
      $('pose-said').textContent = (found.ok ? '✓ ' : '✗ ') + found.text;
    });
  }
}
