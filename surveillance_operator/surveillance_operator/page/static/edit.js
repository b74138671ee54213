// The place's editor: draws what the server knows of the place, and sends what a person wants of it.
// What a change means, and whether it may be, is decided by the server.
import {$, h, s, act, ask, names} from './dom.js';
import {startHead} from './head.js';

const may = document.documentElement.dataset.edit === '1';
const {live, control, guard} = document.documentElement.dataset;
$('live-link').hidden = live !== '1';
if (live === '1') startHead({control: control === '1', guard: guard === '1'});
const TOOLS = {
  select: ['Select', 'v', 'Tap a room, a door or a zone; drag its handle to move it; drag the floor to look around. Dashed doors and ringed rooms are doubtful.'],
  cut: ['Cut', 'c', 'Draw a line through a room, or tap its two ends. It is carried on to the walls.'],
  join: ['Join', 'j', 'Tap a door: the rooms on both sides become one. Or tap a room, then the one that becomes a part of it.'],
  wall: ['Wall', 'x', 'Tap a door: a wall closes it.'],
  door: ['Door', 'd', 'Tap where two rooms meet.'],
  keep_out: ['Keep out', 'k', 'Drag a rectangle, or tap the corners and press Done.'],
  slow: ['Slow', 'w', 'Drag a rectangle, or tap the corners and press Done. Its speed is 0.3 m/s at first.'],
  station: ['Station', 't', 'Tap where another robot charges.'],
  marker: ['Marker', 'm', 'Tap where the marker hangs.'],
};
const SPEED = 0.3;
const svg = $('floor');
let place = null;
let tool = 'select';
let chosen = null;
let points = [];
let first = null;
let view = null;
let moved = null;
const layers = Object.fromEntries(['picture', 'zones', 'doors', 'grips', 'words', 'draft', 'aim'].map((name) => [name, s('g')]));
svg.append(...Object.values(layers));

// --- what the server says ---

function take(found) {
  if (found.place) {
    place = found.place;
    if (!view) whole();
    draw();
  }
  for (const id of ['floor-section', 'chosen-section']) $(id).hidden = !place;
  $('keep-label').hidden = !place;
  if (found.text) {
    $('said').textContent = (found.ok ? '✓ ' : '✗ ') + found.text;
    $('said').className = found.ok ? 'ok' : 'warn';
  }
  return found;
}

const send = async (name, fields = {}) => take(await act(name, fields));
const edit = (operation, fields) => send('edit', {operation, fields});

async function roomAt([x, y]) {
  const found = await ask('room_at', {x, y});
  return found.room ?? null;
}

// --- the view: metres, y upwards ---

function whole() {
  const [w, b, e, t] = place.picture.box;
  view = {x: (w + e) / 2, y: (b + t) / 2, span: Math.max(e - w, (t - b) * ratio()) * 1.06};
}

const ratio = () => Math.max(svg.clientWidth, 1) / Math.max(svg.clientHeight, 1);
const pixel = () => view.span / Math.max(svg.clientWidth, 1);

function aim() {
  const width = view.span;
  const height = width / ratio();
  svg.setAttribute('viewBox', `${view.x - width / 2} ${-view.y - height / 2} ${width} ${height}`);
  const p = pixel();
  layers.aim.replaceChildren(s('path', {class: 'cross', d: `M${view.x - 10 * p} ${-view.y}h${20 * p}M${view.x} ${-view.y - 10 * p}v${20 * p}`, 'stroke-width': 2 * p}));
}

function pointOf(event) {
  const box = svg.getBoundingClientRect();
  return [view.x + (event.clientX - box.left - box.width / 2) * pixel(), view.y - (event.clientY - box.top - box.height / 2) * pixel()];
}

function zoom(factor, [x, y] = [view.x, view.y]) {
  const span = Math.min(Math.max(view.span * factor, 1), 5000);
  const f = span / view.span;
  view = {x: x + (view.x - x) * f, y: y + (view.y - y) * f, span};
  draw();
}

// --- drawing ---

const round = (value) => Math.round(value * 1000) / 1000;
const path = (corners) => corners.map(([x, y], i) => `${i ? 'L' : 'M'}${x} ${-y}`).join('') + 'Z';
const is = (kind, name) => chosen?.kind === kind && chosen.name === name;

