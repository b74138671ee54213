// What the observer has noticed: a timeline, and of each event its pictures, its spot on the map, and what a person says of it.
import {$, h, s, act, ask, shown, timeOfDay} from './dom.js';

const PERIOD = 2000;
const MOST = 60;
const DAY = 86400;
const VERBS = {acknowledge: 'Acknowledge', normal: 'This is normal from now on', false: 'False alarm'};
const OPEN = ['open', 'acknowledged'];
const ALERT = 3;

const level = ({severity}) => ['note', 'notice', 'warning', 'alert'][Math.min(ALERT, severity ?? 0)];
const words = (event) => `${event.kind}${event.subject ? ' ' + event.subject : ''} ${event.seen}${event.place ? ' in ' + event.place : ''}`;
const moment = (at, now) => `${now - at > DAY ? new Date(1000 * at).toLocaleDateString('en-GB') + ' ' : ''}${timeOfDay(at)}`;

export class Watching {
  // Told how many alerts are open, and the latest of them in words.
  constructor(may, now, onAlerts) {
    this.may = may;
    this.onAlerts = onAlerts;
    this.now = now;
    this.chosen = null;
    this.told = null;
    this.ring = s('g', {class: 'spots'});
    $('map').append(this.ring);
    $('watch-notify').hidden = !('Notification' in window) || Notification.permission !== 'default';
    $('watch-notify').addEventListener('click', async () => {
      await Notification.requestPermission();
      $('watch-notify').hidden = Notification.permission !== 'default';
    });
    setInterval(() => this.look(), PERIOD);
    this.look();
  }

  async look() {
    if (document.hidden && Notification?.permission !== 'granted') return;
    const found = await ask('sightings', {});
    if (!found.ok) return;
    $('watching-section').hidden = $('watching-link').hidden = !found.watching;
    const text = JSON.stringify(found);
    // Its ends go with the time, which is not known yet when the page is opened.
    if (text === this.text) { this.timeline(this.events); return; }
    this.text = text;
    this.events = found.events;
    this.notify();
    const open = this.events.filter((each) => each.state === 'open' && each.severity >= ALERT).sort((a, b) => b.last - a.last);
    this.onAlerts(open.length, open.length ? `${words(open[0])}, since ${timeOfDay(open[0].began)}` : '');
    this.show(found);
  }

  // A browser's own notification for each alert that is new since the page was opened.
  notify() {
    const alerts = this.events.filter((each) => each.state === 'open' && each.severity >= ALERT).map((each) => each.number);
    if (this.told && 'Notification' in window && Notification.permission === 'granted') {
      for (const number of alerts.filter((each) => !this.told.has(each))) {
        const event = this.events.find((each) => each.number === number);
        new Notification(`Alert: ${words(event)}`, {body: event.rule ?? '', tag: `event ${number}`});
      }
    }
    this.told = new Set([...(this.told ?? []), ...alerts]);
  }

  show({events, alerts, answered, false: wrong}) {
    const open = events.filter((each) => OPEN.includes(each.state));
    $('watch-rate').textContent = `${open.length} open of ${events.length}; ${alerts} ${alerts === 1 ? 'alert' : 'alerts'}, ${answered} answered, ${wrong} false (${alerts ? Math.round(100 * wrong / alerts) : 0} %)`;
    this.timeline(events);
    // Those that need a person first.
    const order = [...events].sort((a, b) => OPEN.includes(b.state) - OPEN.includes(a.state) || b.severity - a.severity || b.last - a.last);
    const now = this.now();
    $('watch-events').replaceChildren(...order.slice(0, MOST).map((event) => h('li', {class: `${level(event)} ${OPEN.includes(event.state) ? 'going' : 'past'}`},
      h('button', {type: 'button', class: 'plain', 'data-event': event.number, 'aria-expanded': String(this.chosen === event.number), onclick: () => this.choose(event.number)},
        h('b', {}, level(event)), ` ${words(event)} `, h('time', {}, moment(event.began, now)), h('span', {class: 'note'}, ` ${event.state}`)),
      this.chosen === event.number ? this.details(event, now) : null)));
    if (!events.length) $('watch-events').append(h('li', {}, 'nothing yet'));
    this.spots(open);
  }

