// Which nodes are up, and what each says of itself.
import {$, h} from './dom.js';

const LEVELS = ['ok', 'WARN', 'ERROR', 'STALE'];

function words({up, reports}) {
  if (!up) return {text: 'ended', bad: true};
  const worst = reports.reduce((a, b) => (b.level > a.level ? b : a), {level: 0, message: 'up'});
  const said = reports.filter((each) => each.level === worst.level).map((each) => each.message).join('; ');
  const text = said || worst.message;
  return {text: worst.level ? `${LEVELS[worst.level] ?? '?'} ${text}` : text, bad: worst.level > 0};
}

export function showHealth({health, figures}) {
  const rows = Object.entries(health?.nodes ?? {}).map(([name, node]) => {
    const {text, bad} = words(node);
    const own = figures?.[name] ?? {};
    const again = Math.max(node.restarts, Number(own.restarts) || 0);
    const sign = node.up ? (bad ? '▲' : '●') : '✗';
    return h('tr', {class: node.up ? 'up' : 'down'},
      h('th', {scope: 'row'}, h('b', {class: bad ? 'warn' : 'ok'}, `${sign} `), name),
      h('td', {class: bad ? 'warn' : null}, text),
      h('td', {class: 'n'}, own.memory_mb ?? '–'),
      h('td', {class: again ? 'n warn' : 'n'}, String(again)));
  });
  $('nodes').tBodies[0].replaceChildren(...rows);
  const others = Object.entries(health?.others ?? {}).map(([name, report]) =>
    h('li', {class: report.level ? 'warn' : null}, `${LEVELS[report.level] ?? '?'} ${name}: ${report.message}`));
  const silent = Object.entries(health?.silent ?? {}).map(([topic, reason]) => h('li', {}, `${topic}: ${reason}`));
  $('reports').replaceChildren(...others, ...silent);
  $('reports').hidden = !others.length && !silent.length;
}
