// What the first look found and the map does not show: a picture of each, accepted or refused by a person.
import {$, h, act, ask, shown} from './dom.js';
import {pictures, told} from './alarms.js';
import {view, whenShown} from './views.js';

const EVERY = 10000;
const metres = (position) => (position ? ` at ${position.map((each) => each.toFixed(1)).join(', ')}` : '');

export class Baseline {
  constructor({may}) {
    Object.assign(this, {may, text: null});
    $('baseline-all').addEventListener('click', () => this.answer('normal baseline'));
    whenShown('desk', () => this.look());
    setInterval(() => { if (view() === 'desk' && !document.hidden) this.look(); }, EVERY);
  }

  async look() {
    const robot = shown.robot;
    const found = await ask('baseline', {});
    if (robot !== shown.robot) return;
    const events = found.events ?? [];
    $('baseline-section').hidden = !events.length && !$('baseline-said').textContent;
    const text = JSON.stringify([robot, events]);
    if (text === this.text) return;
    this.text = text;
    $('baseline').replaceChildren(...events.map((event) => this.thing(event, robot)));
    $('baseline-all').hidden = !this.may || events.filter(({state}) => state === 'open').length < 2;
  }

  thing({number, place, position, evidence, state}, robot) {
    const text = `${number}: a thing in ${place || 'no place'}${metres(position)}`;
    const button = (label, verb) => h('button', {type: 'button', 'data-baseline': verb, 'aria-label': `${label} ${text}`, onclick: () => this.answer(`${verb} ${number}`)}, label);
    const refused = state === 'acknowledged';
    return h('li', {}, h('b', {}, text), refused ? h('span', {class: 'note'}, ' refused') : null,
      this.may ? h('div', {class: 'row'}, button('Accept', 'normal'), refused ? null : button('Refuse', 'acknowledge')) : null,
      pictures({text, evidence, robot, run: ''}));
  }

  async answer(line) {
    told('baseline-said', await act('event', {line}));
    await this.look();
  }
}