function grip(kind, name, [x, y], more = {}) {
  const p = pixel();
  const on = is(kind, name) ? ' on' : '';
  const small = kind === 'corner' ? 6 : 8;
  const mark = s('circle', {class: `grip ${kind}${on}`, cx: x, cy: -y, r: small * p, 'stroke-width': 2 * p, 'data-kind': kind, 'data-name': name, ...more});
  mark.append(s('title', {}, `${kind} ${name}`));
  return mark;
}

function word(text, [x, y], size, dy = 0) {
  const p = pixel();
  return s('text', {x, y: -y + dy * p, 'font-size': size * p, 'stroke-width': 3 * p}, text);
}

function draw() {
  if (!place || !view) return;
  aim();
  const p = pixel();
  const {png, box: [w, b, e, t]} = place.picture;
  if (layers.picture.dataset.png !== png) {
    layers.picture.dataset.png = png;
    layers.picture.replaceChildren(s('image', {href: png, x: w, y: -t, width: e - w, height: t - b, preserveAspectRatio: 'none'}));
  }
  layers.zones.replaceChildren(...Object.entries(place.zones).map(([name, zone]) => s('path', {
    class: `zone ${zone.kind}${is('zone', name) ? ' on' : ''}`, d: path(zone.corners), 'stroke-width': 2 * p, 'data-kind': 'zone', 'data-name': name})));
  layers.doors.replaceChildren(...Object.entries(place.doors).map(([name, {line: [x1, y1, x2, y2]}]) => s('line', {
    class: `door${is('door', name) ? ' on' : ''}${place.doors[name].doubtful ? ' doubtful' : ''}`, x1, y1: -y1, x2, y2: -y2, 'stroke-width': 4 * p, 'data-kind': 'door', 'data-name': name})));
  const grips = [];
  const words = [];
  for (const [name, {at}] of Object.entries(place.doors)) {
    grips.push(grip('door', name, at));
    if (p < 0.03) words.push(word(name, at, 10, -12));
  }
  for (const [room, {point, keep_out: barred, doubtful}] of Object.entries(place.rooms)) {
    grips.push(grip('room', room, point));
    if (doubtful) words.push(s('circle', {class: 'doubtful', cx: point[0], cy: -point[1], r: 14 * p, 'stroke-width': 2 * p}));
    words.push(word(barred ? `${room} (kept out of)` : room, point, 14, -13));
  }
  for (const [room, pose] of Object.entries(place.stations)) {
    grips.push(grip('station', room, pose));
    words.push(word('⚡', pose, 11, 4));
  }
  for (const [name, {id, at}] of Object.entries(place.markers)) {
    grips.push(grip('marker', name, at));
    words.push(word(`${id}`, at, 11, -11));
  }
  for (const [name, {at}] of Object.entries(place.left_out)) {
    grips.push(grip('left_out', name, at));
    words.push(word('+', at, 13, 5));
  }
  for (const [name, {kind, corners, speed}] of Object.entries(place.zones)) {
    words.push(word(kind === 'slow' ? `${name} ${speed} m/s` : name, corners[0], 11, -8));
    if (is('zone', name)) corners.forEach((corner, index) => grips.push(grip('corner', name, corner, {'data-index': index})));
  }
  layers.grips.replaceChildren(...grips);
  layers.words.replaceChildren(...words);
  drawDraft();
  panel();
}

function drawDraft() {
  if (!view) return;
  const p = pixel();
  const line = points.map(([x, y], i) => `${i ? 'L' : 'M'}${x} ${-y}`).join('');
  layers.draft.replaceChildren(s('path', {class: 'draft', d: line + (points.length > 2 ? 'Z' : ''), 'stroke-width': 3 * p}), ...points.map(([x, y]) => s('circle', {class: 'draft', cx: x, cy: -y, r: 4 * p})));
}

// --- the panel: what is chosen, and its numbers ---

