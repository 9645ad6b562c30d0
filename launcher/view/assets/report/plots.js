// Time plots, drawn by uPlot: one time axis, one cursor and one zoom for all plots of a group.
//
// A group is { flights, happened, lines }: flights have a time base and columns of their own, and are laid over each
// other. Its figures are [element, plots]; a plot is { unit, series, .. }, see `report.js`; a series has the index of
// its flight, by default the first. A figure without any series is taken from the page. For a flight under way the
// group also has `time`, and the columns are arrays that grow; `update` draws them again.

function timePlots(group, figures, pathElements) {
  'use strict';
  const { time, flights } = group.time ? group : onOneAxis(group.flights);
  const happened = group.happened;
  let [lanes, lanesBelow] = lanesOf();
  const paths = time.length && pathElements ? flightPaths(time, flights, happened, pathElements) : null;
  const root = document.documentElement;
  const key = `group ${(timePlots.groups = (timePlots.groups ?? 0) + 1)}`;
  // Quantities that no flight has are left out.
  const isThere = s => s.column in flights[s.flight ?? 0].columns;
  const shown = figures.map(([element, all]) => [element, all
    .map(plot => ({ ...plot, series: plot.series.filter(isThere) })).filter(plot => plot.series.length)]);
  let plots = [];
  let zoom = null;

  if (time.length) {
    build();
    matchMedia('(prefers-color-scheme: dark)').addEventListener('change', build);
    addEventListener('beforeprint', () => { root.classList.add('printing'); build(); });
    addEventListener('afterprint', () => { root.classList.remove('printing'); build(); });
    const observer = new ResizeObserver(resize);
    for (const [element] of figures) observer.observe(element);
  } else {
    for (const [element] of figures) element.innerHTML = '<p class="empty">No samples were recorded.</p>';
  }

  // Returns the lanes of the first figure, and the lanes of the others, which do not name the phases again. Every
  // figure shows the phases as a light ground.
  function lanesOf() {
    return [happened, { ...happened, phases: [] }].map(all => {
      const { faults, absences, phases, events } = all;
      return [faults, absences, phases, events].some(some => some.length) ? happenedLanes(all) : null;
    });
  }

  // Draws samples that have come since the last call, unless the reader has zoomed in to look at earlier ones. `anew`
  // ends the zoom, because the samples are then of another time.
  function update(anew) {
    if (anew) zoom = null;
    if (!zoom) for (const u of plots) u.setData(u.samples());
  }

  // Draws the happenings again after they have changed.
  function remark() {
    [lanes, lanesBelow] = lanesOf();
    build();
  }

  // Paper has a width of its own, which no element has before printing.
  function widthOf(element) {
    return root.classList.contains('printing') ? 640 : element.clientWidth;
  }

  // Draws everything again, in the present colours.
  function build() {
    const colour = name => getComputedStyle(root).getPropertyValue(`--${name}`).trim();
    const window = zoom;
    for (const u of plots) u.destroy();
    plots = [];
    const first = shown.findIndex(([, all]) => all.length);
    for (const [number, [holder, all]] of shown.entries()) {
      holder.replaceChildren();
      if (!all.length) holder.closest('figure')?.remove();
      all.forEach((plot, i) => {
        const element = holder.appendChild(document.createElement('div'));
        element.className = 'plot';
        plots.push(timePlot(element, plot, all.length > 1, i === all.length - 1, colour, widthOf(holder),
          number === first ? lanes : lanesBelow));
      });
    }
    if (plots.length) follow(plots[0]);
    if (window) for (const u of plots) u.setScale('x', window);
    paths?.draw();
  }

  function resize() {
    for (const u of plots) {
      const width = widthOf(u.root.parentElement);
      if (width && width !== u.width) u.setSize({ width, height: u.height });
    }
    paths?.draw();
  }

  // The path views follow cursor and zoom of this plot, which are those of all plots.
  function follow(u) {
    (u.hooks.setCursor ||= []).push(() => paths?.mark(u.cursor.idx));
    (u.hooks.setScale ||= []).push((_, key) => {
      if (key !== 'x') return;
      const { min, max } = u.scales.x;
      zoom = !time.length || (min <= time[0] && max >= time[time.length - 1]) ? null : { min, max };
      paths?.highlight(min, max);
    });
  }

  function values(series, plot) {
    const factor = (plot.scale || 1) * (series.factor ?? 1);
    const column = flights[series.flight ?? 0].columns[series.column];
    return factor === 1 ? column : column.map(value => (value === null ? null : value * factor));
  }

  function timePlot(element, plot, stacked, last, colour, width, lanes) {
    const lines = merged(group.lines?.[plot.lines] || []);
    const axis = { stroke: colour('muted'), font: '12px system-ui, sans-serif', labelFont: '12px system-ui, sans-serif',
      grid: { stroke: colour('grid'), width: 1 }, ticks: { stroke: colour('grid'), width: 1, size: 4 }, gap: 4, labelGap: 2 };
    const numbers = (_, splits) => splits.map(value => minus(+value.toFixed(6)));
    const steps = plot.words && { splits: plot.words.map((_, i) => i), values: plot.words, size: 84 };
    const samples = () => [time, ...plot.series.map(s => values(s, plot))];
    const u = new uPlot({
      width,
      height: (stacked ? 130 : 220) + (last ? 42 : 8),
      padding: [10, 16, 0, 0],
      cursor: { sync: { key }, y: false, drag: { x: true, y: false }, points: { size: 7 } },
      scales: { x: { time: false }, y: { range: (_, low, high) => range(plot, lines, low, high) } },
      axes: [
        last ? { ...axis, values: numbers, size: 24, label: 'time [s]', labelSize: 18 }
             : { ...axis, values: (_, splits) => splits.map(() => ''), size: 8 },
        { ...axis, values: numbers, size: 50, label: plot.title ? `${plot.title} [${plot.unit}]` : plot.unit, labelSize: 16, space: stacked ? 26 : 36,
          ...(steps && { splits: () => steps.splits, values: () => steps.values, size: steps.size, space: 1 }) },
      ],
      series: [{ label: 'time', value: (_, t) => (t === null ? '–' : `${t.toFixed(2)} s`) }].concat(plot.series.map(s => ({
        label: s.label, stroke: colour(s.colour), width: s.width || 1.5, dash: s.dash, show: s.show !== false,
        ...(steps && { paths: uPlot.paths.stepped({ align: 1 }) }),
        points: { show: false }, value: (_, v) => (v === null ? '–' : steps ? plot.words[v] : quantity(v.toFixed(plot.digits ?? 3), plot)),
      }))),
      // Happenings are drawn after the grid, which would hide them, and before the lines of the data.
      hooks: { drawAxes: [u => drawHappened(u, happened, colour)], draw: [u => drawLines(u, lines, plot, colour)] },
    }, samples(), element);
    u.samples = samples;
    legendDashes(u, plot, colour);
    if (lanes && last) {
      const below = element.appendChild(document.createElement('div'));
      below.className = 'lanes';
      u.hooks.draw.push(() => lanes(u, below));
      lanes(u, below);
    }
    if (lines.length && (plot.all || hidden(plot, lines))) element.append(limitsButton(u, plot));
    return u;
  }

  // Lines that lie on each other become one with both names.
  function merged(lines) {
    const once = [];
    for (const line of lines) {
      const same = once.find(other => other.y === line.y && String(other.span_s) === String(line.span_s));
      if (same) same.label += `, ${line.label}`;
      else once.push({ ...line });
    }
    return once;
  }

  // Returns the range of a plot: room for the data, and for every line that does not crush them.
  function range(plot, lines, low, high) {
    if (plot.words) return [-0.3, plot.words.length - 0.7];
    if (low === null) [low, high] = [0, 0];
    if (plot.floor) low = Math.min(low, 0);
    const lack = Math.max(0, plot.span - (high - low)) / 2;
    [low, high] = plot.floor ? [low, high + 2 * lack] : [low - lack, high + lack];
    const most = plot.all ? Infinity : 3 * (high - low);
    for (const { y } of lines) {
      const mirror = lines.some(line => line.y === -y) ? -y : y; // both limits are shown, or neither
      const [lower, upper] = [Math.min(low, y, mirror), Math.max(high, y, mirror)];
      if (upper - lower <= most) [low, high] = [lower, upper];
    }
    // An edge that names a line beyond it needs room for the words.
    const air = beyond => (lines.some(beyond) ? 0.3 : 0.07) * (high - low);
    return [plot.floor && low === 0 ? 0 : low - air(({ y }) => y < low), high + air(({ y }) => y > high)];
  }

  // Returns whether a line lies outside the range of the whole flight.
  function hidden(plot, lines) {
    const all = plot.series.filter(s => s.show !== false).flatMap(s => values(s, plot)).filter(v => v !== null);
    if (!all.length) return false;
    const extreme = pick => all.reduce((a, b) => pick(a, b));
    const [low, high] = range(plot, lines, extreme(Math.min), extreme(Math.max));
    return lines.some(({ y }) => y < low || y > high);
  }

  function limitsButton(u, plot) {
    const button = document.createElement('button');
    button.className = 'limits';
    button.type = 'button';
    const name = () => { button.textContent = plot.all ? 'fit to data' : 'show limits'; };
    button.onclick = () => { plot.all = !plot.all; name(); u.redraw(false, true); u.setScale('x', { ...u.scales.x }); };
    name();
    return button;
  }

  return { update, remark };
}

