// The events of all that was recorded: searched by words, time, place, kind, severity, state; one in detail; what is muted.
import {$, h, act, ask} from './dom.js';
import {buttons, facts, film, level, moment, pictures, said, stateName} from './alarms.js';
import {headline} from './head.js';
import {open, typing, whenShown} from './views.js';

const PAGE = 100;
const WAIT = 250;
const HOUR = 3600;
const local = (at) => { const d = new Date(1000 * at); return new Date(d - 60000 * d.getTimezoneOffset()).toISOString().slice(0, 16); };
const seconds = (text) => (text ? new Date(text).getTime() / 1000 : '');

export class Search {
  // `jump` goes to an event's moment in a replay; null: this is none.
  constructor({may, operator, wall, jump}) {
    Object.assign(this, {may, operator, wall, jump, skip: 0, chosen: null});
    this.form = $('search');
    this.form.addEventListener('submit', (event) => { event.preventDefault(); this.look(); });
    this.form.addEventListener('reset', () => setTimeout(() => this.look()));
    this.form.addEventListener('input', () => { clearTimeout(this.timer); this.timer = setTimeout(() => this.look(), WAIT); });
    $('more').addEventListener('click', () => this.look(this.skip + PAGE));
    $('last-night').addEventListener('click', () => { this.between(...this.night()); this.look(); });
    whenShown('events', () => this.begin());
    document.addEventListener('keydown', (event) => {
      if (event.key !== '/' || typing(event)) return;
      event.preventDefault();
      open('events');
      setTimeout(() => this.form.elements.text.focus());
    });
    this.handOver();
    this.quiet();
  }

  // The night that was last, 20:00 to 06:00 or to now.
  night() {
    const end = new Date(1000 * this.wall());
    const begin = new Date(end);
    if (end.getHours() < 20) begin.setDate(begin.getDate() - 1);
    begin.setHours(20, 0, 0, 0);
    const morning = new Date(begin.getTime() + 10 * 3600000);
    return [begin / 1000, Math.min(morning, end) / 1000];
  }

  between(begin, end) {
    this.form.elements.begin.value = local(begin);
    this.form.elements.end.value = local(end);
  }

  async begin() {
    if (document.documentElement.dataset.search !== '1') { $('search-said').textContent = 'nothing is kept of this run'; return; }
    const found = await ask('choices', {});
    if (!found.ok) { $('search-said').textContent = found.text; return; }
    const fill = (name, values, all) => {
      const list = this.form.elements[name], now = list.value;
      list.replaceChildren(h('option', {value: ''}, all), ...values.map((value) => h('option', {value}, stateName(value))));
      if (values.includes(now)) list.value = now;
    };
    fill('place', found.places, 'everywhere');
    fill('kind', found.kinds, 'all');
    fill('severity', found.severities, 'all');
    fill('state', found.states, 'all');
    const kinds = [...new Set(['person', 'door', 'object', 'marker', 'light', 'view', 'way', ...found.kinds])];
    for (const form of ['mute', 'rule']) $(form).elements.kind.replaceChildren(...kinds.map((kind) => h('option', {}, kind)));
    this.look();
  }

  async look(skip = 0) {
    if (document.documentElement.dataset.search !== '1') return;
    const given = Object.fromEntries(new FormData(this.form));
    const asked = {...given, begin: seconds(given.begin), end: seconds(given.end), skip, most: PAGE};
    const number = this.asked = (this.asked ?? 0) + 1;
    const found = await ask('search', asked);
    if (number !== this.asked) return;
    this.skip = skip;
    if (!found.ok) { $('search-said').textContent = found.text; return; }
    $('search-said').textContent = `${found.count} ${found.count === 1 ? 'event' : 'events'}`;
    const now = this.wall();
    const rows = found.events.map((event) => h('li', {class: `${level(event)} ${event.state === 'over' ? 'past' : 'going'}`},
      h('button', {type: 'button', class: 'plain', 'data-event': event.key, onclick: () => this.show(event)},
        h('time', {}, moment(event.began, now)), h('b', {}, level(event)), ` ${headline(event)}`, h('span', {class: 'note'}, ` ${stateName(event.state)}${event.by ? ` by ${event.by}` : ''}`))));
    if (skip) $('found').append(...rows);
    else $('found').replaceChildren(...(rows.length ? rows : [h('li', {}, 'nothing was found')]));
    $('more').hidden = found.count <= skip + PAGE;
  }

