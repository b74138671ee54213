// The map: what the robot knows of the place, and what it does there. Metres; y points up.
import {h, s, colour, names, short, shown, wait} from './dom.js';

// What a person can hide, and the groups that it is drawn in.
const SHOWN = {visits: ['regions'], doors: ['doors'], events: ['events'], zones: ['zones', 'stations'], traffic: ['driven', 'plans', 'plan', 'fleet', 'others'], lidar: ['lidar', 'obstacles'], markers: ['markers'], coverage: ['coverage']};
const MOST_ZOOM = 30, STEP = 1.25, MOVED = 5;
const LAYERS = ['regions', 'grid', 'zones', 'links', 'driven', 'plans', 'plan', 'doors', 'lidar', 'obstacles', 'markers', 'stations', 'places', 'coverage', 'events', 'others', 'fleet', 'robot', 'aim'];
// A dock, open to the side that the robot comes from.
const STATION = 'M.25 -.3H-.3V.3H.25';
const ROBOT = 'M.55 0L-.35 .38L-.15 0L-.35 -.38Z';

const line = (points) => points.map(([x, y], i) => `${i ? 'L' : 'M'}${x} ${-y}`).join('');
const filled = (boxes) => boxes.map(([l, b, r, t]) => `M${l} ${-t}H${r}V${-b}H${l}Z`).join('');

function placeAt(element, [x, y, yaw]) {
  element.style.transform = `translate(${x}px, ${-y}px) rotate(${-(yaw ?? 0)}rad)`;
}

export class MapView {
  constructor(svg, onPlace, onPoint) {
    this.svg = svg;
    this.onPlace = onPlace;
    this.rooms = new Map();
    this.layers = Object.fromEntries(LAYERS.map((name) => [name, s('g')]));
    svg.append(...Object.values(this.layers));
    this.driven = s('path', {class: 'driven'});
    this.plan = s('path', {class: 'plan'});
    this.lidar = s('path', {class: 'lidar'});
    this.robot = s('g', {class: 'robot', visibility: 'hidden'}, s('title', {}, 'the robot'), s('path', {d: ROBOT}));
    this.fleet = new Map();
    for (const name of ['driven', 'plan', 'lidar', 'robot']) this.layers[name].append(this[name]);
    this.zoom = 1;
    this.centre = null;
    this.following = false;
    this.fingers = new Map();
    svg.addEventListener('click', (event) => { if (!this.dragged) onPoint(this.at(event)); });
    svg.addEventListener('wheel', (event) => { event.preventDefault(); this.zoomBy(event.deltaY < 0 ? STEP : 1 / STEP, this.at(event)); }, {passive: false});
    svg.addEventListener('pointerdown', (event) => this.down(event));
    svg.addEventListener('pointermove', (event) => this.move(event));
    for (const end of ['pointerup', 'pointercancel']) svg.addEventListener(end, (event) => this.up(event));
    svg.addEventListener('keydown', (event) => this.onKey(event));
    for (const button of document.querySelectorAll('[data-zoom]')) button.addEventListener('click', () => this.press(button.dataset.zoom));
    document.getElementById('follow').addEventListener('click', () => this.follow(!this.following));
    this.offer();
  }

  // Where on the map a pointer is, metres.
  at(event) {
    const at = new DOMPoint(event.clientX, event.clientY).matrixTransform(this.svg.getScreenCTM().inverse());
    return [Math.round(at.x * 100) / 100, Math.round(-at.y * 100) / 100];
  }

  addLayer(name, group) {
    this.layers[name].append(group);
  }

  // A box for each layer; what is hidden stays so in this browser.
  offer() {
    const hidden = new Set(JSON.parse(localStorage.getItem('hidden layers') ?? '["coverage"]'));
    const apply = () => { for (const [name, groups] of Object.entries(SHOWN)) for (const group of groups) this.layers[group].style.display = hidden.has(name) ? 'none' : ''; };
    document.getElementById('layers').replaceChildren(...Object.keys(SHOWN).map((name) => h('label', {class: 'check'}, h('input', {type: 'checkbox', checked: !hidden.has(name), 'data-layer': name, onchange: (event) => {
      if (event.target.checked) hidden.delete(name); else hidden.add(name);
      localStorage.setItem('hidden layers', JSON.stringify([...hidden]));
      apply();
    }}), name)));
    apply();
  }