// Gives the markers of the legend the dashes of their lines, by which lines differ without colour.
function legendDashes(u, plot, colour) {
  const markers = [...u.root.querySelectorAll('.u-legend .u-series .u-marker')].slice(-plot.series.length);
  markers.forEach((marker, i) => {
    const { dash, colour: own } = plot.series[i];
    if (!dash?.length) return;
    let at = 0;
    const parts = dash.map((px, n) => `${n % 2 ? 'transparent' : colour(own)} ${at}px ${at += px}px`);
    marker.classList.add('dashed');
    marker.style.background = `repeating-linear-gradient(90deg, ${parts.join(', ')})`;
  });
}

// Draws behind the data of a plot: a tint while a fault acts, deeper where several do; grey while a node has no
// process; a light ground for every second phase; and a line for a moment: an event, or a fault without duration. With
// several flights, an item of one has the colour of that flight.
function drawHappened(u, happened, colour) {
  const { ctx, bbox } = u;
  const px = uPlot.pxRatio;
  const x = at => u.valToPos(at, 'x', true);
  const isMoment = span => span.from_s === span.to_s;
  const tint = (span, ground, alpha) => {
    const [left, right] = [x(span.from_s), span.to_s === null ? bbox.left + bbox.width : x(span.to_s)];
    ctx.fillStyle = colour(span.colour ?? ground);
    ctx.globalAlpha = alpha;
    ctx.fillRect(left, bbox.top, Math.max(right - left, px), bbox.height);
  };
  ctx.save();
  ctx.beginPath();
  ctx.rect(bbox.left, bbox.top, bbox.width, bbox.height);
  ctx.clip();
  happened.phases.forEach((phase, i) => i % 2 && tint(phase, 'muted', 0.07));
  for (const fault of happened.faults) if (!isMoment(fault)) tint(fault, 'orange', 0.1);
  for (const absence of happened.absences) tint(absence, 'muted', 0.22);
  ctx.globalAlpha = 1;
  ctx.lineWidth = px;
  ctx.setLineDash([]);
  const moments = happened.faults.filter(isMoment).map(({ from_s, colour }) => ({ at_s: from_s, colour: colour ?? 'orange' }));
  for (const { at_s, colour: own } of [...happened.events, ...moments]) {
    const at = Math.round(x(at_s)) + px / 2;
    ctx.strokeStyle = colour(own ?? 'event');
    ctx.beginPath();
    ctx.moveTo(at, bbox.top);
    ctx.lineTo(at, bbox.top + bbox.height);
    ctx.stroke();
  }
  ctx.restore();
}