const FIELDS = {
  room: (name) => {
    const room = place.rooms[name];
    return [
      ['name', 'Name', name, (value) => ['rename', {kind: 'room', name, new: value}]],
      ['class', 'Class', room.class, (value) => ['set_rule', {room: name, key: 'classes', value}], [['', `by its doors: ${room.by_doors}`], ['ROOM', 'ROOM'], ['CORRIDOR', 'CORRIDOR']]],
      ['threshold', 'URGENT after, s (empty: as everywhere)', room.threshold, (value) => ['set_rule', {room: name, key: 'thresholds', value}]],
      ['exploration', 'Explored for, s (empty: as everywhere)', room.exploration, (value) => ['set_rule', {room: name, key: 'exploration', value}]],
      ['hours', 'Hours, as mon-fri 08:00-18:00', room.hours, (value) => ['set_rule', {room: name, key: 'hours', value}]],
      ['keep_out', 'never entered', room.keep_out, (value) => ['set_keep_out', {room: name, on: value}]],
      ['sweep', 'a visit covers all of it', room.sweep, (value) => ['set_sweep', {room: name, on: value}]],
      ['x', 'Point x, m', room.point[0], (value) => ['move_point', {room: name, x: value, y: room.point[1]}]],
      ['y', 'Point y, m', room.point[1], (value) => ['move_point', {room: name, x: room.point[0], y: value}]],
      ['remove', 'Remove the room and its doors', null, () => ['remove_room', {room: name}]],
    ];
  },
  door: (name) => {
    const {at, joins} = place.doors[name];
    const set = (index) => (value) => ['set_door', Object.fromEntries([['name', name], ...['x', 'y', 'yaw', 'width'].map((key, i) => [key, i === index ? value : at[i]])])];
    return [
      ['name', `Name (joins ${joins.join(' and ')})`, name, (value) => ['rename', {kind: 'door', name, new: value}]],
      ...['x, m', 'y, m', 'direction, rad', 'width, m'].map((text, index) => [`at${index}`, text, at[index], set(index)]),
      ...(joins.length === 2 ? [['join_at', `Join ${joins.join(' and ')}`, null, () => ['join_at', {name}]], ['wall_off', 'Make it a wall', null, () => ['wall_off', {name}]]] : []),
      ['remove', 'Remove the door', null, () => ['remove_door', {name}]],
    ];
  },
  left_out: (name) => {
    const {at: [x, y], area, reason} = place.left_out[name];
    return [['take', `Make a room of these ${area} m² (${reason})`, null, () => ['take_part', {x, y}]]];
  },
  zone: (name) => {
    const {kind, corners, speed} = place.zones[name];
    return [
      ['name', `Name (${kind === 'slow' ? 'slow' : 'keep out'})`, name, (value) => ['rename', {kind: 'zone', name, new: value}]],
      ...(kind === 'slow' ? [['speed', 'Top speed, m/s', speed, (value) => ['set_zone', {kind, name, corners, speed: value}]]] : []),
      ['corners', 'Corners, x y, ...', corners.map((each) => each.join(' ')).join(', '), (value) => ['set_zone', {kind, name, speed, corners: value.split(',').map((each) => each.trim().split(/\s+/))}]],
      ['remove', 'Remove the zone', null, () => ['remove_zone', {name}]],
    ];
  },
  station: (room) => {
    const pose = place.stations[room];
    const set = (index) => (value) => ['move_station', Object.fromEntries([['room', room], ...['x', 'y', 'yaw'].map((key, i) => [key, i === index ? value : pose[i]])])];
    return [
      ...['x, m', 'y, m', 'direction, rad'].map((text, index) => [`at${index}`, text, pose[index], set(index)]),
      ['remove', 'Remove the station', null, () => ['remove_station', {room}]],
    ];
  },
  marker: (name) => {
    const {id, at} = place.markers[name];
    const set = (key) => (value) => ['set_marker', {name, id, x: at[0], y: at[1], z: at[2], yaw: at[3], [key]: value}];
    return [
      ['name', 'Name', name, (value) => ['rename', {kind: 'marker', name, new: value}]],
      ['id', 'Id', id, set('id')],
      ...[['x', 'x, m'], ['y', 'y, m'], ['z', 'height, m'], ['yaw', 'direction that it faces, rad']].map(([key, text], index) => [key, text, at[index], set(key)]),
      ['remove', 'Remove the marker', null, () => ['remove_marker', {name}]],
    ];
  },
};
const WHOLE = () => [
  ['robot_room', 'The robot starts in', place.start, (value) => ['set_text', {key: 'robot_room', value}], names(place.rooms).map((room) => [room, room])],
  ['quiet_hours', 'Quiet hours, as daily 22:00-06:00', place.quiet_hours, (value) => ['set_text', {key: 'quiet_hours', value}]],
  ['time_zone', 'Time zone, as Europe/Rome', place.time_zone, (value) => ['set_text', {key: 'time_zone', value}]],
];
let checking = 0;

