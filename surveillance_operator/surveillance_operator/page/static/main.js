// Follows the mission's events and hands each part to those who show it.
import {$, h, colour, figuresOf, shown, timeOfDay} from './dom.js';
import {MapView} from './map.js';
import {drawMachine, lightMachine} from './machine.js';
import {drawStrips, showIdlenessBounds} from './time.js';
import {Why} from './why.js';
import {showHealth} from './health.js';
import {Control} from './control.js';
import {Fleet} from './fleet.js';
import {Replay} from './replay.js';
import {Alarms} from './alarms.js';
import {Baseline} from './baseline.js';
import {Search} from './search.js';
import {Shift} from './shift.js';
import {Drive} from './drive.js';
import {startPeople} from './people.js';
import {startViews, open} from './views.js';

const root = document.documentElement;
const state = {};
// The same of each robot: all parts of the one that is looked at, a glance of the others.
const robots = {};
const clock = {now: 0, at: 0, rate: 1, measured: 1};
const may = root.dataset.control === '1';
const guard = root.dataset.guard === '1';
const replaying = root.dataset.kind === 'replay';

// The date, seconds since 1970, as the machine of the mission has it; in a replay that of its moment.
let behind = 0;

function wall() {
  return replaying ? state.replay?.time ?? 0 : Date.now() / 1000 + behind;
}

// What is shown as it was, while a person looks back; what comes meanwhile is told again after that.
let past = null;

const why = new Why(state);
const control = new Control(state, may && !replaying, guard && !replaying);
const map = new MapView($('map'), (place) => { why.choose(place); control.choose(place); }, (point) => control.pick(point));
const replay = replaying ? new Replay() : null;
const alarms = new Alarms({may: guard && !replaying, wall, onChoose: (event) => map.lookAt(event.position)});
const search = new Search({may: guard && !replaying, operator: may && !replaying, wall, jump: replaying ? (at) => { replay.jump(at); open('desk'); } : null});
if (root.dataset.baseline === '1') new Baseline({may: guard});
map.addLayer('events', alarms.spots);
const fleet = new Fleet(robots, may && !replaying, look);
let asked = new URLSearchParams(location.search).get('robot');
window.mission = {state, robots, now, received: 0};

// Looks at another robot.
function look(robot) {
  asked = robot;
  history.replaceState(null, '', `?robot=${encodeURIComponent(robot)}${location.hash}`);
  connect();
}

export function now() {
  const passed = (performance.now() - clock.at) / 1000;
  return clock.now + Math.min(passed, 5) * clock.rate;
}

function showDesk(desk) {
  if (!desk) return;
  behind = desk.at - Date.now() / 1000;
  alarms.show(desk);
  search.muted(desk.mutes);
  header();
}

function set(id, text) {
  const element = $(id);
  if (element.textContent !== text) element.textContent = text;
}

function header() {
  const {status, mission} = state;
  const ended = mission && !mission.running && status;
  const name = shown.robot ? `${shown.robot} · ` : '';
  const begins = fleet.isOne || shown.robot ? `${name}a mission begins` : 'what all robots share';
  set('title', status ? `${name}${status.machine}${mission?.mode ? ' · ' + mission.mode : ''}` : mission?.running ? begins : 'no mission yet');
  document.title = (alarms.loud.length ? `(${alarms.loud.length}) ` : '') + (status ? `${name}${status.place || '?'} · ${status.machine}` : 'Mission');
  set('stop', shown.robot ? `STOP ${shown.robot}` : 'STOP');
  const none = !fleet.isOne && !shown.robot;
  $('stop').hidden = none;
  $('pause').hidden = !may || none || !mission?.running || Boolean(state.active?.paused);
  $('go').hidden = !may || none || !mission?.running || !state.active?.paused;
  set('control-h', shown.robot ? `Control of ${shown.robot}` : 'Control');
  const words = status ? [ended && 'the mission has ended', status.state, status.whereabouts, status.waiting_for_help ? 'waiting for help' : status.text] : [`waiting on ${mission?.where ?? ''}`];
  set('state', words.filter(Boolean).join(' · '));
  $('state').classList.toggle('warn', Boolean(status?.waiting_for_help || ended));
}