// Draws claims, bounds and limits; lines out of sight are named at the edge beyond which they lie.
function drawLines(u, lines, plot, colour) {
  const { ctx, bbox } = u;
  const px = uPlot.pxRatio;
  const beyond = { '↑': new Map(), '↓': new Map() };
  ctx.save();
  ctx.beginPath();
  ctx.rect(bbox.left, bbox.top, bbox.width, bbox.height);
  ctx.clip();
  ctx.font = `${12 * px}px system-ui, sans-serif`;
  // Boxes of the words so far, which no other words may cover.
  const taken = [];
  const isFree = box => taken.every(other => box.right < other.left || box.left > other.right || box.bottom < other.top || box.top > other.bottom);
  const boxOf = (words, align, x, y) => {
    const wide = ctx.measureText(words).width;
    const left = align === 'left' ? x : align === 'right' ? x - wide : x - wide / 2;
    return { left: left - 4 * px, right: left + wide + 4 * px, top: y - 12 * px, bottom: y + 4 * px };
  };
  const label = (words, align, x, y) => {
    taken.push(boxOf(words, align, x, y));
    ctx.textAlign = align;
    ctx.setLineDash([]);
    ctx.strokeStyle = colour('page');
    ctx.lineWidth = 4 * px;
    ctx.strokeText(words, x, y);
    ctx.fillStyle = colour('muted');
    ctx.fillText(words, x, y);
  };
  const names = [];
  lines.forEach(({ y, label: name, span_s }, i) => {
    const [from, to] = span_s || [null, null];
    const left = Math.max(bbox.left, from === null ? -Infinity : u.valToPos(from, 'x', true));
    const right = Math.min(bbox.left + bbox.width, to === null ? Infinity : u.valToPos(to, 'x', true));
    if (left >= right) return;
    const size = quantity(+y.toFixed(plot.digits ?? 3), plot);
    const words = `${name} ${size}`;
    if (y > u.scales.y.max) { beyond['↑'].set(words, size); return; }
    if (y < u.scales.y.min) { beyond['↓'].set(words, size); return; }
    const level = u.valToPos(y, 'y', true);
    ctx.strokeStyle = colour('muted');
    ctx.lineWidth = px;
    ctx.setLineDash([8 * px, 3 * px, 2 * px, 3 * px]);
    ctx.beginPath();
    ctx.moveTo(left, level);
    ctx.lineTo(right, level);
    ctx.stroke();
    if (y < 0 || ctx.measureText(words).width > right - left) return;
    // Places for the words, in order of preference: above the line at one end or the other, then below it. Neighbours
    // may lie close together, so every second line begins with the other end.
    const ends = [['right', right - 4 * px], ['left', left + 4 * px]];
    if (i % 2 === 1) ends.reverse();
    const offsets = [-5 * px, 15 * px].filter(offset => level + offset - 12 * px >= bbox.top && level + offset <= bbox.top + bbox.height);
    names.push(offsets.flatMap(offset => ends.map(([align, x]) => [words, align, x, level + offset])));
  });
  // If there is no room for the names, only the sizes are shown.
  const edge = (arrow, y) => {
    if (!beyond[arrow].size) return;
    const named = `${arrow} ${[...beyond[arrow].keys()].join(', ')}`;
    const fits = ctx.measureText(named).width < bbox.width - 8 * px;
    label(fits ? named : `${arrow} ${[...new Set(beyond[arrow].values())].join(', ')}`, 'center', bbox.left + bbox.width / 2, y);
  };
  edge('↑', bbox.top + 13 * px);
  edge('↓', bbox.top + bbox.height - 6 * px);
  for (const places of names) {
    const free = places.find(place => isFree(boxOf(...place)));
    if (free) label(...free);
  }
  ctx.restore();
}

