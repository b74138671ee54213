// The state machine as nested boxes, its transitions as arcs beside them.
import {s, short} from './dom.js';

const ROW = 26, GAP = 6, PAD = 10, INDENT = 14, WIDTH = 190;

function ordered(container) {
  // States in the order in which a run reaches them.
  const found = [], queue = [...container.initial];
  while (queue.length) {
    const label = queue.shift();
    if (found.includes(label) || !container.states.includes(label)) continue;
    found.push(label);
    queue.push(...container.edges.filter(([from]) => from === label).map(([, , to]) => to));
  }
  return [...found, ...container.states.filter((label) => !found.includes(label))];
}

function layout(container, all, depth) {
  const group = s('g');
  const rows = new Map();
  let y = ROW, width = WIDTH - depth * INDENT;
  for (const label of ordered(container)) {
    const path = `${container.path}/${label}`;
    const inner = all.find((each) => each.path === path);
    const part = s('g', {'data-path': path, class: inner ? 'box' : 'leaf', transform: `translate(${PAD} ${y})`});
    let height = ROW;
    if (inner) {
      const drawn = layout(inner, all, depth + 1);
      height = drawn.height;
      part.append(s('rect', {class: 'box', width: drawn.width, height, rx: 5}), s('text', {x: 8, y: 17}, short(label, 24)), drawn.group);
      width = Math.max(width, drawn.width);
    } else {
      part.append(s('rect', {width, height, rx: 5}), s('text', {x: 8, y: 17}, short(label, 24)), s('title', {}, label));
    }
    rows.set(label, [y, height]);
    y += height + GAP;
    group.append(part);
  }
  for (const part of group.children) part.firstChild.setAttribute('width', width);
  const right = PAD + width;
  let lanes = 0;
  for (const [from, outcome, to] of container.edges) {
    if (!rows.has(from) || !rows.has(to) || from === to) continue;
    const [y1, h1] = rows.get(from), [y2, h2] = rows.get(to);
    const a = y1 + Math.min(h1, ROW) * .65, b = y2 + Math.min(h2, ROW) * .35;
    lanes += 1;
    const reach = 10 + 7 * (lanes % 7) + Math.min(26, Math.abs(b - a) / 9);
    group.append(s('path', {d: `M${right} ${a}C${right + reach} ${a} ${right + reach} ${b} ${right + 1} ${b}l5 -3m-5 3l5 3`, 'data-edge': `${container.path}|${from}|${outcome}`}, s('title', {}, `${from} –${outcome}→ ${to}`)));
  }
  const ends = container.outcomes.join(', ');
  group.append(s('text', {class: 'label', x: PAD, y: y + 9}, short(`ends: ${ends}`, 60)));
  return {group, width: right + 66, height: y + 18};
}

export function drawMachine(svg, containers) {
  svg.replaceChildren();
  const [root] = containers;
  if (!root) return;
  const drawn = layout(root, containers, 0);
  svg.setAttribute('viewBox', `0 0 ${drawn.width} ${drawn.height}`);
  svg.setAttribute('width', drawn.width);
  svg.append(s('text', {x: PAD, y: 17}, root.path), drawn.group);
}

export function lightMachine(svg, paths, transitions) {
  const active = new Set(paths);
  for (const part of svg.querySelectorAll('[data-path]')) part.classList.toggle('on', active.has(part.dataset.path));
  const last = transitions.at(-1);
  const edge = last ? `${last[2]}|${last[3]}|${last[4]}` : '';
  // What may come next: the edges that leave an active state.
  const leaving = paths.map((path) => path.replace(/\/([^/]+)$/, '|$1|'));
  for (const path of svg.querySelectorAll('[data-edge]')) {
    path.classList.toggle('last', path.dataset.edge === edge);
    path.classList.toggle('next', leaving.some((start) => path.dataset.edge.startsWith(start)));
  }
  svg.setAttribute('aria-label', paths.length ? `State machine: ${paths.at(-1)} is active` : 'State machine');
  keepInView(svg, paths.at(-1));
}

function keepInView(svg, path) {
  const box = svg.parentElement;
  const part = path && svg.querySelector(`[data-path="${CSS.escape(path)}"]`);
  if (!part || box.matches(':hover, :focus')) return;
  const outer = box.getBoundingClientRect(), inner = part.getBoundingClientRect();
  if (inner.top < outer.top) box.scrollTop -= outer.top - inner.top + 20;
  else if (inner.bottom > outer.bottom) box.scrollTop += inner.bottom - outer.bottom + 20;
}