  press(word) {
    if (word === 'whole') { this.follow(false); this.zoom = 1; this.centre = null; this.look(); } else this.zoomBy(word === 'in' ? STEP : 1 / STEP);
  }

  onKey(event) {
    const ways = {ArrowLeft: [-.2, 0], ArrowRight: [.2, 0], ArrowUp: [0, .2], ArrowDown: [0, -.2]};
    if (event.key === '+' || event.key === '=') this.zoomBy(STEP);
    else if (event.key === '-') this.zoomBy(1 / STEP);
    else if (event.key === '0') this.press('whole');
    else if (event.key === 'f') this.follow(!this.following);
    else if (ways[event.key] && this.box) { const [dx, dy] = ways[event.key]; this.pan(dx * this.box[2] / this.zoom, dy * this.box[3] / this.zoom); } else return;
    event.preventDefault();
  }

  // Zooms about a point of the map, which stays where it is on the screen.
  zoomBy(factor, about = null) {
    if (!this.box) return;
    const before = this.zoom;
    this.zoom = Math.max(1, Math.min(MOST_ZOOM, before * factor));
    const [x, y] = this.middle();
    const [ax, ay] = about ?? [x, y];
    const share = before / this.zoom;
    this.centre = [ax + (x - ax) * share, ay + (y - ay) * share];
    this.look();
  }

  pan(dx, dy) {
    const [x, y] = this.middle();
    this.follow(false);
    this.centre = [x + dx, y + dy];
    this.look();
  }

  middle() {
    const [x, y, width, height] = this.box;
    return this.centre ?? [x + width / 2, -(y + height / 2)];
  }

  follow(on) {
    this.following = on;
    document.getElementById('follow').setAttribute('aria-pressed', String(on));
    if (on && this.zoom < 2) this.zoom = 3;
    if (on && this.where) this.centre = this.where.slice(0, 2);
    this.look();
  }

  lookAt(point) {
    if (!point || this.zoom === 1) return;
    this.follow(false);
    this.centre = point;
    this.look();
  }

  // Shows what was chosen of the place; its middle stays within it.
  look() {
    if (!this.box) return;
    const [x, y, width, height] = this.box;
    const w = width / this.zoom, t = height / this.zoom;
    const [cx, cy] = this.zoom === 1 ? [x + width / 2, -(y + height / 2)] : this.middle();
    this.centre = this.zoom === 1 ? null : [Math.max(x, Math.min(x + width, cx)), Math.max(-y - height, Math.min(-y, cy))];
    const [mx, my] = this.centre ?? [cx, cy];
    this.svg.setAttribute('viewBox', `${mx - w / 2} ${-my - t / 2} ${w} ${t}`);
    this.svg.style.setProperty('--near', (this.zoom ** -.6).toFixed(3));
    this.svg.classList.toggle('zoomed', this.zoom > 1);
    this.declutter();
  }

  // Of names that would cover each other the first one stays: rooms before doors before markers.
  declutter() {
    cancelAnimationFrame(this.tidy);
    this.tidy = requestAnimationFrame(() => {
      const taken = [];
      for (const text of this.svg.querySelectorAll('.room text, .door-name, text.tag, .share')) {
        text.classList.remove('covered');
        const box = text.getBoundingClientRect();
        if (!box.width) continue;
        const covered = taken.some((each) => each.left < box.right - 1 && each.right > box.left + 1 && each.top < box.bottom - 1 && each.bottom > box.top + 1);
        if (covered && !text.closest('.room')) text.classList.add('covered'); else taken.push(box);
      }
    });
  }

  // A pose is asked for: a press is where, a drag is where to.
  aim(hint, done) {
    this.aiming = done;
    document.getElementById('map-hint').textContent = hint;
    this.svg.scrollIntoView({block: 'nearest'});
  }

  down(event) {
    this.dragged = false;
    this.fingers.set(event.pointerId, event);
    this.from = {event, centre: this.box ? this.middle() : null, at: this.at(event)};
    if (this.aiming || this.zoom > 1) this.svg.setPointerCapture(event.pointerId);
  }

