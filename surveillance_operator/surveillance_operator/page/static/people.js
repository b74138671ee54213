// Who has a link of their own: made and taken back by an operator.
import {$, h, act} from './dom.js';
import {whenShown} from './views.js';

export function startPeople() {
  const list = async () => {
    const found = await act('links', {});
    const links = found.links ?? [];
    $('links').replaceChildren(...(links.length ? links.map(({name, role, made}) => h('li', {},
      `${name}, ${role}, since ${new Date(1000 * made).toLocaleDateString('en-GB')} `,
      h('button', {type: 'button', 'data-revoke': name, onclick: async () => { await act('revoke_link', {name}); list(); }}, 'Take it back'))) : [h('li', {}, 'nobody has one')]));
  };
  $('make-link').addEventListener('submit', async (event) => {
    event.preventDefault();
    const found = await act('make_link', Object.fromEntries(new FormData($('make-link'))));
    $('new-link').replaceChildren(found.ok ? h('span', {}, `${found.text}, shown this once: `, h('a', {href: found.link}, found.link)) : `✗ ${found.text}`);
    list();
  });
  whenShown('people', list);
}