  show(event, answer = null) {
    const now = this.wall();
    this.chosen = event.key;
    $('chosen').replaceChildren(h('p', {class: `strong ${level(event)}`}, headline(event)), h('p', {class: 'note'}, `${level(event)}, ${stateName(event.state)}, run ${event.run}`),
      ...facts(event, now).map((text) => h('p', {class: 'note'}, text)),
      this.jump ? h('button', {type: 'button', 'data-jump-to': event.began, onclick: () => this.jump(event.began)}, 'Go to this moment') : '',
      pictures(event), ...said(event, now),
      this.may && event.id ? buttons(event, (found) => this.again(event.key, found)) : '', film(event),
      h('p', {role: 'status', class: answer?.ok === false ? 'warn' : 'ok'}, answer ? (answer.ok ? '✓ ' : '✗ ') + answer.text : ''));
    if (matchMedia('(max-width: 61.9rem)').matches) $('chosen-section').scrollIntoView();
  }

  async again(key, answer) {
    // The log has it a moment later.
    await new Promise((done) => setTimeout(done, 400));
    const found = await ask('event', {key});
    if (found.ok) this.show(found.event, answer);
    this.look();
  }

  handOver() {
    const form = $('report');
    const link = (begin, end, as, form) => `/get/report?begin=${Math.round(begin)}&end=${Math.round(end)}&of=${as}&form=${form}`;
    $('reports-section').hidden = document.documentElement.dataset.reports !== '1';
    const now = this.wall();
    form.elements.begin.value = local(now - 8 * HOUR);
    form.elements.end.value = local(now);
    form.addEventListener('submit', (event) => {
      event.preventDefault();
      window.open(link(seconds(form.elements.begin.value), seconds(form.elements.end.value), 'shift', event.submitter?.value ?? 'html'), '_blank', 'noopener');
    });
    for (const [id, hours, as] of [['report-shift', 8, 'shift'], ['report-day', 24, 'day'], ['report-week', 168, 'week']]) {
      const set = () => { const end = this.wall(); $(id).href = link(end - hours * HOUR, end, as, 'html'); };
      set();
      $(id).addEventListener('click', set);
    }
  }

  quiet() {
    const tell = (found) => { $('quiet-said').textContent = (found.ok ? '✓ ' : '✗ ') + found.text; };
    $('quiet-section').hidden = document.documentElement.dataset.mutes !== '1';
    $('mute').addEventListener('submit', async (event) => { event.preventDefault(); tell(await act('mute', Object.fromEntries(new FormData($('mute'))))); });
    $('rule').addEventListener('submit', async (event) => { event.preventDefault(); tell(await act('rule', Object.fromEntries(new FormData($('rule'))))); });
    if (!this.operator || document.documentElement.dataset.sinks !== '1') return;
    whenShown('events', async () => {
      const found = await act('sinks', {});
      const names = found.ok && !found.text.startsWith('none') ? found.text.split(', ') : [];
      $('sinks').hidden = !names.length;
      $('sinks').replaceChildren(...names.map((sink) => h('button', {type: 'button', 'data-sink': sink, onclick: async () => tell(await act('test_sink', {sink}))}, `Test message to ${sink}`)));
    });
  }

  muted(mutes) {
    const lines = mutes.map(({kind, hours, by, note}) => h('li', {}, `${kind}: ${hours}, by ${by}${note ? `: ${note}` : ''} `,
      this.may ? h('button', {type: 'button', 'data-unmute': kind, onclick: () => act('unmute', {kind})}, 'End') : null));
    $('mutes').replaceChildren(...(lines.length ? lines : [h('li', {}, 'nothing is muted')]));
  }
}
