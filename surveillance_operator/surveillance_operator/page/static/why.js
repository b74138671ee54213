// Why the robot goes where it goes: the decision, what is known of a place, proofs, why not.
import {$, h, ask, names} from './dom.js';

const MOST_SCORES = 12;
const clock = () => `${new Date().toTimeString().slice(0, 8)}`;

export class Why {
  constructor(state) {
    this.state = state;
    this.names = '';
    $('ask-facts').addEventListener('click', () => this.facts());
    $('why-not').addEventListener('click', () => this.whyNot());
  }

  choose(place) {
    $('place').value = place;
    if (!$('asking').hidden) this.facts();
  }

  show() {
    const {decision, places, status} = this.state;
    $('decision-line').classList.toggle('warn', Boolean(status?.waiting_for_help));
    if (status?.waiting_for_help) {
      $('decision-line').textContent = 'the robot waits for help';
      $('reason').textContent = status.text;
      $('scores').replaceChildren();
    } else if (!decision) {
      $('decision-line').textContent = 'no decision yet';
      for (const id of ['reason', 'scores', 'answer', 'facts']) $(id).replaceChildren();
    } else {
      $('decision-line').textContent = `decision ${decision.number}: ${decision.from} → ${decision.place} [${decision.rule}]`;
      $('reason').textContent = decision.reason;
      const ranked = decision.scores.toSorted((a, b) => b[1] - a[1]);
      const rows = ranked.filter(([name], place) => place < MOST_SCORES || name === decision.place).map(([name, score]) =>
        h('tr', {class: name === decision.place ? 'chosen' : null}, h('td', {}, name === decision.place ? `→ ${name}` : name), h('td', {class: 'n'}, String(score))));
      $('scores').replaceChildren(h('caption', {class: 'hidden'}, 'Candidates'), h('thead', {}, h('tr', {}, h('th', {scope: 'col'}, 'Candidate'), h('th', {scope: 'col', class: 'n'}, `Score (${decision.policy}), highest wins`))), h('tbody', {}, ...rows), ...(ranked.length > rows.length ? [h('tfoot', {}, h('tr', {}, h('td', {colspan: 2}, `and ${ranked.length - rows.length} more`)))] : []));
    }
    const known = names(places);
    if (JSON.stringify(known) !== this.names) {
      const chosen = $('place').value;
      this.names = JSON.stringify(known);
      // A recording answers no questions.
      $('asking').hidden = !known.length || document.documentElement.dataset.kind === 'replay';
      $('place').replaceChildren(...known.map((name) => h('option', {value: name}, name)));
      if (known.includes(chosen)) $('place').value = chosen;
    }
  }

  // The place that is asked about; what was answered about another one goes.
  asked() {
    const place = $('place').value;
    if (place !== this.place) for (const id of ['answer', 'facts']) $(id).replaceChildren();
    this.place = place;
    return place;
  }

  async whyNot() {
    const place = this.asked();
    const found = await ask('why_not', {place});
    $('answer').replaceChildren(h('p', {class: found.ok ? 'strong' : 'warn'}, h('time', {}, clock()), found.text), ...(found.premises?.length ? [h('ul', {class: 'proof'}, ...found.premises.map((text) => h('li', {}, text)))] : []));
  }

  async facts() {
    const place = this.asked();
    const found = await ask('facts', {place});
    if (!found.ok) { $('facts').replaceChildren(h('p', {class: 'warn'}, found.text)); return; }
    $('facts').replaceChildren(h('h3', {}, h('time', {}, clock()), `What is known of ${place}`), ...found.facts.map(([fact, asserted]) => asserted ? h('p', {class: 'fact'}, fact, h('small', {}, ' asserted')) : this.derived(fact)));
  }

  derived(fact) {
    const body = h('div');
    const box = h('details', {'data-fact': fact}, h('summary', {}, fact, h('small', {}, ' derived: open for its proof')), body);
    box.addEventListener('toggle', async () => {
      if (!box.open || body.querySelector('.proof')) return;
      const found = await ask('explain', {fact});
      body.replaceChildren(found.ok ? tree(found.lines) : h('p', {class: 'warn'}, found.text));
    });
    return box;
  }
}

function tree(lines) {
  const root = h('ul', {class: 'proof'});
  const open = [root];
  for (const [depth, text] of lines) {
    const item = h('li', {}, text);
    open.length = Math.min(open.length, depth + 1);
    open.at(-1).append(item);
    const inner = h('ul', {class: 'proof'});
    item.append(inner);
    open.push(inner);
  }
  for (const list of root.querySelectorAll('ul')) if (!list.childElementCount) list.remove();
  return root;
}