  move(event) {
    if (!this.fingers.has(event.pointerId) || !this.from) return;
    const before = this.fingers.get(event.pointerId);
    const far = Math.hypot(event.clientX - this.from.event.clientX, event.clientY - this.from.event.clientY) > MOVED;
    if (this.fingers.size === 2) {
      const [a, b] = [...this.fingers.values()];
      const other = a.pointerId === event.pointerId ? b : a;
      const gap = (one) => Math.hypot(one.clientX - other.clientX, one.clientY - other.clientY);
      if (gap(before) > 0) this.zoomBy(gap(event) / gap(before), this.at(event));
      this.dragged = true;
    } else if (this.aiming) {
      this.drawAim(this.from.at, this.at(event));
    } else if (far && this.zoom > 1) {
      const scale = this.svg.getScreenCTM().a;
      this.dragged = true;
      this.pan(-(event.clientX - before.clientX) / scale, (event.clientY - before.clientY) / scale);
    }
    this.fingers.set(event.pointerId, event);
  }

  up(event) {
    if (this.aiming && this.from && event.type === 'pointerup') {
      const [x, y] = this.from.at, [tx, ty] = this.at(event);
      const done = this.aiming;
      this.aiming = null;
      this.dragged = true;
      document.getElementById('map-hint').textContent = '';
      this.layers.aim.replaceChildren();
      done([x, y, Math.round(1000 * Math.atan2(ty - y, tx - x)) / 1000]);
    }
    this.fingers.delete(event.pointerId);
  }

  drawAim([x, y], [tx, ty]) {
    this.layers.aim.replaceChildren(s('path', {class: 'aim', d: line([[x, y], [tx, ty]])}), s('circle', {class: 'aim', cx: x, cy: -y, r: .2}));
  }

  show(state, parts, now, robots = {}) {
    const came = (...names) => names.some((name) => name in parts);
    if (came('grid')) this.drawGrid(state.grid);
    if (came('grid', 'places')) this.frame(state);
    if (came('links', 'places', 'grid')) this.drawLinks(state);
    if (came('doors')) this.drawDoors(state.doors);
    if (came('places', 'regions', 'mission')) this.drawPlaces(state, now);
    if (came('plan')) this.plan.setAttribute('d', line(state.plan ?? []));
    if (came('trail', 'pose')) this.driven.setAttribute('d', line(state.trail ?? []));
    if (came('scan')) this.lidar.setAttribute('d', (state.scan ?? []).map(([x, y]) => `M${x} ${-y}h0`).join(''));
    if (came('obstacles')) this.drawObstacles(state.obstacles);
    if (came('markers', 'grid')) this.drawMarkers(state.markers?.at);
    if (came('zones')) this.drawZones(state.zones);
    if (came('stations')) this.drawStations(state.stations);
    if (came('others')) this.drawOthers(state.others);
    if (came('pose', 'robots') || (came('status') && !state.pose)) this.drawRobot(state);
    if (came('robots', 'pose', 'status')) this.drawFleet(robots, state.places);
    if (came('coverage', 'places', 'regions')) this.drawCoverage(state);
    if (came('places', 'doors', 'markers', 'grid', 'robots')) this.declutter();
  }

  // Which part of each room's floor was in view within its threshold.
  drawCoverage({coverage, places, regions}) {
    this.layers.coverage.replaceChildren(...Object.entries(coverage ?? {}).flatMap(([name, share]) => {
      const at = regions?.[name]?.label ?? places?.[name]?.at;
      return at ? [s('text', {class: 'share', x: at[0], y: -at[1] + 1.6, 'font-size': .6}, `${Math.round(100 * share)} % seen`)] : [];
    }));
  }

