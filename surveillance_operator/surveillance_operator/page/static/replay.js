// Moves through a recording: slider, speed, jumps.
import {$, h, act, timeOfDay} from './dom.js';

const SPEEDS = [0.1, 0.5, 1, 2, 5, 10, 30, 100];

export class Replay {
  constructor() {
    this.playing = true;
    this.dragging = false;
    $('speed').replaceChildren(...SPEEDS.map((speed) => h('option', {value: speed, selected: speed === 1}, `${speed}×`)));
    $('speed').addEventListener('change', () => act('speed', {speed: +$('speed').value}));
    $('play').addEventListener('click', () => act(this.playing ? 'pause' : 'play', {}));
    $('slider').addEventListener('input', () => { this.dragging = true; act('seek', {to: +$('slider').value}); });
    $('slider').addEventListener('change', () => { this.dragging = false; });
    for (const button of document.querySelectorAll('[data-jump]')) button.addEventListener('click', async () => {
      const found = await act('jump', {kind: button.dataset.jump});
      $('jumped').textContent = found.ok ? '' : found.text;
    });
  }

  // Goes to a moment, seconds since 1970.
  jump(at) {
    act('seek', {to: Math.max(0, at - (this.begin ?? at))});
  }

  show({at, length, playing, speed, time, read}) {
    this.playing = playing;
    this.begin = time - at;
    $('play').textContent = playing ? 'Pause' : 'Play';
    $('slider').max = length;
    if (!this.dragging) $('slider').value = at;
    if (document.activeElement !== $('speed')) $('speed').value = speed;
    const two = (number) => String(Math.floor(number)).padStart(2, '0');
    const passed = (seconds) => `${two(seconds / 3600)}:${two(seconds / 60 % 60)}:${two(seconds % 60)}`;
    const day = new Date(1000 * time).toLocaleDateString('sv');
    $('moment').textContent = `${passed(at)} of ${passed(length)} · ${day} ${timeOfDay(time)}${read < 1 ? ` · reading, ${Math.round(100 * read)} %` : ''}`;
  }
}