async function check(input, change) {
  const turn = ++checking;
  await new Promise((done) => setTimeout(done, 250));
  if (turn !== checking) return;
  const [operation, fields] = change(input.value);
  const found = await act('check_edit', {operation, fields});
  if (turn !== checking) return;
  $('problem').textContent = found.problem ?? found.text ?? '';
  input.setAttribute('aria-invalid', $('problem').textContent ? 'true' : 'false');
}

async function commit(value, change, kind) {
  checking += 1;
  const [operation, fields] = change(value);
  const found = await edit(operation, fields);
  $('problem').textContent = found.ok ? '' : found.text;
  if (!found.ok) return false;
  if (operation === 'rename') choose({kind, name: fields.new});
  else if (operation === 'move_station') choose({kind, name: Object.keys(place.stations).find((room) => Math.hypot(place.stations[room][0] - fields.x, place.stations[room][1] - fields.y) < 0.01) ?? chosen.name});
  else if (operation.startsWith('remove') || operation === 'take_part') choose(null);
  else { panelShows = ''; panel(); }
  return true;
}

function field([key, text, value, change, options], kind) {
  if (value === null && ['remove', 'take'].includes(key)) return h('button', {type: 'button', disabled: !may, 'data-field': key, onclick: () => commit(null, change, kind)}, text);
  if (typeof value === 'boolean') {
    const box = h('input', {type: 'checkbox', disabled: !may, 'data-field': key, onchange: () => commit(box.checked, change, kind)});
    box.checked = value;
    return h('label', {class: 'check'}, box, text);
  }
  if (options) {
    const list = h('select', {disabled: !may, 'data-field': key, onchange: () => commit(list.value, change, kind)}, ...options.map(([each, text]) => h('option', {value: each}, text)));
    list.value = value;
    return h('label', {}, text, list);
  }
  const input = h('input', {disabled: !may, 'data-field': key, autocomplete: 'off', value: value ?? '', oninput: () => check(input, change)});
  // The Enter key tells of a change twice, by itself and as the form is sent: the first one counts.
  let sent = input.value;
  input.addEventListener('change', async () => {
    if (input.value === sent) return;
    sent = input.value;
    if (!await commit(input.value, change, kind)) sent = String(value ?? '');
  });
  return h('label', {}, text, input);
}

let panelShows = '';
function panel() {
  if (chosen && !FIELDS[chosen.kind]) chosen = null;
  const table = chosen && {room: place.rooms, door: place.doors, zone: place.zones, station: place.stations, marker: place.markers, left_out: place.left_out}[chosen.kind];
  if (table && !(chosen.name in table)) chosen = null;
  const shows = JSON.stringify([chosen, table?.[chosen?.name], place.start, place.quiet_hours, place.time_zone, names(place.rooms), place.changes]);
  $('file').textContent = place.file.split('/').at(-1);
  $('changed').textContent = place.changed ? 'changed, not saved' : 'as saved';
  document.title = (place.changed ? '• ' : '') + $('file').textContent;
  $('undo').disabled = !may || !place.undo;
  $('redo').disabled = !may || !place.redo;
  $('undo').title = place.undo ? `take back: ${place.undo}` : '';
  $('save').disabled = !may || !place.changed;
  if (shows === panelShows) return;
  panelShows = shows;
  $('chosen-h').textContent = chosen ? `${chosen.kind.replace('_', ' ')} ${chosen.name}` : 'Nothing chosen';
  const form = h('form', {class: 'fields', 'aria-label': 'What is chosen', onsubmit: (event) => { event.preventDefault(); document.activeElement.dispatchEvent(new Event('change')); }});
  if (chosen) form.append(...FIELDS[chosen.kind](chosen.name).map((each) => field(each, chosen.kind)));
  else form.append(h('p', {class: 'note'}, 'Choose something on the floor or in the list.'));
  $('chosen').replaceChildren(form);
  $('whole-place').replaceChildren(h('h3', {}, 'The whole place'), ...WHOLE().map((each) => field(each)));
  $('changes').hidden = !place.changes.length;
  $('changes').replaceChildren(h('h3', {}, 'Changed since the older map'), h('ul', {}, ...place.changes.map(({kind, name, said, back}) => h('li', {},
    h('button', {type: 'button', class: 'text', disabled: !(kind === 'room' ? place.rooms : place.doors)[name], onclick: () => show(kind, name)}, said),
    ...(back ? [h('button', {type: 'button', disabled: !may, 'aria-label': `Keep as it was: ${kind} ${name}`, onclick: () => send('keep_old', {name})}, 'As it was')] : []),
    h('button', {type: 'button', disabled: !may, 'aria-label': `Take: ${kind} ${name}`, onclick: () => send('take_new', {name})}, 'Take')))));
  $('next-doubtful').hidden = !place.doubtful.length;
  $('next-doubtful').textContent = `Next of ${place.doubtful.length} doubtful (n)`;
  const listed = [['room', place.rooms], ['door', place.doors], ['zone', place.zones], ['station', place.stations], ['marker', place.markers], ['left_out', place.left_out]];
  $('list').replaceChildren(h('option', {value: ''}, '–'), ...listed.flatMap(([kind, entries]) => names(entries).map((name) => h('option', {value: `${kind} ${name}`}, `${kind.replace('_', ' ')} ${name}`))));
  $('list').value = chosen ? `${chosen.kind} ${chosen.name}` : '';
}

