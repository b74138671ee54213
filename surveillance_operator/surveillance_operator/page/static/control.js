// What a person may do: one form for each thing, and what came of it below the form.
import {$, h, act, names} from './dom.js';
import {startStop} from './head.js';

// An example of each controller's commands.
const COMMANDS = {
  battery_controller: 'battery set 50',
  planner_controller: 'plan set []',
  motion_controller: 'move 2 0',
};
const POSES = ['left', 'home', 'right', 'back', 'stop'];

const select = (name, label, ...options) =>
  h('select', {name, 'aria-label': label}, ...options.map((value) => h('option', {value}, value)));
const input = (name, text, value, attributes = {}) =>
  h('label', {}, text, h('input', {name, value, required: true, autocomplete: 'off', ...attributes}));
const number = (name, text, value = '') => input(name, text, value, {inputmode: 'decimal', class: 'short'});

function offer(list, names) {
  const chosen = list.value;
  list.replaceChildren(...names.map((name) => h('option', {value: name}, name)));
  if (names.includes(chosen)) list.value = chosen;
}

// A setting as the mission has it now, unless a person is changing it.
function follow(field, value) {
  if (value === undefined || value === null || field.dataset.known === String(value) || document.activeElement === field) return;
  field.dataset.known = field.value = value;
}

// A press that cannot be taken back here is asked for: the button shows the question, and the same press again means yes.
const ASKED = 5000;

function confirmed(button, label, question) {
  const again = button.textContent === question;
  button.textContent = again ? label : question;
  if (!again) setTimeout(() => { button.textContent = label; }, ASKED);
  return again;
}

export class Control {
  constructor(state, may, guard = may) {
    this.state = state;
    this.may = may;
    if (guard) startStop();
    if (!may) return;
    for (const button of document.querySelectorAll('[data-machine]')) {
      button.addEventListener('click', async () => {
        $(button.dataset.answer ?? 'machine-answer').textContent = (await act('machine', {word: button.dataset.machine})).text;
      });
    }
    this.place = select('place', 'Place');
    this.door = select('door', 'Door');
    this.room = select('name', 'Room');
    this.policy = select('policy', 'Policy');
    this.controller = select('controller', 'Controller', ...Object.keys(COMMANDS));
    this.command = h('input', {name: 'line', value: COMMANDS.battery_controller, class: 'long', required: true, autocomplete: 'off', 'aria-label': 'Command'});
    this.seconds = h('input', {name: 'seconds', inputmode: 'decimal', required: true, class: 'short', 'aria-label': 'Threshold in seconds'});
    this.requests = h('pre', {id: 'requests', role: 'status'}, '');
    this.point = this.form('Point', [number('x', 'x [m]'), number('y', 'y [m]'), h('span', {class: 'note'}, 'or click the map')], []);
    this.answer = this.form('Command', [this.requests, this.controller, this.command], [['Send', 'command', (g) => g]]);
    this.arm = this.form('Arm', [select('pose', 'Pose', ...POSES)], [['Move', 'arm', (g) => g]]);
    this.obstacle = this.form('Obstacle', [input('name', 'name', 'box', {class: 'short'}), number('radius', 'radius [m]', '0.3')],
      [['Place', 'obstacle', (g) => ({...g, ...this.at()}), this.point],
        ['Remove', 'remove_obstacle', (g) => ({name: g.name})]]);
    $('control-body').append(
      this.form('Robot', [this.place], [['Go there', 'go', (g) => g], ['Call it home', 'go', () => ({place: ''})]]),
      this.form('Door', [this.door], [['Open', 'door', (g) => ({...g, is_open: true})], ['Close', 'door', (g) => ({...g, is_open: false})]]),
      this.form('Threshold', [this.seconds, h('span', {}, 's')], [['Set', 'threshold', (g) => g]]),
      this.form('Policy', [this.policy], [['Set', 'policy', (g) => g]]),
      this.arm,
      this.form('Room', [this.room], [['Remove', 'remove_room', (g) => g, null, ({name}) => `Remove ${name}?`]]),
      this.point,
      this.form('New room', [input('name', 'name', 'R9', {class: 'short'}), input('doors', 'doors', 'D1', {class: 'short'})],
        [['Add', 'add_room', (g) => ({name: g.name, ...this.at(), doors: g.doors.split(/[ ,]+/).filter(Boolean)}), this.point]]),
      this.obstacle,
      this.answer,
    );
    this.controller.addEventListener('change', () => { this.command.value = COMMANDS[this.controller.value]; });
  }

  // Buttons: label, action, its fields from the form's, another form that it reads, too, what is asked before. The Enter key in a field is the first button.
  form(title, fields, buttons) {
    const form = h('form', {'aria-label': title});
    const pressed = buttons.map(([label, name, fieldsOf, other, asks], number) => h('button', {type: number ? 'button' : 'submit', 'data-act': name, onclick: async (event) => {
      event.preventDefault();
      if (![form, other].every((each) => !each || each.reportValidity())) return;
      if (asks && !confirmed(event.currentTarget, label, asks(Object.fromEntries(new FormData(form))))) return;
      const found = await act(name, fieldsOf(Object.fromEntries(new FormData(form))));
      form.append($('done'));
      $('done').textContent = (found.ok ? '✓ ' : '✗ ') + found.text;
      $('done').className = found.ok ? 'ok' : 'warn';
    }}, label));
    form.append(h('b', {}, title), h('div', {class: 'row'}, ...fields, ...pressed));
    return form;
  }

  choose(place) {
    if (this.may) this.place.value = place;
  }

  pick([x, y]) {
    if (this.may) Object.assign(this.point.elements.x, {value: x}), Object.assign(this.point.elements.y, {value: y});
  }

  at() {
    return Object.fromEntries(new FormData(this.point));
  }

  // Offers what this mission has, and shows what its controllers wait for.
  show() {
    if (!this.may) return;
    const {places, doors, mission, requests, health} = this.state;
    const offered = JSON.stringify([names(places), names(doors), mission?.policies]);
    if (offered !== this.offered) {
      this.offered = offered;
      offer(this.place, names(places));
      offer(this.room, names(places));
      offer(this.door, names(doors));
      offer(this.policy, mission?.policies ?? []);
      for (const list of [this.place, this.room, this.door]) list.form.hidden = !list.options.length;
    }
    follow(this.policy, mission?.policy || null);
    follow(this.seconds, mission?.threshold);
    if (mission?.mode === 'MANUAL' && this.answer.previousSibling) $('control-body').prepend(this.answer);
    this.arm.hidden = !health?.nodes?.arm_controller;
    this.obstacle.hidden = !health?.nodes?.simulator;
    const waiting = Object.entries(requests ?? {}).filter(([, text]) => text);
    const text = waiting.map(([name, said]) => `${name}: ${said}`).join('\n');
    if (text === this.requests.textContent) return;
    this.requests.textContent = text;
    const [asking] = waiting.filter(([name, said]) => said.includes('Answer with') && said !== this.before?.[name]).map(([name]) => name);
    this.before = {...requests};
    if (asking && document.activeElement !== this.command) {
      this.controller.value = asking;
      this.command.value = COMMANDS[asking];
    }
  }
}