// Every entry of figures.py, in its order.
function figures() {
  $('figures').replaceChildren(...figuresOf(state).map(([name, label, words, bad, share]) =>
    h('li', {'data-figure': name, class: bad ? 'warn' : null}, `${label} ${words}`,
      share === null ? null : h('meter', {value: share, low: bad ? 1 : 0, 'aria-label': label}))));
}

function list(id, lines) {
  $(id).replaceChildren(...lines.map(([at, ...what]) => h('li', {}, h('time', {}, at), ...what)));
  if (!lines.length) $(id).append(h('li', {}, 'none yet'));
}

function lists() {
  const {events, markers, transitions} = state;
  list('events', (events ?? []).toReversed().map(([at, robot, text]) => [timeOfDay(at), robot ? h('b', {class: `of ${colour(robot, robots)}`}, robot) : null, text]));
  $('markers').replaceChildren(...(markers?.seen ?? []).map(([id, known, confirmed, confidence]) =>
    h('li', {}, `marker ${id}${confirmed ? ', confirmed' : ''}${known ? '' : ', not on the list'}, confidence ${confidence}`)));
  $('markers').hidden = !markers?.seen?.length;
  set('scan', markers?.progress ? `scan: view ${markers.progress[0]} of ${markers.progress[1]}` : '');
  list('transitions', (transitions ?? []).toReversed().slice(0, 12).map((each) =>
    [`${each[6].toFixed(1)} s`, `${each[3]} –${each[4]}→ ${each[5]}`]));
}

// What is empty is said in words until there is something to show.
function present() {
  const {grid, places, machine, mission, health} = state;
  const has = (part) => Object.keys(part ?? {}).length > 0;
  const there = {map: grid || has(places), machine: has(machine), mission: mission?.running, nodes: has(health?.nodes) || has(health?.others)};
  for (const each of document.querySelectorAll('[data-with]')) each.toggleAttribute('hidden', !there[each.dataset.with]);
  for (const each of document.querySelectorAll('[data-without]')) each.toggleAttribute('hidden', Boolean(there[each.dataset.without]));
}

const MOST_TRAIL = 600;
const MAP_PARTS = ['status', 'grid', 'places', 'regions', 'links', 'doors', 'plan', 'scan', 'obstacles', 'pose', 'trail', 'mission', 'markers', 'others', 'idleness_bounds', 'robots', 'zones', 'stations', 'coverage'];
const SHOW = {
  present: [['grid', 'places', 'machine', 'mission', 'health'], present],
  fleet: [['robots', 'doing', 'shares', 'out', 'troubles', 'brief', 'battery', 'decision', 'stopped', 'active', 'mission'], () => fleet.show()],
  header: [['status', 'mission', 'active', 'robots'], header],
  figures: [['figures', 'battery'], figures],
  why: [['decision', 'places', 'status'], () => why.show()],
  lists: [['events', 'markers', 'transitions'], lists],
  health: [['health', 'usage'], () => showHealth(state)],
  machine: [['machine'], () => drawMachine($('machine'), state.machine ?? [])],
  lit: [['machine', 'active', 'transitions'], () => {
    lightMachine($('machine'), state.active?.paths ?? [], state.transitions ?? []);
    $('paused').hidden = !state.active?.paused;
    const waiting = state.active?.waiting ?? [];
    $('waiting').hidden = $('approve').hidden = !waiting.length;
    $('waiting').textContent = `waits for approval: ${waiting.join(', ')}`;
  }],
  stopped: [['stopped'], () => {
    $('stopped').hidden = !state.stopped || !fleet.isOne;
    $('release').hidden = !state.stopped;
  }],
  control: [['places', 'doors', 'mission', 'requests', 'health'], () => control.show()],
  idleness_bounds: [['idleness_bounds', 'kept'], () => showIdlenessBounds(state)],
  strips: [['history', 'places', 'mission', 'idleness_bounds'], () => drawStrips($('strips'), state, now())],
  map: [MAP_PARTS, (parts) => map.show(state, parts, now(), robots)],
};

