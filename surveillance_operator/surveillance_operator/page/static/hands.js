// What a person may do: each form says what came of it.
import {$, h, act} from './dom.js';

const WAYS = [['battery_controller', 'battery set 50'], ['planner_controller', 'plan set [[10,8,0]]'], ['motion_controller', 'move 2 0'], ['arm_controller', 'status']];

export class Hands {
  constructor(state, may) {
    this.state = state;
    this.may = may;
    this.names = '';
    if (!may) return;
    for (const button of document.querySelectorAll('[data-machine]')) button.addEventListener('click', async () => {
      const found = await act('machine', {word: button.dataset.machine});
      $('machine-answer').textContent = found.text;
    });
    const number = (label, value, name) => h('label', {}, label, h('input', {name, value, inputmode: 'decimal', required: true}));
    const text = (label, name, value = '', long = false) => h('label', {}, label, h('input', {name, value, class: long ? 'long' : null, required: true, autocomplete: 'off'}));
    this.place = h('select', {name: 'place'});
    this.door = h('select', {name: 'door'});
    this.gone = h('select', {name: 'name'});
    this.policy = h('select', {name: 'policy'}, ...['tour', 'lookahead', 'oldest', 'random', 'CR', 'HCR', 'HPCC', 'cycle'].map((name) => h('option', {value: name}, name)));
    this.controller = h('select', {name: 'controller'}, ...WAYS.map(([name]) => h('option', {value: name}, name)));
    this.requests = h('pre', {id: 'requests'}, '');
    this.x = number('x [m]', '', 'x');
    this.y = number('y [m]', '', 'y');
    const f = (form) => Object.fromEntries(new FormData(form));
    $('hands-body').append(
      this.form('Robot', [h('label', {}, 'Place', this.place)], [['Go there', 'go', (g) => ({place: g.place})], ['Call it home', 'go', () => ({place: ''})]]),
      this.form('Door', [h('label', {}, 'Door', this.door)], [['Open', 'door', (g) => ({door: g.door, open: true})], ['Close', 'door', (g) => ({door: g.door, open: false})]]),
      this.form('Obstacle: a click on the map fills in x and y', [text('Name', 'name', 'box'), this.x, this.y, number('radius [m]', '0.3', 'radius')],
        [['Place', 'obstacle', (g) => ({name: g.name, x: +g.x, y: +g.y, radius: +g.radius})], ['Take away', 'remove_obstacle', (g) => ({name: g.name}), true]]),
      this.form('New room: x and y as above', [text('Name', 'name', 'R9'), text('Doors', 'doors', 'D1')],
        [['Add', 'add_room', (g) => ({name: g.name, x: +this.x.lastChild.value, y: +this.y.lastChild.value, doors: g.doors.split(/[ ,]+/).filter(Boolean)})]]),
      this.form('Room', [h('label', {}, 'Room', this.gone)], [['Remove', 'remove_room', (g) => ({name: g.name})]]),
      this.form('Threshold', [number('seconds', '120', 'seconds')], [['Set', 'threshold', (g) => ({seconds: +g.seconds})]]),
      this.form('Policy', [h('label', {}, 'Policy', this.policy)], [['Set', 'policy', (g) => ({policy: g.policy})]]),
      this.form('Controllers: answers in mode MANUAL', [h('label', {}, 'Controller', this.controller), text('Command', 'line', WAYS[0][1], true)], [['Send', 'command', (g) => g]], this.requests),
    );
    this.controller.addEventListener('change', () => { this.controller.form.elements.line.value = WAYS.find(([name]) => name === this.controller.value)[1]; });
    void f;
  }

  form(title, fields, buttons, more) {
    const form = h('form', {onsubmit: (event) => event.preventDefault()});
    const set = h('fieldset', {}, h('legend', {}, title), more ?? null, h('div', {class: 'row'}, ...fields, ...buttons.map(([label, name, fieldsOf, unchecked]) =>
      h('button', {type: 'button', 'data-act': name, onclick: async () => {
        if (!unchecked && !form.reportValidity()) return;
        const found = await act(name, fieldsOf(Object.fromEntries(new FormData(form))));
        $('done').textContent = (found.ok ? '✓ ' : '✗ ') + found.text;
        $('done').className = found.ok ? 'ok' : 'warn';
      }}, label))));
    form.append(set);
    return form;
  }

  choose(place) {
    if (this.may) this.place.value = place;
  }

  point([x, y]) {
    if (!this.may) return;
    this.x.lastChild.value = x;
    this.y.lastChild.value = y;
  }

  show() {
    if (!this.may) return;
    const {places, doors, mission, requests} = this.state;
    const names = [Object.keys(places ?? {}), Object.keys(doors ?? {})];
    if (names.join('|') !== this.names) {
      this.names = names.join('|');
      for (const [select, list] of [[this.place, names[0]], [this.gone, names[0]], [this.door, names[1]]]) {
        const chosen = select.value;
        select.replaceChildren(...list.map((name) => h('option', {value: name}, name)));
        if (list.includes(chosen)) select.value = chosen;
      }
    }
    if (mission?.policy && document.activeElement !== this.policy) {
      if (![...this.policy.options].some((o) => o.value === mission.policy)) this.policy.append(h('option', {value: mission.policy}, mission.policy));
      if (this.shown !== mission.policy) this.policy.value = this.shown = mission.policy;
    }
    this.requests.textContent = Object.entries(requests ?? {}).map(([name, text]) => `${name}: ${text}`).join('\n');
  }
}
