// What is open: a bar in the head, cards with pictures and buttons, the title, the icon, a sound, the browser's own notices.
import {$, h, s, act, age, timeOfDay} from './dom.js';
import {AlarmBar, headline, loudOf} from './head.js';
import {open, typing, view} from './views.js';

const NAMES = {unacknowledged: 'not acknowledged', returned: 'over, not acknowledged'};
const SHELF = '2 h';
const BEEPS = [0, .25, .5];
const DAY = 86400;

export const level = ({level}) => level ?? 'note';
export const stateName = (state) => NAMES[state] ?? state;
export const moment = (at, now) => `${Math.abs(now - at) > DAY / 2 ? new Date(1000 * at).toLocaleDateString('en-GB') + ' ' : ''}${timeOfDay(at)}`;
const sure = (event) => (event.confidence ? `${Math.round(100 * event.confidence)} % sure` : '');

export function pictures(event) {
  const names = [...new Set(event.evidence ?? [])];
  return h('div', {class: 'pictures'}, ...names.map((name, number) => h('figure', {},
    h('img', {src: `/evidence/${encodeURIComponent(name)}?robot=${encodeURIComponent(event.robot)}&run=${encodeURIComponent(event.run)}`, alt: `${event.text}: ${number ? 'last' : 'first'} sighting, before and after`, loading: 'lazy', onerror: (failed) => failed.target.parentElement.remove()}),
    h('figcaption', {class: 'note'}, names.length > 1 ? (number ? 'last sighting' : 'first sighting') : 'sighting'))));
}

// What came of a press.
export function told(id, found) {
  $(id).textContent = (found.ok ? '✓ ' : '✗ ') + found.text;
  $(id).className = found.ok ? 'ok' : 'warn';
}

// A film of ten seconds around an event, made when somebody asks for it.
export function film(event) {
  const box = h('div');
  const show = () => {
    box.replaceChildren(h('p', {class: 'note', role: 'status'}, 'the film is made …'));
    const image = h('img', {class: 'film', alt: `film of ${event.text}: what the camera saw, and the map`, onload: () => box.replaceChildren(image)});
    fetch(`/get/clip?key=${encodeURIComponent(event.key)}`).then(async (answer) => {
      if (answer.ok) image.src = URL.createObjectURL(await answer.blob());
      else box.replaceChildren(h('p', {class: 'warn'}, await answer.text()));
    }, () => box.replaceChildren(h('p', {class: 'warn'}, 'the mission does not answer')));
  };
  return h('div', {}, h('button', {type: 'button', 'data-film': event.key, onclick: show}, 'Film'), box);
}

export function facts(event, now) {
  return [
    event.rule ? `rule: ${event.rule}` : '',
    `since ${moment(event.began, now)}${event.ended ? `, over ${moment(event.ended, now)}` : ''}`,
    [sure(event), event.looks ? `seen in ${event.looks} ${event.looks === 1 ? 'look' : 'looks'}` : '', event.position ? `at ${event.position.map((each) => each.toFixed(1)).join(', ')}` : ''].filter(Boolean).join(', '),
    event.action ? `to do: ${event.action}` : '',
    event.assigned ? `${event.assigned} is to take care of it` : '',
    event.state === 'shelved' ? `shelved until ${timeOfDay(event.until)}` : '',
    event.calls ? `people were called ${event.calls === 1 ? 'once' : `${event.calls} times`}` : '',
  ].filter(Boolean);
}

export const said = (event, now) => event.said.map(([at, by, text]) => h('p', {class: 'note'}, h('time', {}, moment(at, now)), `${by}: ${text}`));

// The buttons of an event, with a field for a remark; `tell` is told what came of a press.
export function buttons(event, tell) {
  const note = h('input', {class: 'long', 'aria-label': `Remark on ${event.text}`, placeholder: 'remark', maxlength: 500, autocomplete: 'off', 'data-note': event.key});
  const press = async (verb, more = '') => {
    const found = await act('alarm', {verb, key: event.key, note: note.value, more});
    if (found.ok) note.value = '';
    tell(found);
  };
  const whom = h('input', {class: 'short', 'aria-label': 'Assign to', placeholder: 'who', maxlength: 60, autocomplete: 'off'});
  const button = (label, verb, more) => h('button', {type: 'button', 'data-verb': verb, onclick: () => press(verb, more)}, label);
  const shelved = event.state === 'shelved';
  const over = event.state === 'over';
  note.addEventListener('keydown', (key) => { if (key.key === 'Enter') press(event.by ? 'note' : 'acknowledge'); });
  return h('div', {class: 'row answers'}, note,
    event.by || over ? button('Add the remark', 'note') : button('Acknowledge', 'acknowledge'),
    ...(over || event.state === 'returned' ? [] : [shelved ? button('End the shelf', 'unshelve') : button(`Shelve for ${SHELF}`, 'shelve', SHELF)]),
    ...(event.number && !event.answer ? [button('This is normal', 'normal'), button('False alarm', 'false')] : []),
    ...(over ? [] : [whom, h('button', {type: 'button', 'data-verb': 'assign', onclick: () => press('assign', whom.value)}, 'Assign')]));
}

export class Alarms {
  constructor({may, wall, onChoose}) {
    this.may = may;
    this.wall = wall;
    this.onChoose = onChoose;
    this.events = [];
    this.chosen = null;
    this.known = null;
    this.cards = new Map();
    this.bar = new AlarmBar({may, wall, desk: '#/desk', choose: (key) => this.choose(key, true), told: (found) => this.told(found)});
    this.spots = s('g', {class: 'spots'});
    const loud = localStorage.getItem('sound') === 'on';
    $('sound').setAttribute('aria-pressed', String(loud));
    $('sound').addEventListener('click', () => this.toggleSound());
    document.addEventListener('keydown', (event) => this.key(event));
  }

