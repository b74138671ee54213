// The robots of a fleet: what each does and why, what is wrong with it, and what it can be told to do.
import {$, h, act, colour, figuresOf, names, shown} from './dom.js';

const SHARED = 'shared programs';
// Of two words that undo each other the one that changes something is offered.
const WORDS = [
  ['pause', 'Pause', ({active}) => !active?.paused], ['go', 'Go', ({active}) => active?.paused],
  ['stop', 'Stop', ({stopped}) => !stopped], ['release', 'Release', ({stopped}) => stopped],
  ['out', 'Take out', ({out}) => !out], ['in', 'Put back', ({out}) => out],
];

export class Fleet {
  constructor(robots, may, choose) {
    this.robots = robots;
    this.may = may;
    this.choose = choose;
    this.rows = new Map();
    $('fleet-all').hidden = !may;
    for (const button of document.querySelectorAll('[data-all]')) button.addEventListener('click', () => this.tell(button.dataset.all, 'all'));
    $('stop-all').addEventListener('click', () => this.tell('stop', 'all', 'stop-answer'));
  }

  get isOne() {
    return !names(this.robots).some(Boolean);
  }

  show() {
    const known = names(this.robots).sort((a, b) => !a - !b);
    $('fleet').hidden = this.isOne;
    $('stop-all').hidden = this.isOne || !this.may;
    const alarms = this.isOne ? [] : known.flatMap((name) => (this.robots[name].troubles ?? []).map((text) => `${name || SHARED}: ${text}`));
    this.alarm(alarms);
    if (this.isOne) return;
    if (known.join() !== [...this.rows.keys()].join()) {
      this.rows = new Map(known.map((name) => [name, this.row(name)]));
      $('robots').replaceChildren(...[...this.rows.values()].map(({item}) => item));
    }
    for (const name of known) this.fill(name);
  }

  alarm(lines) {
    const said = lines.join('\n');
    if (this.said === said) return;
    this.said = said;
    $('alarms').hidden = !lines.length;
    $('alarms').replaceChildren(...lines.map((text) => h('li', {}, text)));
  }

  row(name) {
    const cells = {doing: h('p', {class: 'doing'}), trouble: h('p', {class: 'warn'}), reason: h('p', {class: 'note'})};
    const select = h('button', {type: 'button', class: 'plain', 'data-choose': name, onclick: () => this.choose(name)},
      name ? h('i', {class: `swatch ${colour(name, this.robots)}`}) : null, h('b', {}, name || SHARED));
    const words = name && this.may ? WORDS.map(([word, label]) => h('button', {type: 'button', 'data-word': word, 'aria-label': `${label} ${name}`, onclick: () => this.tell(word, name)}, label)) : [];
    const item = h('li', {'data-row': name}, select, cells.doing, cells.trouble, cells.reason, h('div', {class: 'row'}, ...words));
    return {item, select, cells, words};
  }

  fill(name) {
    const {doing, shares, out, decision, status, troubles, stopped, active, mission} = this.robots[name];
    const {item, select, cells, words} = this.rows.get(name);
    item.classList.toggle('chosen', name === shown.robot);
    select.setAttribute('aria-pressed', String(name === shown.robot));
    const set = (cell, text) => { if (cell.textContent !== text) cell.textContent = text; cell.hidden = !text; };
    const brief = this.robots[name].brief ?? figuresOf(this.robots[name]).map(([, label, words]) => `${label} ${words}`).join(' · ');
    const words_of = [status?.place, doing, brief, shares].filter(Boolean).join(' · ');
    set(cells.doing, name ? words_of : mission?.running ? 'running' : 'not heard');
    set(cells.trouble, (troubles ?? []).join('; '));
    set(cells.reason, name && decision ? `${decision.from} → ${decision.place} [${decision.rule}]: ${decision.reason}` : '');
    words.forEach((button, number) => { button.hidden = !WORDS[number][2]({stopped, active, out}); });
  }

  // What came of it is also said beside the button that was pressed.
  async tell(word, robot, beside = 'fleet-answer') {
    const say = (text) => { for (const id of ['fleet-answer', beside]) $(id).textContent = text; };
    say('…');
    const found = await act('fleet', {word, robot});
    say((found.ok ? '✓ ' : '✗ ') + found.text);
    $('fleet-answer').className = found.ok ? 'ok' : 'warn';
  }
}
