// What a person may do: each form says what came of it.
import {$, h, act} from './dom.js';

const COMMANDS = {
  battery_controller: 'battery set 50',
  planner_controller: 'plan set [[10,8,0]]',
  motion_controller: 'move 2 0',
  arm_controller: 'status',
};

const select = (name, ...options) => h('select', {name}, ...options.map((value) => h('option', {value}, value)));
const labelled = (text, input) => h('label', {}, text, input);
const number = (name, text, value = '') => labelled(text, h('input', {name, value, inputmode: 'decimal', required: true}));
const word = (name, text, value, long = false) =>
  labelled(text, h('input', {name, value, class: long ? 'long' : null, required: true, autocomplete: 'off'}));

function offer(list, names) {
  const chosen = list.value;
  list.replaceChildren(...names.map((name) => h('option', {value: name}, name)));
  if (names.includes(chosen)) list.value = chosen;
}

export class Hands {
  constructor(state, may) {
    this.state = state;
    this.may = may;
    if (!may) return;
    for (const button of document.querySelectorAll('[data-machine]')) {
      button.addEventListener('click', async () => {
        $('machine-answer').textContent = (await act('machine', {word: button.dataset.machine})).text;
      });
    }
    this.place = select('place');
    this.door = select('door');
    this.room = select('name');
    this.policy = select('policy');
    this.controller = select('controller', ...Object.keys(COMMANDS));
    this.x = number('x', 'x [m]');
    this.y = number('y', 'y [m]');
    this.threshold = number('seconds', 'Threshold [s]');
    this.requests = h('pre', {id: 'requests'}, '');
    this.current = {};
    $('hands-body').append(
      this.form('Robot', [labelled('Place', this.place)],
        [['Go there', 'go', (g) => ({place: g.place})], ['Call it home', 'go', () => ({place: ''})]]),
      this.form('Door', [labelled('Door', this.door)],
        [['Open', 'door', (g) => ({door: g.door, open: true})], ['Close', 'door', (g) => ({door: g.door, open: false})]]),
      this.form('Urgency', [this.threshold], [['Set', 'threshold', (g) => ({seconds: +g.seconds})]]),
      this.form('Choice of places', [labelled('Policy', this.policy)], [['Set', 'policy', (g) => ({policy: g.policy})]]),
      this.form('Obstacle: a click on the map fills in x and y',
        [word('name', 'Name', 'box'), this.x, this.y, number('radius', 'radius [m]', '0.3')],
        [['Place', 'obstacle', (g) => ({name: g.name, x: +g.x, y: +g.y, radius: +g.radius})],
          ['Take away', 'remove_obstacle', (g) => ({name: g.name}), true]]),
      this.form('New room: at x and y above', [word('name', 'Name', 'R9'), word('doors', 'Doors', 'D1')],
        [['Add', 'add_room', (g) => ({name: g.name, ...this.point(), doors: g.doors.split(/[ ,]+/).filter(Boolean)})]]),
      this.form('Room', [labelled('Room', this.room)], [['Remove', 'remove_room', (g) => ({name: g.name})]]),
      this.form('Controllers: answers in mode MANUAL',
        [labelled('Controller', this.controller), word('line', 'Command', COMMANDS.battery_controller, true)],
        [['Send', 'command', (g) => g]], this.requests),
    );
    this.controller.addEventListener('change', () => {
      this.controller.form.elements.line.value = COMMANDS[this.controller.value];
    });
  }

  // Buttons: label, action, its fields from the form's, whether the form may be incomplete.
  form(title, fields, buttons, more) {
    const form = h('form', {onsubmit: (event) => event.preventDefault()});
    const done = async (name, fieldsOf, incomplete) => {
      if (!incomplete && !form.reportValidity()) return;
      const found = await act(name, fieldsOf(Object.fromEntries(new FormData(form))));
      $('done').textContent = (found.ok ? '✓ ' : '✗ ') + found.text;
      $('done').className = found.ok ? 'ok' : 'warn';
    };
    const pressed = buttons.map(([label, name, fieldsOf, incomplete]) =>
      h('button', {type: 'button', 'data-act': name, onclick: () => done(name, fieldsOf, incomplete)}, label));
    form.append(h('fieldset', {}, h('legend', {}, title), more ?? null, h('div', {class: 'row'}, ...fields, ...pressed)));
    return form;
  }

  choose(place) {
    if (this.may) this.place.value = place;
  }

  point(at) {
    if (!this.may) return {};
    const [x, y] = [this.x, this.y].map((label) => label.querySelector('input'));
    if (at) [x.value, y.value] = at;
    return {x: +x.value, y: +y.value};
  }

  // A setting as the mission has it now, unless a person is changing it.
  follow(name, input, value) {
    if (value === undefined || value === null || this.current[name] === value || document.activeElement === input) return;
    this.current[name] = input.value = value;
  }

  show() {
    if (!this.may) return;
    const {places, doors, mission, requests} = this.state;
    const names = JSON.stringify([Object.keys(places ?? {}), Object.keys(doors ?? {}), mission?.policies]);
    if (names !== this.names) {
      this.names = names;
      offer(this.place, Object.keys(places ?? {}));
      offer(this.room, Object.keys(places ?? {}));
      offer(this.door, Object.keys(doors ?? {}));
      offer(this.policy, mission?.policies ?? []);
    }
    this.follow('policy', this.policy, mission?.policy || null);
    this.follow('threshold', this.threshold.querySelector('input'), mission?.threshold);
    this.requests.textContent = Object.entries(requests ?? {}).map(([name, text]) => `${name}: ${text}`).join('\n');
  }
}