// Puts flights with time bases of their own on one time axis: the finest time step, from the first beginning to the
// last end. A flight has its nearest sample at each time.
function onOneAxis(all) {
  const flights = all.filter(flight => flight.rows);
  const decoded = all.map(flight => Object.entries(flight.columns).map(([name, text]) => [name, decode(text)]));
  if (!flights.length) return { time: [], flights: all.map(flight => ({ ...flight, columns: {} })) };
  const begin = Math.min(...flights.map(flight => flight.begin_s));
  const end = Math.max(...flights.map(flight => flight.begin_s + (flight.rows - 1) * flight.dt_s));
  const step = Math.min(...flights.map(flight => flight.dt_s));
  const rows = Math.round((end - begin) / step) + 1;
  const time = Array.from({ length: rows }, (_, i) => begin + i * step);
  const moved = ({ begin_s, dt_s }, values) => time.map(at => values[Math.round((at - begin_s) / dt_s)] ?? null);
  return { time, flights: all.map((flight, i) => ({
    ...flight,
    columns: Object.fromEntries(decoded[i].map(([name, values]) => [name, all.length > 1 ? moved(flight, values) : values])),
  })) };
}

// Decodes base64 of little-endian f32; a value that is not finite becomes null, a hole.
function decode(text) {
  const bytes = Uint8Array.from(atob(text), c => c.charCodeAt(0));
  const view = new DataView(bytes.buffer);
  return Array.from({ length: bytes.length / 4 }, (_, i) => {
    const value = view.getFloat32(4 * i, true);
    return Number.isFinite(value) ? value : null;
  });
}

function quantity(number, plot) {
  return `${minus(number)} ${plot.suffix ?? plot.unit}`.trim();
}

function minus(number) {
  return String(number).replace('-', '−');
}

// Draws the groups that carry their data and plots with them, as on every page but the report.
for (const holder of document.querySelectorAll('.time-plots')) {
  const group = JSON.parse(holder.querySelector('script').textContent);
  const paths = ['space', 'plan'].map(view => holder.querySelector(`.${view}`)).filter(Boolean);
  timePlots(group, [[holder.querySelector('.plots'), group.plots]], paths.length ? paths : null);
}