// What is doubtful is shown first, the least sure of it at the beginning; it goes round.
function nextDoubtful() {
  const now = place.doubtful.indexOf(chosen ? `${chosen.kind} ${chosen.name}` : '');
  const next = place.doubtful[(now + 1) % place.doubtful.length];
  if (!next) return;
  show(...next.split(' '));
}

function show(kind, name) {
  const [x, y] = kind === 'door' ? place.doors[name].at : place.rooms[name].point;
  view = {...view, x, y, span: Math.min(view.span, 12)};
  choose({kind, name});
}

function choose(what) {
  chosen = what;
  $('problem').textContent = '';
  draw();
}

// --- tools ---

function take_up(name) {
  tool = name;
  points = [];
  first = null;
  for (const button of $('tools').children) if (button.dataset.tool) button.setAttribute('aria-pressed', String(button.dataset.tool === tool));
  $('done').hidden = !['keep_out', 'slow'].includes(tool);
  $('hint').textContent = TOOLS[tool][2];
  drawDraft();
}

async function finish() {
  const corners = points;
  points = [];
  if (tool === 'cut' && corners.length === 2) {
    const [[x1, y1], [x2, y2]] = corners;
    await edit('cut', {x1, y1, x2, y2});
  } else if (['keep_out', 'slow'].includes(tool) && corners.length > 2) {
    const before = new Set(Object.keys(place.zones));
    const found = await edit('set_zone', {kind: tool, corners: corners.map((each) => each.map(round)), ...(tool === 'slow' ? {speed: SPEED} : {})});
    const name = found.ok && Object.keys(place.zones).find((each) => !before.has(each));
    if (name) { take_up('select'); choose({kind: 'zone', name}); }
  }
  drawDraft();
}

// A point was given: by a tap, or by the Enter key at the cross.
async function tap(point, target) {
  if (tool === 'select') {
    const {kind, name} = target?.dataset ?? {};
    if (kind === 'left_out' && may) {
      const {at: [x, y]} = place.left_out[name];
      const found = await edit('take_part', {x, y});
      choose(found.ok ? null : {kind, name});
      return;
    }
    if (kind && kind !== 'corner') { choose({kind, name}); return; }
    const room = await roomAt(point);
    choose(room && {kind: 'room', name: room});
  } else if (tool === 'cut') {
    points.push(point);
    if (points.length === 2) await finish();
    drawDraft();
  } else if (['join', 'wall'].includes(tool) && target?.dataset.kind === 'door' && !first) {
    await edit(tool === 'join' ? 'join_at' : 'wall_off', {name: target.dataset.name});
  } else if (tool === 'wall') {
    $('hint').textContent = TOOLS.wall[2];
  } else if (tool === 'join') {
    const room = target?.dataset.kind === 'room' ? target.dataset.name : await roomAt(point);
    if (!room) return;
    if (!first) {
      first = room;
      $('hint').textContent = `${room}: now tap the room that becomes a part of it.`;
    } else {
      await edit('join', {first, second: room});
      take_up('join');
    }
  } else if (['keep_out', 'slow'].includes(tool)) {
    points.push(point);
    drawDraft();
  } else {
    const [x, y] = point.map(round);
    const before = Object.keys(place[`${tool}s`]);
    const found = await edit({door: 'add_door', station: 'add_station', marker: 'set_marker'}[tool], tool === 'marker' ? {id: 1, x, y, z: 1, yaw: 0} : {x, y});
    const name = found.ok && Object.keys(place[`${tool}s`]).find((each) => !before.includes(each));
    if (name) { const kind = tool; take_up('select'); choose({kind, name}); }
  }
}