  choose(number) {
    this.chosen = this.chosen === number ? null : number;
    this.answer = '';
    this.show(JSON.parse(this.text));
  }

  details(event, now) {
    const pictures = [...new Set(event.evidence ?? [])];
    const lines = [
      `event ${event.number}: first ${moment(event.began, now)}, last ${moment(event.last, now)}`,
      `${event.sightings} ${event.sightings === 1 ? 'sighting' : 'sightings'} in ${event.looks} ${event.looks === 1 ? 'look' : 'looks'} by ${(event.robots ?? []).join(', ')}, confidence ${Math.round(100 * event.confidence)} %`,
      event.position ? `at ${event.position.map((each) => each.toFixed(1)).join(', ')}` : '',
      event.rule ? `rule: ${event.rule}` : '',
    ].filter(Boolean);
    const buttons = this.may && OPEN.includes(event.state) ? h('div', {class: 'row'}, ...Object.entries(VERBS).map(([verb, text]) =>
      h('button', {type: 'button', 'data-answer': verb, onclick: () => this.say(verb, event.number)}, text))) : null;
    return h('div', {class: 'details'}, ...lines.map((text) => h('p', {class: 'note'}, text)),
      h('div', {class: 'pictures'}, ...pictures.map((name, index) => h('figure', {},
        h('img', {src: `/evidence/${encodeURIComponent(name)}?robot=${encodeURIComponent(shown.robot)}`, alt: `${words(event)}: ${index ? 'last' : 'first'} sighting, before and after`, loading: 'lazy'}),
        h('figcaption', {class: 'note'}, pictures.length > 1 ? (index ? 'last sighting' : 'first sighting') : 'sighting')))),
      buttons, h('p', {role: 'status', class: 'note'}, this.answer ?? ''));
  }

  async say(verb, number) {
    const found = await act('event', {line: `${verb} ${number}`});
    this.answer = (found.ok ? '✓ ' : '✗ ') + found.text;
    this.text = '';
    await this.look();
  }

  // One bar for each event from its first to its last sighting, the newest day or less.
  timeline(events) {
    const now = this.now();
    const begin = Math.max(now - DAY, Math.min(now - 600, ...events.map((each) => each.began)));
    const shown = events.filter((each) => each.last >= begin).slice(0, MOST);
    const x = (at) => 100 * Math.max(0, Math.min(1, (at - begin) / (now - begin || 1)));
    const lanes = [];
    const bars = [...shown].sort((a, b) => a.began - b.began).map((event) => {
      const from = x(event.began), to = Math.max(from + 1, x(OPEN.includes(event.state) ? now : event.last));
      let lane = lanes.findIndex((end) => end <= from);
      if (lane < 0) lane = lanes.length;
      lanes[lane] = to + .5;
      return s('rect', {class: `bar ${level(event)} ${OPEN.includes(event.state) ? '' : 'past'}`, x: from, y: 7 * lane + 1, width: to - from, height: 5, onclick: () => this.choose(event.number)},
        s('title', {}, `${words(event)}, ${timeOfDay(event.began)}`));
    });
    const high = 7 * Math.max(1, lanes.length) + 1;
    const svg = $('watch-timeline');
    svg.setAttribute('viewBox', `0 0 100 ${high}`);
    svg.style.height = `${Math.min(8, .7 * Math.max(1, lanes.length) + .2)}rem`;
    svg.replaceChildren(...bars);
    $('watch-from').textContent = moment(begin, now);
    $('watch-to').textContent = timeOfDay(now);
  }

  spots(open) {
    this.ring.replaceChildren(...open.filter((each) => each.position).map((event) => s('circle', {
      class: `spot ${level(event)}${this.chosen === event.number ? ' chosen' : ''}`, cx: event.position[0], cy: -event.position[1], r: .45,
      onclick: (click) => { click.stopPropagation(); this.choose(event.number); }}, s('title', {}, words(event)))));
  }
}