  // Each robot of a fleet in its colour, with its name and its planned way; the one that is looked at is drawn whole.
  drawFleet(robots, places) {
    const known = names(robots).filter(Boolean);
    if (known.join() !== [...this.fleet.keys()].join()) {
      this.fleet = new Map(known.map((name) => {
        const hue = colour(name, robots);
        return [name, {
          robot: s('g', {class: `robot ${hue}`, 'data-robot': name}, s('title', {}, name), s('path', {d: ROBOT})),
          label: s('text', {class: `tag name ${hue}`}, short(name, 16)),
          plan: s('path', {class: `plan other ${hue}`}),
        }];
      }));
      const drawn = [...this.fleet.values()];
      this.layers.plans.replaceChildren(...drawn.map(({plan}) => plan));
      this.layers.fleet.replaceChildren(...drawn.flatMap(({robot, label}) => [robot, label]));
    }
    for (const [name, {robot, label, plan}] of this.fleet) {
      const {pose, plan: way, status, mission} = robots[name];
      const at = pose ?? places?.[status?.place]?.at;
      robot.setAttribute('visibility', at && name !== shown.robot ? 'visible' : 'hidden');
      robot.classList.toggle('gone', mission?.running === false);
      label.setAttribute('visibility', at ? 'visible' : 'hidden');
      label.classList.toggle('chosen', name === shown.robot);
      plan.setAttribute('d', name === shown.robot ? '' : line(way ?? []));
      if (!at) continue;
      placeAt(robot, at);
      label.setAttribute('x', at[0]);
      label.setAttribute('y', at[1] > (this.top ?? Infinity) - 1.2 ? -at[1] + .95 : -at[1] - .55);
    }
    const own = known.includes(shown.robot) ? colour(shown.robot, robots) : '';
    this.robot.setAttribute('class', `robot ${own}`);
    this.plan.setAttribute('class', `plan ${own}`);
  }

  drawGrid(grid) {
    const [l, b, r, t] = grid?.box ?? [0, 0, 0, 0];
    const image = {href: grid?.image, x: l, y: -t, width: r - l, height: t - b, preserveAspectRatio: 'none'};
    this.layers.grid.replaceChildren(...(grid ? [s('image', image)] : []));
  }

  frame({grid, places}) {
    let box = grid?.known;
    const points = Object.values(places ?? {}).map((place) => place.at).filter(Boolean);
    if (!box && points.length) {
      const xs = points.map((p) => p[0]), ys = points.map((p) => p[1]);
      box = [Math.min(...xs) - 1, Math.min(...ys) - 1, Math.max(...xs) + 4, Math.max(...ys) + 1];
    }
    if (!box) return;
    const [left, bottom, right, top] = box;
    this.width = right - left;
    this.top = top;
    this.box = [left - .3, -top - .3, right - left + .6, top - bottom + .6];
    this.look();
  }

  drawLinks({grid, links, places}) {
    // Only where there is no map to see them on.
    const both = (grid ? [] : links ?? []).filter(([a, b]) => places?.[a]?.at && places?.[b]?.at);
    this.layers.links.replaceChildren(...both.map(([a, b]) => s('path', {class: 'link', d: line([places[a].at, places[b].at])})));
  }

  drawDoors(doors) {
    const drawn = Object.entries(doors ?? {}).filter(([, door]) => door.line).flatMap(([name, door]) => {
      const [x1, y1, x2, y2] = door.line;
      const shut = door.open === false;
      const path = s('path', {class: shut ? 'door shut' : 'door', d: line([[x1, y1], [x2, y2]]), 'data-door': name},
        s('title', {}, `door ${name} ${shut ? 'closed' : 'open'}`));
      const [x, y] = [(x1 + x2) / 2, -(y1 + y2) / 2];
      // Beside the door: at its right end, or right of it.
      const [dx, dy] = Math.abs(x2 - x1) > Math.abs(y2 - y1) ? [Math.abs(x2 - x1) / 2 + .45, -.15] : [.6, .16];
      return [path, shut ? s('text', {class: 'cross', x, y: y + .3}, '×') : null, s('text', {class: 'door-name', x: x + dx, y: y + dy}, short(name, 8))];
    }).filter(Boolean);
    this.layers.doors.replaceChildren(...drawn);
  }

  drawObstacles(obstacles) {
    this.layers.obstacles.replaceChildren(...(obstacles ?? []).map(([x, y]) =>
      s('rect', {class: 'obstacle', x: x - .06, y: -y - .06, width: .12, height: .12})));
  }

  drawMarkers(at) {
    this.layers.markers.replaceChildren(...Object.entries(at ?? {}).flatMap(([id, [x, y]]) => [
      s('rect', {class: 'tag', x: x - .17, y: -y - .17, width: .34, height: .34, 'data-marker': id}, s('title', {}, `marker ${id}`)),
      s('text', {class: 'tag', x, y: y > this.top - .7 ? -y + .65 : -y - .3}, id)]));
  }