async function drop({kind, name, index}, [x, y]) {
  const at = {x: round(x), y: round(y)};
  if (kind === 'room') await edit('move_point', {room: name, ...at});
  if (kind === 'door') await edit('move_door', {name, ...at});
  if (kind === 'station') {
    const before = Object.keys(place.stations);
    const found = await edit('move_station', {room: name, ...at, yaw: place.stations[name][2]});
    if (found.ok) chosen = {kind, name: Object.keys(place.stations).find((room) => !before.includes(room)) ?? name};
  }
  if (kind === 'marker') {
    const {id, at: [, , z, yaw]} = place.markers[name];
    await edit('set_marker', {name, id, ...at, z, yaw});
  }
  if (kind === 'corner') {
    const {kind: zone, corners, speed} = place.zones[name];
    await edit('set_zone', {kind: zone, name, speed, corners: corners.map((each, i) => i === Number(index) ? [at.x, at.y] : each)});
  }
  draw();
}

// --- mouse, finger and pen ---

const down = new Map();
const NEAR = 8;

svg.addEventListener('pointerdown', (event) => {
  svg.setPointerCapture(event.pointerId);
  svg.focus({preventScroll: true});
  const at = pointOf(event);
  down.set(event.pointerId, {at, x: event.clientX, y: event.clientY, now: event});
  if (down.size === 1) moved = {start: at, far: false, target: event.target.closest('[data-name]'), drags: may && event.target.classList.contains('grip')};
  else moved = {pinch: true};
});

svg.addEventListener('pointermove', (event) => {
  const mine = down.get(event.pointerId);
  if (!mine || !moved) return;
  if (moved.pinch) {
    const [a, b] = [...down.values()];
    if (!b) return;
    const before = [a.now, b.now];
    const gap = Math.hypot(before[0].clientX - before[1].clientX, before[0].clientY - before[1].clientY);
    const middle = pointOf({clientX: (before[0].clientX + before[1].clientX) / 2, clientY: (before[0].clientY + before[1].clientY) / 2});
    mine.now = event;
    const after = Math.hypot(a.now.clientX - b.now.clientX, a.now.clientY - b.now.clientY);
    if (gap > 0 && after > 0) {
      zoom(gap / after, middle);
      const there = pointOf({clientX: (a.now.clientX + b.now.clientX) / 2, clientY: (a.now.clientY + b.now.clientY) / 2});
      view.x += middle[0] - there[0];
      view.y += middle[1] - there[1];
      aim();
    }
    return;
  }
  if (Math.hypot(event.clientX - mine.x, event.clientY - mine.y) > NEAR) moved.far = true;
  if (!moved.far) return;
  const at = pointOf(event);
  if (moved.drags && tool === 'select') {
    moved.target.setAttribute('cx', at[0]);
    moved.target.setAttribute('cy', -at[1]);
  } else if (may && tool === 'cut') {
    points = [moved.start, at];
    drawDraft();
  } else if (may && ['keep_out', 'slow'].includes(tool) && !(points.length && !moved.box)) {
    moved.box = true;
    points = [moved.start, [at[0], moved.start[1]], at, [moved.start[0], at[1]]];
    drawDraft();
  } else if (tool === 'select' || !moved.box) {
    view.x += mine.at[0] - at[0];
    view.y += mine.at[1] - at[1];
    aim();
  }
});

async function up(event) {
  const mine = down.get(event.pointerId);
  down.delete(event.pointerId);
  if (!mine || !moved) return;
  const was = moved;
  if (down.size) return;
  moved = null;
  if (was.pinch || event.type === 'pointercancel') { draw(); return; }
  const at = pointOf(event);
  if (!was.far) { if (may || tool === 'select') await tap(at, was.target); return; }
  if (was.drags && tool === 'select') await drop(was.target.dataset, at);
  else if (may && tool === 'cut' && points.length === 2) await finish();
  else if (was.box) await finish();
  draw();
}
svg.addEventListener('pointerup', up);
svg.addEventListener('pointercancel', up);
svg.addEventListener('wheel', (event) => {
  event.preventDefault();
  zoom(Math.exp(Math.sign(event.deltaY) * 0.18), pointOf(event));
}, {passive: false});

// --- keyboard ---

