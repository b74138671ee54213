// The map: what the robot knows of the place, and what it does there. Metres; y points up.
import {s, age} from './dom.js';

const line = (points) => points.map(([x, y], i) => `${i ? 'L' : 'M'}${x} ${-y}`).join('');

export class MapView {
  constructor(svg, onPlace, onPoint) {
    this.svg = svg;
    this.layers = {};
    for (const name of ['grid', 'links', 'driven', 'plan', 'doors', 'lidar', 'obstacles', 'places', 'robot']) {
      this.layers[name] = s('g');
      svg.append(this.layers[name]);
    }
    this.driven = s('path', {class: 'driven'});
    this.plan = s('path', {class: 'plan'});
    this.lidar = s('path', {class: 'lidar'});
    this.robot = s('g', {class: 'robot', visibility: 'hidden'}, s('title', {}, 'the robot'), s('path', {d: 'M.55 0L-.35 .38L-.15 0L-.35 -.38Z'}));
    this.layers.driven.append(this.driven);
    this.layers.plan.append(this.plan);
    this.layers.lidar.append(this.lidar);
    this.layers.robot.append(this.robot);
    this.onPlace = onPlace;
    svg.addEventListener('click', (event) => {
      const at = new DOMPoint(event.clientX, event.clientY).matrixTransform(svg.getScreenCTM().inverse());
      onPoint([Math.round(at.x * 100) / 100, Math.round(-at.y * 100) / 100]);
    });
    this.rooms = new Map();
  }

  show(state, parts, now) {
    const {grid, places, doors, links} = state;
    if ('grid' in parts) {
      const [l, b, r, t] = grid?.box ?? [0, 0, 0, 0];
      this.layers.grid.replaceChildren(...(grid ? [s('image', {href: grid.image, x: l, y: -t, width: r - l, height: t - b, preserveAspectRatio: 'none'})] : []));
    }
    if ('grid' in parts || 'places' in parts) this.frame(state);
    if ('links' in parts || 'places' in parts || 'grid' in parts) {
      const both = (grid ? [] : links ?? []).filter(([a, b]) => places?.[a]?.at && places?.[b]?.at);
      this.layers.links.replaceChildren(...both.map(([a, b]) => s('path', {class: 'link', d: line([places[a].at, places[b].at])})));
    }
    if ('doors' in parts) {
      this.layers.doors.replaceChildren(...Object.entries(doors ?? {}).filter(([, door]) => door.line).flatMap(([name, door]) => {
        const [x1, y1, x2, y2] = door.line;
        const shut = door.open === false;
        const drawn = s('path', {class: shut ? 'door shut' : 'door', d: line([[x1, y1], [x2, y2]]), 'data-door': name}, s('title', {}, `door ${name} ${shut ? 'closed' : 'open'}`));
        return shut ? [drawn, s('text', {class: 'cross', x: (x1 + x2) / 2, y: -(y1 + y2) / 2 + .3}, '×')] : [drawn];
      }));
    }
    if ('places' in parts || 'mission' in parts) this.drawPlaces(state, now);
    if ('plan' in parts) this.plan.setAttribute('d', line(state.plan ?? []));
    if ('trail' in parts || 'pose' in parts) this.driven.setAttribute('d', line(state.trail ?? []));
    if ('scan' in parts) this.lidar.setAttribute('d', (state.scan ?? []).map(([x, y]) => `M${x} ${-y}h0`).join(''));
    if ('obstacles' in parts) this.layers.obstacles.replaceChildren(...(state.obstacles ?? []).map(([x, y]) => s('rect', {class: 'obstacle', x: x - .06, y: -y - .06, width: .12, height: .12})));
    if ('pose' in parts || ('status' in parts && !state.pose)) {
      const at = state.pose ?? places?.[state.status?.place]?.at;
      this.robot.setAttribute('visibility', at ? 'visible' : 'hidden');
      if (at) this.robot.style.transform = `translate(${at[0]}px, ${-at[1]}px) rotate(${-(at[2] ?? 0)}rad)`;
    }
  }

  frame({grid, places}) {
    let box = grid?.known;
    const points = Object.values(places ?? {}).map((place) => place.at).filter(Boolean);
    if (!box && points.length) {
      const xs = points.map((p) => p[0]), ys = points.map((p) => p[1]);
      box = [Math.min(...xs) - 2, Math.min(...ys) - 2, Math.max(...xs) + 2, Math.max(...ys) + 2];
    }
    if (box) this.svg.setAttribute('viewBox', `${box[0] - .3} ${-box[3] - .3} ${box[2] - box[0] + .6} ${box[3] - box[1] + .6}`);
  }

  drawPlaces(state, now) {
    const key = JSON.stringify(Object.entries(state.places ?? {}).map(([name, place]) => [name, place.at]));
    if (key === this.key) { this.tick(state, now); return; }
    this.key = key;
    const focused = document.activeElement?.dataset?.place;
    this.rooms.clear();
    const spots = Object.values(state.places ?? {}).map((place) => place.at).filter(Boolean);
    const taken = [];
    const free = (x, y, width) => spots.every(([px, py]) => Math.abs(px - x) > width / 2 + .5 || Math.abs(py - y) > .75)
      && taken.every(([tx, ty, w]) => Math.abs(tx - x) > (w + width) / 2 || Math.abs(ty - y) > .6);
    const labelAt = ([x, y], name) => {
      const width = .4 * name.length;
      const ways = [[x, y + .85], [x + .7 + width / 2, y], [x - .7 - width / 2, y], [x, y - .95]];
      const [lx, ly] = ways.find(([wx, wy]) => free(wx, wy, width)) ?? ways[0];
      taken.push([lx, ly, width]);
      return {x: lx, y: -ly + .2};
    };
    this.layers.places.replaceChildren(...Object.entries(state.places ?? {}).filter(([, place]) => place.at).map(([name, {at}]) => {
      const circle = s('circle', {cx: at[0], cy: -at[1], r: .48});
      const label = s('text', labelAt(at, name), name);
      const words = s('text', {class: 'age', x: at[0], y: -at[1] + .18}, '');
      const choose = () => this.onPlace(name);
      const room = s('g', {class: 'room', tabindex: 0, role: 'button', 'data-place': name,
        onclick: choose, onkeydown: (event) => { if (event.key === 'Enter' || event.key === ' ') { event.preventDefault(); choose(); } }}, circle, label, words);
      this.rooms.set(name, {room, circle, words});
      return room;
    }));
    if (focused) this.rooms.get(focused)?.room.focus();
    this.tick(state, now);
  }

  tick(state, now) {
    const threshold = state.mission?.threshold || 120;
    for (const [name, {room, circle, words}] of this.rooms) {
      const place = state.places?.[name];
      if (!place) continue;
      const waited = place.visited === null ? Infinity : now - place.visited;
      const share = Math.round(100 * Math.min(1, Math.max(0, waited / threshold)));
      circle.style.fill = `color-mix(in srgb, var(--late) ${share}%, var(--fresh))`;
      const late = place.urgent || waited > threshold;
      const text = (Number.isFinite(waited) ? age(waited) : 'never') + (late ? '!' : '');
      if (words.textContent !== text) words.textContent = text;
      room.setAttribute('aria-label', `${name}: ${Number.isFinite(waited) ? 'unvisited for ' + age(waited) : 'never visited'}${place.urgent ? ', URGENT' : ''}`);
    }
  }
}
