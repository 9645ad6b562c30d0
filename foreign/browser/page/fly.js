// The page fly.html: sliders become settings, the worker flies with them, and the report's scripts draw the flight.

const form = document.getElementById('settings');
const sliders = [...form.querySelectorAll('input')];
const show = (id, text) => { document.getElementById(id).textContent = text; };
const status = text => show('status', text);

let worker = null;
let flying = null; // settings of the flight under way
let wanted = null; // settings to fly next

// A slider at 0 changes no setting.
function settings() {
  const lines = ({ value, dataset }) => dataset.settings.replace('{}', +(value * (dataset.scale ?? 1)).toFixed(4)).split('\n');
  return sliders.filter(slider => +slider.value).flatMap(lines);
}

function describe() {
  for (const slider of sliders) {
    const text = `${slider.value} ${slider.dataset.unit}`;
    form.querySelector(`output[for=${slider.id}]`).textContent = text;
    slider.setAttribute('aria-valuetext', text);
  }
  const options = ['--mode inprocess', ...settings().map(line => `--set '${line}'`)];
  show('command', ['trefoil fly scenarios/survey.toml', ...options].join(' \\\n  '));
}

// Flies with the settings of the sliders, after the flight under way has ended; of several changes the last one counts.
function fly() {
  describe();
  wanted = settings().join('\n');
  if (flying !== null) return;
  [flying, wanted] = [wanted, null];
  document.body.setAttribute('aria-busy', 'true');
  worker ??= start();
  worker.postMessage(flying);
}

function start() {
  const worker = new Worker('worker.js', { type: 'module' });
  worker.onmessage = ({ data }) => landed(data);
  worker.onerror = () => landed({ flight: { error: 'this browser cannot start the flight; the page must come from a web server' } });
  return worker;
}

function landed({ flight, took_ms }) {
  const again = wanted !== null && wanted !== flying;
  flying = wanted = null;
  if (again) return fly();
  document.body.removeAttribute('aria-busy');
  if (flight.error) {
    worker.terminate(); // a module that has failed is not used again
    worker = null;
    for (const id of ['state-hash', 'max-error', 'rms-error']) show(id, '–');
    return status(`No flight: ${flight.error}`);
  }
  const end = flight.whole ? 'to its end' : `until the vehicle was lost, after ${flight.flown_s.toFixed(2)} s`;
  status(`Flown ${end}, in ${(took_ms / 1e3).toFixed(2)} s of computation.`);
  show('max-error', `${flight.max_position_error_m.toFixed(3)} m`);
  show('rms-error', `${flight.rms_position_error_m.toFixed(3)} m`);
  show('state-hash', flight.state_hash);
  draw(flight.figures);
}

// Draws each flight in a document of its own, because the report's scripts run once and draw one flight.
function draw(figures) {
  const script = name => `<script src="report/${name}"><\/script>`;
  const frame = document.createElement('iframe');
  frame.title = 'Path and position error of the flight';
  frame.className = 'waiting';
  frame.srcdoc = `<!doctype html><html lang="en"><head><meta charset="utf-8"><meta name="color-scheme" content="light dark">
    <title>Figures</title><link rel="stylesheet" href="report/uPlot.min.css"><link rel="stylesheet" href="report/report.css">
    <style>main { padding: 0 1.25rem 2rem; } html { overflow: hidden; }</style></head><body><main><section id="figures" style="margin: 0">
    <figure id="fig5"><div class="paths"><div class="space"></div><div class="plan"></div></div><div class="plots"></div>
      <figcaption><b>Trajectory.</b> The mission’s (dashed) and the true position, in space (drag to turn), from above, and as
      altitude over time.</figcaption></figure>
    <figure id="fig6"><div class="plots"></div>
      <figcaption><b>Euclidean position error</b> against the mission, with the scenario’s bound. Drag across a plot to zoom,
      double-click to see all of it again.</figcaption></figure>
    </section></main>
    <script type="application/json" id="flight">${JSON.stringify(figures)}<\/script>
    ${['uPlot.iife.min.js', 'path.js', 'lanes.js', 'plots.js', 'report.js'].map(script).join('')}</body></html>`;
  const flown = document.getElementById('flown');
  frame.onload = () => {
    const page = frame.contentDocument.documentElement;
    const fit = () => { frame.style.height = `${page.querySelector('main').offsetHeight}px`; };
    new ResizeObserver(fit).observe(page.querySelector('main'));
    fit();
    frame.className = '';
    for (const other of [...flown.children]) if (other !== frame) other.remove();
  };
  flown.append(frame);
}

form.addEventListener('input', fly);
form.addEventListener('reset', () => setTimeout(fly)); // the sliders move after the event
form.addEventListener('submit', event => event.preventDefault());
fly();