function receive(message) {
  if (past) {
    if (message.p.desk) showDesk(message.p.desk);
    return;
  }
  const parts = {...message.p};
  const at = performance.now();
  if (clock.at && !message.whole) {
    const passed = (at - clock.at) / 1000;
    if (passed > 0.5) {
      // One leap of the clock, to the next mission for example, is no pace.
      const measured = Math.max(0, (message.now - clock.now) / passed);
      clock.rate = Math.min(measured, clock.measured);
      clock.measured = measured;
    }
  }
  if (!clock.at || at - clock.at > 500 || message.whole) { clock.now = message.now; clock.at = at; }
  if (message.whole) for (const known of [state, robots]) for (const name of Object.keys(known)) delete known[name];
  shown.robot = message.robot;
  robots[shown.robot] = state;
  for (const [name, glance] of Object.entries(message.r)) robots[name] = Object.assign(robots[name] ?? {}, glance);
  if (message.whole || Object.keys(message.r).length) parts.robots = true;
  if (parts.pose && !parts.trail && state.trail) {
    const last = state.trail.at(-1);
    if (!last || Math.hypot(last[0] - parts.pose[0], last[1] - parts.pose[1]) > 0.099) state.trail.push(parts.pose.slice(0, 2));
    state.trail.splice(0, state.trail.length - MOST_TRAIL);
  }
  Object.assign(state, message.p);
  if (parts.desk) showDesk(parts.desk);
  if (parts.replay) replay?.show(parts.replay);
  for (const [needs, draw] of Object.values(SHOW)) if (needs.some((name) => name in parts)) draw(parts);
  window.mission.received += 1;
}

function lookBack(found, at) {
  past = found;
  document.body.classList.toggle('past', Boolean(found));
  if (!found) { connect(); return; }
  const parts = {...found.parts};
  for (const name of Object.keys(state)) if (name !== 'desk') delete state[name];
  Object.assign(state, parts);
  clock.now = found.now;
  clock.at = performance.now();
  clock.rate = 0;
  connection('wait', `as it was at ${timeOfDay(at)}`);
  const all = Object.fromEntries([...MAP_PARTS, ...Object.values(SHOW).flatMap(([needs]) => needs)].map((name) => [name, true]));
  for (const [, draw] of Object.values(SHOW)) draw(all);
}

function connection(kind, text) {
  $('connection').dataset.state = kind;
  set('connection', text);
}

// The server tells the time every 2 s. A connection that a sleeping laptop or a gateway forgot stays open in silence.
const SILENT = 6000;
const DEAD = 30000;
let source = null;
let heard = 0;

function connect() {
  source?.close();
  heard = performance.now();
  source = new EventSource(asked === null ? '/events' : `/events?robot=${encodeURIComponent(asked)}`);
  source.onmessage = (event) => {
    heard = performance.now();
    if (!past) connection('on', replaying ? 'replay' : 'live');
    receive(JSON.parse(event.data));
  };
  source.onerror = () => {
    connection('off', 'connection lost, trying again');
    if (source.readyState === EventSource.CLOSED) setTimeout(connect, 2000);
  };
}

function listen() {
  const silent = performance.now() - heard;
  if (silent > DEAD) connect();
  else if (silent > SILENT) connection('off', 'no data from the mission');
}

function camera() {
  const image = $('camera');
  const box = $('camera-section').getBoundingClientRect();
  if (document.hidden || past || !box.height || box.top > innerHeight || box.bottom < 0) return;
  const next = new Image();
  const show = (there) => { image.hidden = !there; $('no-camera').hidden = there; };
  next.onload = () => { image.src = next.src; show(true); };
  next.onerror = () => show(false);
  next.src = `/camera.jpg?robot=${encodeURIComponent(shown.robot)}&at=${Date.now()}`;
}

$('edit-link').hidden = root.dataset.edit !== '1';
document.body.classList.toggle('replay', replaying);
$('replay').hidden = !replaying;
for (const each of document.querySelectorAll('.control')) each.hidden = !may || replaying;
for (const each of document.querySelectorAll('.guard')) each.hidden = !guard || replaying;
$('people-link').hidden = root.dataset.people !== '1';
$('rule').hidden = !may || root.dataset.rules !== '1';
present();
connect();
setInterval(() => { listen(); alarms.bar.tick(); if (!past) map.tick(state, now()); drawStrips($('strips'), state, now()); }, 1000);
setInterval(camera, 700);
if (root.dataset.past === '1') new Shift({wall, past: lookBack, choose: (event) => { open('events'); search.show(event); }});
if (may && !replaying) {
  new Drive(map);
  if (root.dataset.people === '1') startPeople();
}
startViews();
