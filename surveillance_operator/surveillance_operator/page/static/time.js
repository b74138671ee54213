// A strip for each room's idleness and one for the battery, over the last hour.
import {h, s, age} from './dom.js';

const HOUR = 3600, W = 600, H = 30;
const SIGNS = {recharge: '⚡', failure: '✗', recovery: '↻', help: '?'};
let names = '';

export function drawStrips(root, state, now) {
  const history = state.history;
  if (!history) return;
  const places = Object.keys(state.places ?? {});
  const key = places.join(' ');
  if (key !== names || !root.childElementCount) {
    names = key;
    root.replaceChildren(...[...places, 'battery', 'events'].flatMap((name) => [
      h('span', {}, name), s('svg', {viewBox: `0 0 ${W} ${H}`, preserveAspectRatio: 'none', role: 'img', 'data-strip': name, 'aria-label': name}), h('span', {'data-value': name}, '')]));
  }
  const first = Math.min(now - 60, ...history.visits.slice(0, 1).map((v) => v[0]), ...history.battery.slice(0, 1).map((b) => b[0]));
  const since = Math.max(now - HOUR, first);
  const x = (at) => Math.round(10 * W * Math.max(0, (at - since) / (now - since))) / 10;
  const threshold = state.mission?.threshold || 120;
  const top = threshold * 1.5;
  const y = (idle) => Math.round(10 * (H - H * Math.min(1, Math.max(0, idle) / top))) / 10;
  for (const place of places) {
    const svg = root.querySelector(`[data-strip="${CSS.escape(place)}"]`);
    const visits = history.visits.filter((v) => v[1] === place).map((v) => v[0]);
    const known = state.places[place].visited;
    if (known !== null && !visits.includes(known) && !visits.some((v) => Math.abs(v - known) < 1)) visits.push(known);
    visits.sort((a, b) => a - b);
    let d = `M0 ${H}`, last = visits[0] ?? since;
    for (const at of visits) { if (at > since) { d += `L${x(Math.max(last, since))} ${y(Math.max(0, since - last))}L${x(at)} ${y(at - last)}L${x(at)} ${H}`; } last = at; }
    d += `L${x(Math.max(last, since))} ${y(Math.max(0, since - last))}L${W} ${y(now - last)}L${W} ${H}Z`;
    svg.replaceChildren(s('path', {class: 'fill', d}), s('path', {class: 'limit', d: `M0 ${y(threshold)}H${W}`}));
    const idle = now - last;
    const value = root.querySelector(`[data-value="${CSS.escape(place)}"]`);
    value.textContent = visits.length ? age(idle) + (idle > threshold ? ' !' : '') : '–';
    value.classList.toggle('over', idle > threshold);
  }
  const battery = history.battery;
  const charge = battery.map(([at, level], i) => `${i ? 'L' : 'M'}${x(at)} ${H - H * level / 100}`).join('') + (battery.length ? `H${W}` : '');
  root.querySelector('[data-strip=battery]').replaceChildren(s('path', {class: 'charge', d: charge}));
  root.querySelector('[data-value=battery]').textContent = state.battery ? `${Math.round(state.battery.level)} %` : '–';
  root.querySelector('[data-strip=events]').replaceChildren(...history.marks.filter((m) => m[0] > since).map(([at, kind, text]) =>
    s('text', {class: 'mark', x: x(at), y: 20}, SIGNS[kind] ?? '•', s('title', {}, `${kind}: ${text}`))));
  root.querySelector('[data-value=events]').textContent = `${history.marks.length}`;
}