  get loud() {
    return loudOf(this.events);
  }

  show(desk) {
    this.events = desk?.open ?? [];
    const loud = this.loud;
    this.call(loud);
    this.bar.show(loud);
    this.list();
    this.icon(loud.length);
    this.drawSpots();
  }

  // A sound and the browser's own notice for each alert that is new since the page was opened.
  call(loud) {
    const fresh = loud.filter((each) => each.state === 'unacknowledged');
    if (this.known) {
      const come = fresh.filter((each) => !this.known.has(each.id));
      if (come.length && $('sound').getAttribute('aria-pressed') === 'true') this.beep();
      if ('Notification' in window && Notification.permission === 'granted') for (const event of come) new Notification(`Alarm: ${headline(event)}`, {body: event.rule, tag: event.key});
    }
    this.known = new Set([...(this.known ?? []), ...fresh.map((each) => each.id)]);
  }

  async toggleSound() {
    const on = $('sound').getAttribute('aria-pressed') !== 'true';
    $('sound').setAttribute('aria-pressed', String(on));
    localStorage.setItem('sound', on ? 'on' : 'off');
    if (!on) return;
    this.beep();
    if ('Notification' in window && Notification.permission === 'default') await Notification.requestPermission();
  }

  beep() {
    this.audio ??= new AudioContext();
    this.beeps = (this.beeps ?? 0) + 1;
    for (const after of BEEPS) {
      const tone = this.audio.createOscillator(), gain = this.audio.createGain();
      tone.frequency.value = 880;
      gain.gain.value = .2;
      tone.connect(gain).connect(this.audio.destination);
      tone.start(this.audio.currentTime + after);
      tone.stop(this.audio.currentTime + after + .15);
    }
  }

  // A card is made anew only when its event has changed: what somebody types in it stays.
  list() {
    const now = this.wall();
    const cards = new Map();
    for (const event of this.events) {
      const text = JSON.stringify(event) + (this.chosen === event.key);
      const known = this.cards.get(event.key);
      cards.set(event.key, known?.text === text ? known : {text, item: this.card(event, now)});
    }
    const typed = document.activeElement?.dataset?.note;
    const draft = typed ? document.activeElement.value : '';
    this.cards = cards;
    $('alarm-list').replaceChildren(...[...cards.values()].map(({item}) => item));
    if (!cards.size) $('alarm-list').append(h('li', {}, 'none is open'));
    const again = typed && $('alarm-list').querySelector(`[data-note="${CSS.escape(typed)}"]`);
    if (again && document.activeElement !== again) { again.value = draft; again.focus(); }
  }

  card(event, now) {
    const chosen = this.chosen === event.key;
    const whole = chosen || (this.chosen === null && this.events[0]?.key === event.key);
    return h('li', {class: `alarm ${level(event)} ${event.state}${chosen ? ' chosen' : ''}`, 'data-key': event.key},
      h('button', {type: 'button', class: 'plain', 'aria-expanded': String(whole), onclick: () => this.choose(event.key)},
        h('b', {}, headline(event)), h('span', {class: 'age', 'data-since': event.began}, ` ${age(now - event.began)}`), h('span', {class: 'note'}, ` ${stateName(event.state)}${event.by ? ` by ${event.by}` : ''}`)),
      whole ? h('div', {class: 'details'}, ...facts(event, now).map((text) => h('p', {class: 'note'}, text)), pictures(event), ...said(event, now),
        this.may ? buttons(event, (found) => this.told(found)) : null, film(event)) : null);
  }

  told(found) {
    told('alarm-said', found);
  }

  choose(key, stay = false) {
    this.chosen = this.chosen === key && !stay ? null : key;
    this.list();
    this.drawSpots();
    const event = this.events.find((each) => each.key === key);
    if (this.chosen && event) this.onChoose(event);
  }

  key(event) {
    if (typing(event) || view() !== 'desk' || !this.events.length) return;
    const at = this.events.findIndex((each) => each.key === this.chosen);
    if (event.key === 'j') this.choose(this.events[Math.min(this.events.length - 1, at + 1)].key, true);
    else if (event.key === 'k') this.choose(this.events[Math.max(0, at - 1)].key, true);
    else if (event.key === 'a' && this.may) {
      const wanted = this.events[at] ?? this.loud[0];
      if (wanted) act('alarm', {verb: 'acknowledge', key: wanted.key}).then((found) => this.told(found));
    }
  }

  // How many wait for somebody, on the tab's icon.
  icon(count) {
    if (count === this.counted) return;
    this.counted = count;
    const canvas = h('canvas', {width: 32, height: 32});
    const pen = canvas.getContext('2d');
    pen.fillStyle = count ? '#b3132b' : '#0a6b4b';
    pen.beginPath();
    pen.arc(16, 16, 15, 0, 2 * Math.PI);
    pen.fill();
    pen.fillStyle = '#fff';
    pen.font = 'bold 22px sans-serif';
    pen.textAlign = 'center';
    if (count) pen.fillText(count > 9 ? '9+' : String(count), 16, 24);
    $('icon').href = canvas.toDataURL();
  }

  drawSpots() {
    this.spots.replaceChildren(...this.events.filter((each) => each.position).map((event) => s('circle', {
      class: `spot ${level(event)}${this.chosen === event.key ? ' chosen' : ''}`, cx: event.position[0], cy: -event.position[1], r: .45,
      onclick: (click) => { click.stopPropagation(); open('desk'); this.choose(event.key, true); }}, s('title', {}, headline(event)))));
  }
}
