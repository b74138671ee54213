// Which nodes are up, and what each says of itself.
import {$, h} from './dom.js';

const LEVELS = ['ok', 'WARN', 'ERROR', 'STALE'];
const SHORT = 8;

function words({up, reports}) {
  if (!up) return {text: 'ended', bad: true};
  const worst = reports.reduce((a, b) => (b.level > a.level ? b : a), {level: 0, message: 'up'});
  const said = reports.filter((each) => each.level === worst.level).map((each) => each.message).join('; ');
  const text = said || worst.message;
  return {text: worst.level ? `${LEVELS[worst.level] ?? '?'} ${text}` : text, bad: worst.level > 0};
}

function row(name, node, own) {
  const {text, bad} = words(node);
  const again = Math.max(node.restarts ?? 0, Number(own.restarts) || 0);
  const sign = node.up ? (bad ? '▲' : '●') : '✗';
  // What is wrong, and what is long, has room below the name.
  const below = bad || text.length > SHORT;
  return h('tr', {class: node.up ? 'up' : 'down'},
    h('th', {scope: 'row', colspan: below ? 2 : null}, h('b', {class: bad ? 'warn' : 'ok'}, `${sign}\u00a0`), name, below ? h('div', {class: bad ? 'warn' : null}, text) : null),
    below ? null : h('td', {}, text),
    h('td', {class: 'n'}, own.memory_mb ?? '–'),
    h('td', {class: again ? 'n warn' : 'n'}, String(again)));
}

export function showHealth({health, usage}) {
  const others = Object.entries(health?.others ?? {}).map(([name, report]) => [name, {up: true, reports: [report]}]);
  const rows = [...Object.entries(health?.nodes ?? {}), ...others].map(([name, node]) => row(name, node, usage?.[name] ?? {}));
  $('nodes').tBodies[0].replaceChildren(...rows);
  const silent = Object.entries(health?.silent ?? {}).map(([topic, reason]) => h('li', {}, `${topic}: ${reason}`));
  $('reports').replaceChildren(...silent);
  $('reports').hidden = !silent.length;
}
