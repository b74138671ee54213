// Makes elements; text always goes in as text, never as HTML.
const SVG = 'http://www.w3.org/2000/svg';

export const $ = (id) => document.getElementById(id);

function fill(element, attributes, children) {
  for (const [name, value] of Object.entries(attributes)) {
    if (name.startsWith('on')) element.addEventListener(name.slice(2), value);
    else if (value !== null && value !== undefined && value !== false) element.setAttribute(name, value === true ? '' : value);
  }
  element.append(...children.filter((child) => child !== null && child !== undefined));
  return element;
}

export const h = (name, attributes = {}, ...children) => fill(document.createElement(name), attributes, children);
export const s = (name, attributes = {}, ...children) => fill(document.createElementNS(SVG, name), attributes, children);

export function age(seconds) {
  const whole = Math.max(0, Math.floor(seconds));
  const minutes = Math.floor(whole / 60);
  const rest = String(whole % 60).padStart(2, '0');
  if (minutes < 60) return `${minutes}:${rest}`;
  if (minutes > 2880) return `${Math.floor(minutes / 1440)} days`;
  return `${Math.floor(minutes / 60)}:${String(minutes % 60).padStart(2, '0')}:${rest}`;
}

// The time of the day of a moment, seconds since 1970, where the viewer is. In old recordings events
// have this text itself.
export const timeOfDay = (at) => typeof at === 'string' ? at : new Date(1000 * at).toLocaleTimeString('en-GB');

// Names in the order in which a person counts: R2 before R10.
export const names = (things) => Object.keys(things ?? {}).sort((a, b) => a.localeCompare(b, 'en', {numeric: true}));

// A name that a drawing has room for.
export const short = (name, most) => (name.length > most ? `${name.slice(0, most - 1)}…` : name);

// Seconds that a place may go unvisited: its own threshold, else the mission's; null: as long as it likes.
export const limit = ({mission, idleness_bounds}, name) => idleness_bounds?.[name] ? idleness_bounds[name].threshold : mission?.threshold;

// How long a place waits: since its last visit, or since the mission is heard of; in words, and as a share of the threshold.
export function wait({places, history, mission, idleness_bounds}, name, now) {
  const {visited, urgent} = places[name];
  const begun = Math.min(now, ...[history?.visits[0], history?.battery[0]].filter(Boolean).map(([at]) => at));
  const seconds = Math.max(0, now - (visited ?? begun));
  const threshold = limit({mission, idleness_bounds}, name);
  const late = urgent || Boolean(threshold) && seconds > threshold;
  return {seconds, late, share: late ? 1 : threshold ? seconds / threshold : 0, text: (visited === null ? 'never' : age(seconds)) + (late ? ' !' : '')};
}

// The mission's figures: name, label, words, whether it is bad, its share of a whole or null. Recordings of before have the battery alone.
export const figuresOf = ({figures, battery}) => figures ?? (battery ? [['battery', 'battery', `${Math.round(battery.level)} %${battery.low ? ' (low)' : ''}`, battery.low, battery.level / 100]] : []);

// The robot that is looked at; one that is alone has no name.
export const shown = {robot: ''};
const OF_ROBOT = new Set(['go', 'arm', 'machine', 'stop', 'threshold', 'policy', 'command', 'event', 'why_not', 'sightings', 'baseline']);
const whose = (name, fields) => (shown.robot && OF_ROBOT.has(name) ? {robot: shown.robot, ...fields} : fields);

// The colour of a robot of a fleet, by its place in the order of their names.
const COLOURS = 8;
export const colour = (name, all) => `robot-${names(all).filter(Boolean).indexOf(name) % COLOURS}`;

export async function ask(name, fields) {
  return answerOf(fetch(`/ask/${name}?` + new URLSearchParams(whose(name, fields))));
}

export async function act(name, given) {
  const fields = whose(name, given);
  return answerOf(fetch(`/act/${name}`, {method: 'POST', body: JSON.stringify(fields), headers: {'Content-Type': 'application/json'}}));
}

async function answerOf(request) {
  try {
    const response = await request;
    const text = await response.text();
    try { return JSON.parse(text); } catch { return {ok: false, text}; }
  } catch {
    return {ok: false, text: 'the mission does not answer'};
  }
}
