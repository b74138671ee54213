// A strip for each place's idleness, one for the battery, one for what happened, over the last hour.
import {h, s, age} from './dom.js';

const HOUR = 3600, W = 600, H = 30;
const SIGNS = {recharge: '⚡', failure: '✗', recovery: '↻', help: '?'};
let names = '';

function build(root, places) {
  const strip = (name) => s('svg', {viewBox: `0 0 ${W} ${H}`, preserveAspectRatio: 'none', role: 'img', 'data-strip': name, 'aria-label': name});
  const row = (name, drawn) => [h('span', {}, name), drawn, h('span', {'data-value': name, class: 'n'}, '')];
  root.replaceChildren(
    ...places.flatMap((name) => row(name, strip(name))),
    ...row('battery', strip('battery')),
    ...row('events', h('div', {class: 'marks', 'data-strip': 'events'})),
    h('span', {}, ''), h('div', {class: 'axis'}, h('span', {id: 'axis-start'}, ''), h('span', {}, 'now')), h('span', {}, ''),
    h('p', {class: 'note', id: 'strip-note'}, ''));
}

function sawtooth(visits, since, now, x, y) {
  let d = `M0 ${H}`, last = visits[0] ?? since;
  for (const at of visits) {
    if (at > since) d += `L${x(Math.max(last, since))} ${y(Math.max(0, since - last))}L${x(at)} ${y(at - last)}L${x(at)} ${H}`;
    last = at;
  }
  return [`${d}L${x(Math.max(last, since))} ${y(Math.max(0, since - last))}L${W} ${y(now - last)}L${W} ${H}Z`, now - last];
}

export function drawStrips(root, state, now) {
  const history = state.history;
  if (!history) return;
  const places = Object.keys(state.places ?? {});
  const key = places.join(' ');
  if (key !== names || !root.childElementCount) {
    names = key;
    build(root, places);
  }
  const element = (kind, name) => root.querySelector(`[data-${kind}="${CSS.escape(name)}"]`);
  const first = Math.min(now - 60, ...history.visits.slice(0, 1).map((v) => v[0]), ...history.battery.slice(0, 1).map((b) => b[0]));
  const since = Math.max(now - HOUR, first);
  const threshold = state.mission?.threshold || 120;
  const x = (at) => Math.round(10 * W * Math.max(0, (at - since) / (now - since))) / 10;
  const y = (idle) => Math.round(10 * (H - H * Math.min(1, Math.max(0, idle) / (threshold * 1.5)))) / 10;
  for (const place of places) {
    const visits = history.visits.filter((v) => v[1] === place).map((v) => v[0]);
    const known = state.places[place].visited;
    if (known !== null && !visits.some((v) => Math.abs(v - known) < 1)) visits.push(known);
    visits.sort((a, b) => a - b);
    const [d, idle] = sawtooth(visits, since, now, x, y);
    element('strip', place).replaceChildren(s('path', {class: 'fill', d}), s('path', {class: 'limit', d: `M0 ${y(threshold)}H${W}`}));
    const value = element('value', place);
    value.textContent = (visits.length ? age(idle) : 'never') + (idle > threshold ? ' !' : '');
    value.classList.toggle('over', idle > threshold);
  }
  const level = (percent) => H - 2 - (H - 4) * percent / 100;
  const charge = history.battery.map(([at, percent], i) => `${i ? 'L' : 'M'}${x(at)} ${level(percent)}`).join('') + (history.battery.length ? `H${W}` : '');
  element('strip', 'battery').replaceChildren(s('path', {class: 'charge', d: charge}));
  element('value', 'battery').textContent = state.battery ? `${Math.round(state.battery.level)} %` : '–';
  const marks = history.marks.filter((mark) => mark[0] > since);
  // Where marks would cover each other, one stands for all of its kind.
  const shown = new Map();
  for (const [at, kind, text] of marks) {
    const slot = `${kind} ${Math.floor(x(at) / 16)}`;
    shown.set(slot, {at, kind, texts: [...shown.get(slot)?.texts ?? [], text]});
  }
  element('strip', 'events').replaceChildren(...[...shown.values()].map(({at, kind, texts}) => {
    const mark = h('span', {title: `${kind}: ${[...new Set(texts)].join('; ')}${texts.length > 1 ? ` (${texts.length} times)` : ''}`}, SIGNS[kind] ?? '•');
    mark.style.left = `${Math.min(98, 100 * x(at) / W)}%`;
    return mark;
  }));
  element('value', 'events').textContent = String(marks.length);
  root.querySelector('#axis-start').textContent = `${age(now - since)} ago`;
  root.querySelector('#strip-note').textContent = `dashed: threshold ${age(threshold)} · ⚡ recharge · ✗ failure · ↻ recovery · ? help`;
}
