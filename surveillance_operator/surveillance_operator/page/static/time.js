// A strip for each place's idleness, one for the battery, one for what happened, over the last hour.
import {$, h, s, age, limit, names, wait} from './dom.js';

const HOUR = 3600, W = 600, H = 30;
const SIGNS = {recharge: '⚡', failure: '✗', recovery: '↻', help: '?'};
const drawn = new Map();
let built = '';

function build(root, places) {
  const strip = (name) => s('svg', {viewBox: `0 0 ${W} ${H}`, preserveAspectRatio: 'none', role: 'img', 'data-strip': name, 'aria-label': name});
  const row = (name, strip) => {
    drawn.set(name, {strip, value: h('span', {'data-value': name, class: 'n'}, '')});
    return [h('span', {}, name), strip, drawn.get(name).value];
  };
  drawn.clear();
  root.replaceChildren(
    ...places.flatMap((name) => row(name, strip(name))),
    ...row('battery', strip('battery')),
    ...row('events', h('div', {class: 'marks', 'data-strip': 'events'})),
    h('span', {}, ''), h('div', {class: 'axis'}, h('span', {id: 'axis-start'}, ''), h('span', {}, 'now')), h('span', {}, ''),
    h('p', {class: 'note', id: 'strip-note'}, ''));
}

// A saw: it rises from each visit, or from where the strip begins, to the next one.
function sawtooth(visits, since, now, x, y) {
  const rise = (from, to) => `L${x(Math.max(from, since))} ${y(Math.max(0, since - from))}L${x(to)} ${y(to - from)}L${x(to)} ${H}`;
  let d = `M0 ${H}`, last = since;
  for (const at of visits) {
    if (at > since) d += rise(last, at);
    last = at;
  }
  return `${d}${rise(last, now)}Z`;
}

export function drawStrips(root, state, now) {
  const {history, mission} = state;
  if (!history) return;
  const places = names(state.places);
  const key = JSON.stringify(places);
  if (key !== built) {
    built = key;
    build(root, places);
  }
  const waits = places.map((place) => wait(state, place, now));
  const since = Math.max(now - HOUR, Math.min(now - 60, ...waits.map(({seconds}) => now - seconds), ...[history.visits[0], history.battery[0]].filter(Boolean).map(([at]) => at)));
  const threshold = Math.max(0, ...places.map((place) => limit(state, place) ?? 0));
  const top = 1.5 * (threshold || Math.max(60, ...waits.map(({seconds}) => seconds)));
  const x = (at) => Math.round(10 * W * Math.max(0, (at - since) / (now - since))) / 10;
  const y = (idle) => Math.round(10 * (H - H * Math.min(1, Math.max(0, idle) / top))) / 10;
  const visited = Object.groupBy(history.visits, ([, place]) => place);
  places.forEach((place, number) => {
    const visits = (visited[place] ?? []).map(([at]) => at);
    const known = state.places[place].visited;
    if (known !== null && !visits.some((at) => Math.abs(at - known) < 1)) visits.push(known);
    const own = limit(state, place);
    const line = own ? s('path', {class: 'limit', d: `M0 ${y(own)}H${W}`}) : '';
    const {strip, value} = drawn.get(place);
    strip.replaceChildren(s('path', {class: 'fill', d: sawtooth(visits.sort((a, b) => a - b), since, now, x, y)}), line);
    value.textContent = waits[number].text;
    value.classList.toggle('over', waits[number].late);
  });
  const level = (percent) => H - 2 - (H - 4) * percent / 100;
  const charge = history.battery.map(([at, percent], i) => `${i ? 'L' : 'M'}${x(at)} ${level(percent)}`).join('') + (history.battery.length ? `H${W}` : '');
  drawn.get('battery').strip.replaceChildren(s('path', {class: 'charge', d: charge}));
  drawn.get('battery').value.textContent = history.battery.length ? `${Math.round(history.battery.at(-1)[1])} %` : '–';
  drawMarks(drawn.get('events').strip, history.marks.filter(([at]) => at > since), (at) => x(at) / W);
  drawn.get('events').value.textContent = String(history.marks.filter(([at]) => at > since).length);
  root.querySelector('#axis-start').textContent = `${age(now - since)} ago`;
  const usual = mission?.threshold;
  const dashed = usual ? `dashed: threshold ${age(usual)}, or the place's own · ` : '';
  root.querySelector('#strip-note').textContent = `${dashed}⚡ recharge · ✗ failure · ↻ recovery · ? help`;
}

// What can be kept of each place, those that cannot first.
export function showIdlenessBounds({idleness_bounds, kept: words}) {
  const order = ['never', 'later', 'unknown', 'closed', 'within'];
  const found = names(idleness_bounds).sort((a, b) => order.indexOf(idleness_bounds[a].verdict) - order.indexOf(idleness_bounds[b].verdict));
  const kept = found.filter((name) => idleness_bounds[name].verdict === 'within').length;
  $('idleness').hidden = !found.length;
  // Recordings of before have no words for all of them.
  $('idleness-line').textContent = words ?? `${kept} of ${found.length} places can be visited within their thresholds`;
  $('idleness-line').classList.toggle('warn', found.some((name) => idleness_bounds[name].verdict === 'never'));
  $('idleness-list').replaceChildren(...found.map((name) => {
    const {verdict, words, hours} = idleness_bounds[name];
    return h('li', {class: verdict === 'never' ? 'warn' : null}, words, hours ? h('small', {}, ` (${hours})`) : null);
  }));
}

// Marks that would cover each other are one, with a sign for each kind.
function drawMarks(root, marks, share) {
  const shown = Object.entries(Object.groupBy(marks, ([at]) => Math.floor(24 * Math.min(.999, share(at)))));
  root.replaceChildren(...shown.map(([slot, several]) => {
    const kinds = [...new Set(several.map(([, kind]) => kind))];
    const told = [...new Set(several.map(([, kind, text]) => `${kind}: ${text}`))];
    const mark = h('span', {title: told.join('; ') + (several.length > told.length ? ` (${several.length} events)` : '')}, kinds.map((kind) => SIGNS[kind] ?? '•').join(''));
    mark.style.left = `${100 * slot / 23}%`;
    mark.style.translate = `${-100 * slot / 23}%`;
    return mark;
  }));
}
