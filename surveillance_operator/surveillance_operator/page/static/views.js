// The page's views, one at a time: named by the address, chosen by tabs or keys.
const VIEWS = [...document.querySelectorAll('.view')].map((each) => each.dataset.view);
const KEYS = {1: 'desk', 2: 'events', 3: 'engineer'};
const shows = [];

export const view = () => { const name = location.hash.slice(2); return VIEWS.includes(name) ? name : VIEWS[0]; };
export const open = (name) => { location.hash = `#/${name}`; };
export const whenShown = (name, call) => shows.push([name, call]);

export function typing(event) {
  return Boolean(event.target.closest?.('input, select, textarea')) || event.ctrlKey || event.metaKey || event.altKey;
}

function show() {
  const now = view();
  document.body.dataset.view = now;
  for (const each of document.querySelectorAll('.view')) each.hidden = each.dataset.view !== now;
  for (const link of document.querySelectorAll('header nav a[href^="#/"]')) {
    if (link.hash === `#/${now}`) link.setAttribute('aria-current', 'page');
    else link.removeAttribute('aria-current');
  }
  for (const [name, call] of shows) if (name === now) call();
}

export function startViews() {
  addEventListener('hashchange', show);
  document.addEventListener('keydown', (event) => { if (KEYS[event.key] && !typing(event)) open(KEYS[event.key]); });
  show();
}