const ARROWS = {ArrowLeft: [-1, 0], ArrowRight: [1, 0], ArrowUp: [0, 1], ArrowDown: [0, -1]};

svg.addEventListener('keydown', (event) => {
  if (event.ctrlKey || event.metaKey || event.altKey) return;
  const step = view.span / (event.shiftKey ? 200 : 20);
  if (event.key in ARROWS) {
    view.x += ARROWS[event.key][0] * step;
    view.y += ARROWS[event.key][1] * step;
    aim();
  } else if (event.key === 'n') nextDoubtful();
  else if (event.key === '+' || event.key === '=') zoom(1 / 1.3);
  else if (event.key === '-') zoom(1.3);
  else if (event.key === '0') { whole(); draw(); }
  else if (event.key === 'Enter' || event.key === ' ') {
    const near = nearest();
    tap([view.x, view.y], ['select', 'join', 'wall'].includes(tool) ? near : null);
  } else if (event.key === 'Escape') take_up('select');
  else {
    const found = Object.entries(TOOLS).find(([, [, key]]) => key === event.key);
    if (!found || (!may && found[0] !== 'select')) return;
    take_up(found[0]);
  }
  event.preventDefault();
});

// The handle that lies at the cross, if one does.
function nearest() {
  const reach = 14 * pixel();
  const all = [...layers.grips.children].map((each) => [Math.hypot(each.getAttribute('cx') - view.x, -each.getAttribute('cy') - view.y), each]);
  const [gap, each] = all.sort((a, b) => a[0] - b[0])[0] ?? [Infinity, null];
  return gap <= reach ? each : null;
}

addEventListener('keydown', (event) => {
  if (!(event.ctrlKey || event.metaKey) || !may) return;
  const key = event.key.toLowerCase();
  if (key === 's') { event.preventDefault(); if (place?.changed) send('save_place'); }
  if (event.target.matches('input, select')) return;
  if (key === 'z') { event.preventDefault(); send(event.shiftKey ? 'redo_edit' : 'undo_edit'); }
  if (key === 'y') { event.preventDefault(); send('redo_edit'); }
});
addEventListener('beforeunload', (event) => { if (may && place?.changed) event.preventDefault(); });
addEventListener('resize', () => { if (place) draw(); });

// --- the rest of the page ---

$('tools').append(
  ...Object.entries(TOOLS).map(([name, [text, key]]) => h('button', {type: 'button', 'data-tool': name, 'aria-pressed': 'false', title: `${text} (${key})`, disabled: !may && name !== 'select', onclick: () => take_up(name)}, text)),
  h('button', {type: 'button', id: 'done', hidden: true, onclick: finish}, 'Done'),
);
$('closer').addEventListener('click', () => zoom(1 / 1.3));
$('farther').addEventListener('click', () => zoom(1.3));
$('whole').addEventListener('click', () => { whole(); draw(); });
$('next-doubtful').addEventListener('click', nextDoubtful);
$('undo').addEventListener('click', () => send('undo_edit'));
$('redo').addEventListener('click', () => send('redo_edit'));
$('save').addEventListener('click', () => send('save_place'));
$('reload').disabled = !may;
$('reload').addEventListener('click', () => send('reload_place'));
$('list').addEventListener('change', () => {
  const [kind, name] = $('list').value.split(' ');
  choose(kind ? {kind, name} : null);
});
// --- a map that is dropped, or chosen ---

const dropped = new Map();
const inText = (file) => new Promise((done, fail) => {
  const reader = new FileReader();
  reader.onload = () => done(reader.result.slice(reader.result.indexOf(',') + 1));
  reader.onerror = () => fail(reader.error);
  reader.readAsDataURL(file);
});

async function importMap(files, plan = {}) {
  for (const file of files) dropped.set(file.name, file);
  if (!dropped.size) return;
  const said = $('import-said');
  said.textContent = `${[...dropped.keys()].join(', ')}: looking for rooms and doors …`;
  said.className = 'note';
  $('import-now').disabled = true;
  try {
    const texts = await Promise.all([...dropped].map(async ([name, file]) => [name, await inText(file)]));
    view = chosen = null;
    const found = await send('import_map', {files: Object.fromEntries(texts), resolution: $('scale').value, level: $('level').value, keep: Boolean(place) && $('keep').checked, ...plan});
    said.textContent = found.text ?? '';
    said.className = found.ok ? 'ok' : 'warn';
    if (found.ok) $('photo').hidden = true;
    // A picture without a scale may be that of a plan.
    const [only] = dropped.size === 1 ? dropped.values() : [];
    if (!found.ok && only && !plan.scale && /says nothing of its scale/.test(found.text)) showPhoto(only);
    // Files that belong together may come one by one.
    if (found.ok || !/expected it with/.test(found.text)) dropped.clear();
    if (!found.ok && /scale|level/.test(found.text)) for (const file of files) dropped.set(file.name, file);
    if (place && !view) { whole(); draw(); }
  } catch (error) {
    said.textContent = `a file cannot be read: ${error.message}`;
    said.className = 'warn';
    dropped.clear();
  } finally {
    $('import-now').disabled = false;
    $('files').value = '';
  }
}