  drawZones(zones) {
    this.layers.zones.replaceChildren(...Object.entries(zones ?? {}).map(([name, {corners, speed}]) => s('path', {
      class: speed === null ? 'zone keep_out' : 'zone slow', d: `${line(corners)}Z`, 'data-zone': name},
    s('title', {}, speed === null ? `${name}: kept out of` : `${name}: at most ${speed} m/s`))));
  }

  drawStations(stations) {
    this.layers.stations.replaceChildren(...Object.entries(stations ?? {}).map(([room, pose]) => {
      const station = s('path', {class: 'station', d: STATION, 'data-station': room}, s('title', {}, `charging station of ${room}`));
      placeAt(station, pose);
      return station;
    }));
  }

  drawOthers(others) {
    this.layers.others.replaceChildren(...Object.entries(others ?? {}).map(([name, pose]) => {
      const robot = s('g', {class: 'robot other', 'data-robot': name}, s('title', {}, name), s('path', {d: ROBOT}));
      placeAt(robot, pose);
      return s('g', {}, robot, s('text', {class: 'tag', x: pose[0], y: -pose[1] - .6}, short(name, 16)));
    }));
  }

  drawRobot({pose, places, status}) {
    const at = pose ?? places?.[status?.place]?.at;
    this.robot.setAttribute('visibility', at ? 'visible' : 'hidden');
    this.where = at;
    if (at) placeAt(this.robot, at);
    if (at && this.following) { this.centre = at.slice(0, 2); this.look(); }
  }

  drawPlaces(state, now) {
    const placed = Object.entries(state.places ?? {}).filter(([, place]) => place.at);
    const key = JSON.stringify([placed.map(([name, {at}]) => [name, at]), state.regions, this.width]);
    if (key !== this.key) {
      this.key = key;
      const focused = document.activeElement?.dataset?.place;
      this.rooms.clear();
      const drawn = placed.map(([name, {at}]) => this.drawPlace(name, at, state.regions?.[name]));
      this.layers.regions.replaceChildren(...drawn.map((each) => each.floor));
      this.layers.places.replaceChildren(...drawn.map((each) => each.room));
      if (focused) this.rooms.get(focused)?.room.focus();
    }
    this.tick(state, now);
  }

  drawPlace(name, at, region) {
    // A place without a region is a disc with its words on the right.
    const floor = region ? s('path', {class: 'floor', d: filled(region.boxes)})
      : s('circle', {class: 'floor', cx: at[0], cy: -at[1], r: .5});
    const [x, y] = region?.label ?? [at[0] + .8, at[1] - .25];
    const written = short(name, 16);
    const readable = (this.width ?? 16) / 24;
    const fits = region ? 2.9 * region.room / Math.max(4, written.length) : readable;
    const size = Math.max(readable / 2, Math.min(readable, fits));
    const words = s('tspan', {class: 'age', ...(region ? {x, dy: size * .95} : {dx: size * .4}), 'font-size': size * .8}, '');
    const label = s('text', {class: region ? null : 'beside', x, y: -y, 'font-size': size}, ...(!region || region.room > .25 * size * written.length ? [written, words] : []));
    const choose = () => this.onPlace(name);
    const onkeydown = (event) => {
      if (event.key !== 'Enter' && event.key !== ' ') return;
      event.preventDefault();
      choose();
    };
    const outline = floor.cloneNode();
    outline.setAttribute('class', 'outline');
    const room = s('g', {class: 'room', tabindex: 0, role: 'button', 'data-place': name, onclick: choose, onkeydown},
      s('title', {}, name), outline, s('circle', {class: 'spot', cx: at[0], cy: -at[1], r: .12}), label);
    this.rooms.set(name, {room, floor, words});
    return {floor, room};
  }

  tick(state, now) {
    for (const [name, {room, floor, words}] of this.rooms) {
      if (!state.places?.[name]) continue;
      const {share, text} = wait(state, name, now);
      floor.style.fill = `color-mix(in srgb, var(--late) ${Math.round(100 * share)}%, var(--fresh))`;
      if (words.textContent !== text) words.textContent = text;
      const said = text.startsWith('never') ? 'never visited' : `unvisited for ${text.replace(' !', '')}`;
      room.setAttribute('aria-label', `${name}: ${said}${text.endsWith('!') ? ', too long' : ''}`);
    }
  }
}
