// The time plots, drawn by uPlot: one time axis, one cursor and one zoom for all of them.

(() => {
  'use strict';
  const flight = JSON.parse(document.getElementById('flight').textContent);
  const time = Array.from({ length: flight.rows }, (_, i) => flight.begin_s + i * flight.dt_s);
  const columns = {};
  for (const name in flight.columns) columns[name] = decode(flight.columns[name]);

  const DEG = 180 / Math.PI;
  const series = (label, column, colour, more) => ({ label, column, colour, ...more });
  const reference = column => series('reference', column, 'ink', { dash: [5, 4], width: 1 });
  const command = (label, column, colour) => series(label, column, colour, { dash: [2, 3], width: 1 });
  // `scale` turns the column into `unit`; `suffix` is the unit after numbers, where it is another; `span` is the least
  // range worth showing; `floor` starts it at zero; `lines` names what the plot is read against.
  const angle = name => ({ unit: 'deg', scale: DEG, span: 1, series: [series(GREEK[name], name, 'blue'), reference(`${name}_ref`)] });
  const rate = name => ({ unit: 'rad/s', span: 0.05, series: [series(name, name, 'blue'), reference(`${name}_ref`)] });
  const error = axis => ({ unit: 'm', span: 0.02, lines: `error_${axis}`, series: [series(`${axis} error`, `error_${axis}`, 'blue')] });
  const GREEK = { phi: 'φ', theta: 'θ', psi: 'ψ' };

  const FIGURES = {
    fig5: [{ unit: 'm', scale: -1, span: 0.5, series: [series('altitude', 'z', 'blue'), series('mission', 'z_wanted', 'ink', { dash: [5, 4], width: 1 })] }],
    fig6: [{ unit: 'm', span: 0.02, floor: true, lines: 'error', series: [series('position error', 'error', 'blue')] }],
    fig7: ['x', 'y', 'z'].map(error),
    fig8: ['phi', 'theta', 'psi'].map(angle),
    fig9: [...['p', 'q', 'r'].map(rate), {
      unit: 'm/s', span: 0.2, series: [series('u', 'u', 'blue'), series('v', 'v', 'orange'), series('w', 'w', 'green')],
    }],
    fig10: [{ unit: 'm/s', span: 0.2, series: [series('w', 'w', 'blue'), reference('w_ref')] }],
    fig11: [{
      unit: 'rotor speed unit', suffix: '', span: 50, lines: 'rotors', digits: 1,
      series: [series('Ω₁', 'omega1', 'blue'), series('Ω₂', 'omega2', 'orange'), series('Ω₃', 'omega3', 'green'),
        ...[['Ω₁ command', 'omega1_command', 'blue'], ['Ω₂ command', 'omega2_command', 'orange'],
          ['Ω₃ command', 'omega3_command', 'green']].map(c => ({ ...command(...c), show: false }))],
    }],
    fig12: [{ unit: 'deg', scale: DEG, span: 2, lines: 'tilt', series: [series('μ', 'tilt', 'blue'), command('command', 'tilt_command', 'orange')] }],
    inputs: [
      { unit: 'N', span: 0.5, series: [series('col', 'col', 'blue')] },
      { unit: 'N m', span: 0.02, series: [series('lon', 'lon', 'blue'), series('lat', 'lat', 'orange'), series('ped', 'ped', 'green')] },
    ],
    age: [
      { unit: 'ms', span: 0.5, floor: true, series: [series('age', 'age_ms', 'blue')] },
      { unit: 'm', span: 0.02, floor: true, lines: 'error', series: [series('position error', 'error', 'orange')] },
    ],
  };

  const root = document.documentElement;
  const { faults, absences, events } = flight.happened;
  const lanes = faults.length + absences.length + events.length ? happenedLanes(flight.happened) : null;
  const paths = flight.rows ? flightPaths(time, columns, flight.happened) : null;
  let plots = [];
  let zoom = null;

  if (!flight.realtime) document.getElementById('age').remove();
  if (flight.rows) {
    build();
    matchMedia('(prefers-color-scheme: dark)').addEventListener('change', build);
    addEventListener('beforeprint', () => { root.classList.add('printing'); build(); });
    addEventListener('afterprint', () => { root.classList.remove('printing'); build(); });
    new ResizeObserver(resize).observe(document.getElementById('figures'));
  } else {
    for (const holder of document.querySelectorAll('.plots')) {
      holder.innerHTML = '<p class="empty">No samples were recorded.</p>';
    }
  }

  // Paper has its own width, which no element tells before it is printed on.
  function widthOf(element) {
    return root.classList.contains('printing') ? 640 : element.clientWidth;
  }

  // Draws everything anew, in the colours of the moment.
  function build() {
    const colour = name => getComputedStyle(root).getPropertyValue(`--${name}`).trim();
    const window = zoom;
    for (const u of plots) u.destroy();
    plots = [];
    for (const id in FIGURES) {
      const holder = document.querySelector(`#${id} .plots`);
      if (!holder) continue;
      holder.replaceChildren();
      FIGURES[id].forEach((plot, i, all) => {
        const element = holder.appendChild(document.createElement('div'));
        element.className = 'plot';
        plots.push(timePlot(element, plot, all.length > 1, i === all.length - 1, colour, widthOf(holder)));
      });
    }
    follow(plots[0]);
    if (window) for (const u of plots) u.setScale('x', window);
    paths.draw();
  }

  function resize() {
    for (const u of plots) {
      const width = widthOf(u.root.parentElement);
      if (width && width !== u.width) u.setSize({ width, height: u.height });
    }
    paths.draw();
  }

  // The path views follow cursor and zoom of this plot, and so of all.
  function follow(u) {
    (u.hooks.setCursor ||= []).push(() => paths.mark(u.cursor.idx));
    (u.hooks.setScale ||= []).push((_, key) => {
      if (key !== 'x') return;
      const { min, max } = u.scales.x;
      zoom = min <= time[0] && max >= time[time.length - 1] ? null : { min, max };
      paths.highlight(min, max);
    });
  }

  function timePlot(element, plot, stacked, last, colour, width) {
    const lines = merged(flight.lines[plot.lines] || []);
    const axis = { stroke: colour('muted'), font: '12px system-ui, sans-serif', labelFont: '12px system-ui, sans-serif',
      grid: { stroke: colour('grid'), width: 1 }, ticks: { stroke: colour('grid'), width: 1, size: 4 }, gap: 4, labelGap: 2 };
    const numbers = (_, splits) => splits.map(value => minus(+value.toFixed(6)));
    const u = new uPlot({
      width,
      height: (stacked ? 130 : 220) + (last ? 42 : 8),
      padding: [10, 8, 0, 0],
      cursor: { sync: { key: 'flight' }, y: false, drag: { x: true, y: false }, points: { size: 7 } },
      scales: { x: { time: false }, y: { range: (_, low, high) => range(plot, lines, low, high) } },
      axes: [
        last ? { ...axis, values: numbers, size: 24, label: 'time [s]', labelSize: 18 }
             : { ...axis, values: (_, splits) => splits.map(() => ''), size: 8 },
        { ...axis, values: numbers, size: 50, label: plot.unit, labelSize: 16, space: stacked ? 26 : 36 },
      ],
      legend: { markers: { dash: (u, i) => (u.series[i].dash ? 'dashed' : 'solid') } },
      series: [{ label: 'time', value: (_, t) => (t === null ? '–' : `${t.toFixed(2)} s`) }].concat(plot.series.map(s => ({
        label: s.label, stroke: colour(s.colour), width: s.width || 1.5, dash: s.dash, show: s.show !== false,
        points: { show: false }, value: (_, v) => (v === null ? '–' : quantity(v.toFixed(plot.digits ?? 3), plot)),
      }))),
      // After the grid, which would hide it, and before the lines of the data.
      hooks: { drawAxes: [u => drawHappened(u, colour)], draw: [u => drawLines(u, lines, plot, colour)] },
    }, [time, ...plot.series.map(s => scaled(columns[s.column], plot.scale || 1))], element);
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

  // Room for the data, and for every line that does not crush them.
  function range(plot, lines, low, high) {
    if (low === null) [low, high] = [0, 0];
    if (plot.floor) low = Math.min(low, 0);
    const lack = Math.max(0, plot.span - (high - low)) / 2;
    [low, high] = plot.floor ? [low, high + 2 * lack] : [low - lack, high + lack];
    const most = plot.all ? Infinity : 3 * (high - low);
    for (const { y } of lines) {
      const mirror = lines.some(line => line.y === -y) ? -y : y; // above and below come together
      const [lower, upper] = [Math.min(low, y, mirror), Math.max(high, y, mirror)];
      if (upper - lower <= most) [low, high] = [lower, upper];
    }
    // An edge that names a line beyond it needs room for the words.
    const air = beyond => (lines.some(beyond) ? 0.3 : 0.07) * (high - low);
    return [plot.floor && low === 0 ? 0 : low - air(({ y }) => y < low), high + air(({ y }) => y > high)];
  }

  // Whether a line lies outside what the whole flight shows.
  function hidden(plot, lines) {
    const values = plot.series.filter(s => s.show !== false).flatMap(s => scaled(columns[s.column], plot.scale || 1)).filter(v => v !== null);
    if (!values.length) return false;
    const extreme = pick => values.reduce((a, b) => pick(a, b));
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

  // Behind the data: a tint while a fault acts, deeper where several do, and a line where something happened to a process.
  function drawHappened(u, colour) {
    const { ctx, bbox } = u;
    const px = uPlot.pxRatio;
    ctx.save();
    ctx.beginPath();
    ctx.rect(bbox.left, bbox.top, bbox.width, bbox.height);
    ctx.clip();
    ctx.fillStyle = colour('orange');
    ctx.globalAlpha = 0.1;
    for (const { from_s, to_s } of faults) {
      const left = u.valToPos(from_s, 'x', true);
      const right = to_s === null ? bbox.left + bbox.width : u.valToPos(to_s, 'x', true);
      ctx.fillRect(left, bbox.top, Math.max(right - left, px), bbox.height);
    }
    ctx.globalAlpha = 1;
    ctx.strokeStyle = colour('event');
    ctx.lineWidth = px;
    ctx.setLineDash([]);
    ctx.beginPath();
    for (const { at_s } of events) {
      const x = Math.round(u.valToPos(at_s, 'x', true)) + px / 2;
      ctx.moveTo(x, bbox.top);
      ctx.lineTo(x, bbox.top + bbox.height);
    }
    ctx.stroke();
    ctx.restore();
  }

  // Claims, bounds and limits; those out of sight are named at the edge they lie beyond.
  function drawLines(u, lines, plot, colour) {
    const { ctx, bbox } = u;
    const px = uPlot.pxRatio;
    const beyond = { '↑': new Set(), '↓': new Set() };
    ctx.save();
    ctx.beginPath();
    ctx.rect(bbox.left, bbox.top, bbox.width, bbox.height);
    ctx.clip();
    ctx.font = `${12 * px}px system-ui, sans-serif`;
    const label = (words, align, x, y) => {
      ctx.textAlign = align;
      ctx.setLineDash([]);
      ctx.strokeStyle = colour('page');
      ctx.lineWidth = 4 * px;
      ctx.strokeText(words, x, y);
      ctx.fillStyle = colour('muted');
      ctx.fillText(words, x, y);
    };
    lines.forEach(({ y, label: name, span_s }, i) => {
      const [from, to] = span_s || [null, null];
      const left = Math.max(bbox.left, from === null ? -Infinity : u.valToPos(from, 'x', true));
      const right = Math.min(bbox.left + bbox.width, to === null ? Infinity : u.valToPos(to, 'x', true));
      if (left >= right) return;
      const words = `${name} ${quantity(+y.toFixed(plot.digits ?? 3), plot)}`;
      if (y > u.scales.y.max) { beyond['↑'].add(words); return; }
      if (y < u.scales.y.min) { beyond['↓'].add(words); return; }
      const level = u.valToPos(y, 'y', true);
      ctx.strokeStyle = colour('muted');
      ctx.lineWidth = px;
      ctx.setLineDash([8 * px, 3 * px, 2 * px, 3 * px]);
      ctx.beginPath();
      ctx.moveTo(left, level);
      ctx.lineTo(right, level);
      ctx.stroke();
      const below = level - bbox.top < 18 * px;
      if (y < 0 || ctx.measureText(words).width > right - left) return;
      const atLeft = i % 2 === 1; // neighbours may lie close together
      label(words, atLeft ? 'left' : 'right', atLeft ? left + 4 * px : right - 4 * px, level + (below ? 15 : -5) * px);
    });
    const middle = bbox.left + bbox.width / 2;
    if (beyond['↑'].size) label(`↑ ${[...beyond['↑']].join(', ')}`, 'center', middle, bbox.top + 13 * px);
    if (beyond['↓'].size) label(`↓ ${[...beyond['↓']].join(', ')}`, 'center', middle, bbox.top + bbox.height - 6 * px);
    ctx.restore();
  }

  // Base64 of little-endian f32; what is not finite is a hole.
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

  function scaled(values, factor) {
    return factor === 1 ? values : values.map(value => (value === null ? null : value * factor));
  }
})();
