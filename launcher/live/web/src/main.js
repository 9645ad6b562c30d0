// The live page: takes the frames of the server, and hands each to the part of the page that shows it.

import { orders } from './orders.js';
import { player } from './player.js';
import { ring } from './ring.js';
import { scene } from './scene.js';
import { showEvents, showTiming } from './tables.js';

const KEPT_ROWS = 1200; // a minute; the server keeps as many for new clients
const RECONNECT_MS = 1000;
const at = id => document.getElementById(id);
const put = (id, words) => { at(id).textContent = words; };
const number = (value, digits, unit) => (Number.isFinite(value) ? `${value.toFixed(digits)} ${unit}` : '–');

const picture = scene(at('scene'));
const form = at('inject') ? orders() : null; // a recorded flight takes no orders
const bar = at('player') ? player() : null;
let flight = null; // the frame of the flight, with its samples: `time`, `samples` by column
let plots = null;
let happened = '';
let due = false;
let anew = false; // true if the samples were replaced since the last drawing

const TAKE = { position: takePosition, flight: begin, rows: takeRows, status: takeStatus, timing: takeTiming, happened: takeHappened, phase: takePhase };

function connect() {
  const socket = new WebSocket(`ws${location.protocol.slice(4)}//${location.host}/ws`);
  socket.onmessage = ({ data }) => {
    const frame = JSON.parse(data);
    TAKE[frame.kind]?.(frame);
  };
  socket.onclose = () => {
    takePhase({ phase: 'disconnected', why: 'the page’s server has ended; this is the last picture' });
    setTimeout(connect, RECONNECT_MS);
  };
}

function begin(frame) {
  if (flight) { // another flight, or the same one after a lost connection: the page begins anew with the last minute
    location.reload();
    return;
  }
  flight = { ...frame, time: [], samples: Object.fromEntries(frame.columns.map(name => [name, []])) };
  flight.happened = { faults: [], absences: [], phases: [], events: [] };
  document.title = `${frame.name}: ${bar ? 'recorded' : 'live'} flight`;
  put('name', frame.name);
  const facts = [bar ? ['run', frame.run] : ['namespace', frame.namespace], ['mode', frame.mode], ['profile', frame.profile], ['rate', `${frame.rate_hz} Hz`]];
  at('facts').replaceChildren(...facts.map(([name, value]) => {
    const span = document.createElement('span');
    span.append(`${name} `, Object.assign(document.createElement('b'), { textContent: value }));
    return span;
  }));
  at('age').hidden = !frame.realtime;
  picture.begin(frame);
  form?.begin(frame);
  bar?.begin(frame);
  ring(at('ring'), frame, null);
  showEvents(at('events'), flight.happened);
}

function takeRows({ rows, anew: isNew }) {
  if (!flight) return;
  if (isNew) {
    for (const samples of [flight.time, ...Object.values(flight.samples)]) samples.splice(0);
    picture.restart();
    anew = true;
  }
  for (const [time, ...values] of rows) {
    flight.time.push(time);
    flight.columns.forEach((name, i) => flight.samples[name].push(values[i]));
  }
  const surplus = flight.time.length - KEPT_ROWS;
  if (surplus > 0) for (const samples of [flight.time, ...Object.values(flight.samples)]) samples.splice(0, surplus);
  picture.add(rows.map(([time, ...values]) => ({ time, ...Object.fromEntries(flight.columns.map((name, i) => [name, values[i]])) })));
  if (!flight.time.length) return;
  const newest = name => flight.samples[name].at(-1);
  put('time', `${flight.time.at(-1).toFixed(1)} of ${flight.duration_s.toFixed(0)} s`);
  put('error', number(newest('error'), 3, 'm'));
  put('age-now', flight.realtime ? number(newest('age_ms'), 2, 'ms') : '–');
  put('wind', number(Math.hypot(newest('mean_wind_north'), newest('mean_wind_east'), newest('mean_wind_down')), 1, 'm/s'));
  if (due) return;
  due = true;
  setTimeout(draw, 100); // ten times a second is enough for the eye
}

function draw() {
  due = false;
  if (document.hidden) return;
  if (plots) plots.update(anew);
  else if (flight.time.length > 1) {
    const group = { time: flight.time, flights: [{ columns: flight.samples }], lines: flight.lines, happened: flight.happened };
    plots = timePlots(group, flightFigures(flight.realtime));
  }
  anew = false;
}

function takePosition(frame) {
  bar?.show(frame);
  picture.pace(frame.speed);
}

function takeStatus(frame) {
  put('rung', frame.mixer ?? '–');
  if (flight) ring(at('ring'), flight, frame);
}

function takeTiming(frame) {
  const misses = frame.timing?.nodes.reduce((sum, node) => sum + node.misses, 0);
  put('misses', misses ?? '–');
  showTiming(at('nodes'), at('worst'), frame);
  at('scene').setAttribute('aria-label', `vehicle in space: ${frame.vehicle}, position error ${number(frame.error_m[0], 2, 'm')}`);
}

function takeHappened(frame) {
  const text = JSON.stringify(frame);
  if (!flight || text === happened) return;
  happened = text;
  for (const name in flight.happened) flight.happened[name].splice(0, Infinity, ...frame[name] ?? []);
  plots?.remark();
  showEvents(at('events'), frame);
}

const STYLE = { flying: 'good', playing: 'good', paused: '', 'at the end': '', ended: '', disconnected: 'bad' };

function takePhase({ phase, why }) {
  if (phase === 'disconnected' && at('phase').textContent === 'ended') return; // `ended` says more
  at('phase').className = `result ${STYLE[phase] ?? 'warn'}`;
  put('phase', phase);
  put('why', why ?? '');
  form?.enable(phase === 'flying');
  bar?.enable(!['ended', 'disconnected'].includes(phase));
}

connect();