// --- a photo of a floor plan: four corners, then two points whose distance is known ---

const photo = {file: null, size: [0, 0], corners: [], ends: [], straight: false};

function showPhoto(file) {
  const reader = new FileReader();
  reader.onload = () => {
    const image = new Image();
    image.onload = () => {
      Object.assign(photo, {file, size: [image.naturalWidth, image.naturalHeight], corners: [], ends: [], straight: false});
      $('photo-view').setAttribute('viewBox', `0 0 ${photo.size.join(' ')}`);
      $('photo-view').replaceChildren(s('image', {href: reader.result, width: photo.size[0], height: photo.size[1]}), s('g'));
      $('photo').hidden = false;
      drawPhoto();
    };
    image.src = reader.result;
  };
  reader.readAsDataURL(file);
}

function drawPhoto() {
  const corners = photo.straight || photo.corners.length === 4;
  $('photo-hint').textContent = corners
    ? photo.ends.length < 2 ? 'Click two points whose distance you know, as far apart as you can.' : 'How many metres are these two points apart?'
    : `Is it a photo of a floor plan? Click the four corners of a rectangle in it, in turn (${photo.corners.length} of 4), or say that it is straight.`;
  $('photo-skip').disabled = corners || photo.corners.length > 0;
  $('photo-now').disabled = !may || photo.ends.length < 2;
  const r = Math.max(...photo.size) / 120;
  const line = (each) => each.map(([x, y], i) => `${i ? 'L' : 'M'}${x} ${y}`).join('');
  $('photo-view').lastChild.replaceChildren(
    s('path', {d: line(photo.corners) + (photo.corners.length === 4 ? 'Z' : ''), 'stroke-width': r / 3}),
    s('path', {d: line(photo.ends), 'stroke-width': r / 2}),
    ...[...photo.corners, ...photo.ends].map(([cx, cy]) => s('circle', {cx, cy, r, 'stroke-width': r / 3})));
}

$('photo-view').addEventListener('click', (event) => {
  const at = new DOMPoint(event.clientX, event.clientY).matrixTransform($('photo-view').getScreenCTM().inverse());
  const point = [Math.round(at.x), Math.round(at.y)];
  if (!photo.straight && photo.corners.length < 4) photo.corners.push(point);
  else if (photo.ends.length < 2) photo.ends.push(point);
  drawPhoto();
});
$('photo-skip').addEventListener('click', () => { photo.straight = true; drawPhoto(); });
$('photo-again').addEventListener('click', () => { Object.assign(photo, {corners: [], ends: [], straight: false}); drawPhoto(); });
$('photo-now').addEventListener('click', () => {
  const said = (each) => each.map((point) => point.join(',')).join(' ');
  dropped.clear();
  importMap([photo.file], {corners: said(photo.corners), scale: `${said(photo.ends)} ${$('photo-length').value.trim() || '?'}`});
});

if (document.documentElement.dataset.imports === '1') {
  $('import-section').hidden = false;
  $('import').addEventListener('submit', (event) => { event.preventDefault(); importMap($('files').files); });
  $('files').addEventListener('change', () => importMap([...$('files').files]));
  addEventListener('dragover', (event) => event.preventDefault());
  addEventListener('drop', (event) => { event.preventDefault(); importMap([...event.dataTransfer.files]); });
}
$('read-only').hidden = may;
take_up('select');
take(await ask('place', {}));
window.editor = {
  get place() { return place; },
  // Where a point of the floor is on the screen, for tests.
  at: (x, y) => {
    const box = svg.getBoundingClientRect();
    return [box.left + box.width / 2 + (x - view.x) / pixel(), box.top + box.height / 2 - (y - view.y) / pixel()];
  },
};
