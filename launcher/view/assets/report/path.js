// The flight path as SVG: in space (orthographic, drag to turn) and from above. Lengths are equal along all axes.
// Points are [north, east, up] in metres, or null where the log has a hole.

// Several flights have colours and dashes of their own; what happened to one of them is marked on its path.

function flightPaths(time, flights, happened, elements) {
  'use strict';
  const points = ({ columns }, x, y, z) => !columns[x] ? [] : columns[x].map((north, i) => {
    const point = [north, columns[y][i], columns[z][i]];
    return point.includes(null) ? null : [north, point[1], -point[2]];
  });
  const actuals = flights.map(flight => points(flight, 'x', 'y', 'z'));
  const missions = flights.map(flight => points(flight, 'x_wanted', 'y_wanted', 'z_wanted'));
  const dt = time.length > 1 ? time[1] - time[0] : 1;
  const sample = at => Math.min(Math.max(Math.round((at - time[0]) / dt), 0), time.length - 1);
  const alone = flights.length === 1;
  const struck = alone ? actuals[0].map(() => null) : [];
  for (const { from_s, to_s } of alone ? happened.faults : []) {
    for (let i = sample(from_s); i <= sample(to_s ?? Infinity); i++) struck[i] = actuals[0][i];
  }
  const box = surround([...actuals, ...missions].flat());

  const turn = { azimuth: -0.6, elevation: 0.5 };
  const fromAbove = ([north, east]) => [east, -north];
  const inSpace = ([north, east, up]) => {
    const away = east * Math.sin(turn.azimuth) + north * Math.cos(turn.azimuth);
    const right = east * Math.cos(turn.azimuth) - north * Math.sin(turn.azimuth);
    return [right, -up * Math.cos(turn.elevation) - away * Math.sin(turn.elevation)];
  };
  const [space, plan] = elements;
  const views = [
    { element: space, project: inSpace, backdrop: spaceBackdrop },
    { element: plan, project: fromAbove, backdrop: planBackdrop },
  ];
  let shown = [0, Infinity];
  let marked = null;

  function draw() {
    for (const view of views) {
      const width = view.element.clientWidth;
      const height = Math.min(width, 380);
      view.place = fit(box, view.project, width, height);
      const inWindow = points => points.map((point, i) => (time[i] >= shown[0] && time[i] <= shown[1] ? point : null));
      const ground = point => point && [point[0], point[1], box.low[2]];
      const all = (name, courses) => courses.map((points, i) => line(name, points, view.place, flights[i])).join('');
      view.element.innerHTML = `<svg width="${width}" height="${height}" viewBox="0 0 ${width} ${height}" role="img" aria-label="flight path">
        ${view.backdrop(box, view.place)}
        ${alone && view.project === inSpace ? line('shadow', actuals[0].map(ground), view.place) : ''}
        ${all('whole', actuals)}${all('shown', actuals.map(inWindow))}${line('struck', struck, view.place)}
        ${missions.map(mission => line('mission', mission, view.place)).join('')}${marks(view.place)}
        ${flights.map(() => '<circle class="now" r="5"/>').join('')}</svg>`;
    }
    mark(marked);
  }

  // Draws a ring where something happened to a process, and a dot with the number of a fault where the fault begins.
  // Marks within 14 px of each other become one mark.
  function marks(place) {
    const spots = [];
    const add = (at, flight, words) => {
      const point = actuals[flight ?? 0][sample(at)];
      if (!point) return;
      const [x, y] = place(point);
      const near = spots.find(spot => Math.hypot(spot.x - x, spot.y - y) < 14);
      const spot = near ?? { x, y, words: new Set(), event: false };
      if (!near) spots.push(spot);
      if (words) spot.words.add(words);
      else spot.event = true;
    };
    for (const fault of happened.faults) add(fault.from_s, fault.flight, alone ? fault.number : '');
    for (const event of happened.events) add(event.at_s, event.flight);
    const dot = ({ x, y, event }) => `<circle class="${event ? 'event' : 'start'}" cx="${x.toFixed(1)}" cy="${y.toFixed(1)}" r="${event ? 4 : 3}"/>`;
    const number = ({ x, y, words }) => (words.size ? text(x + 7, y - 7, 'start', [...words].join(', '), 'number') : '');
    return spots.map(dot).concat(spots.map(number)).join('');
  }

  // Puts the dots at sample `i`; null hides them.
  function mark(i) {
    marked = i;
    for (const view of views) {
      view.element.querySelectorAll('.now').forEach((dot, flight) => {
        const point = actuals[flight][i] ?? null;
        dot.style.display = point ? '' : 'none';
        if (point) {
          const [x, y] = view.place(point);
          dot.setAttribute('cx', x);
          dot.setAttribute('cy', y);
        }
      });
    }
  }

  // Shows the part flown from `from` to `to` [s] in full colour.
  function highlight(from, to) {
    shown = [from, to];
    draw();
  }

  views[0].element.addEventListener('pointermove', event => {
    if (!(event.buttons & 1)) return;
    turn.azimuth -= event.movementX * 0.008;
    turn.elevation = Math.min(Math.PI / 2, Math.max(0, turn.elevation + event.movementY * 0.008));
    draw();
  });
  return { draw, mark, highlight };
}

// The smallest box of round numbers around the points, and the step that divides it.
function surround(points) {
  const low = [0, 0, 0], high = [0, 0, 0];
  for (const point of points.filter(Boolean)) {
    for (let axis = 0; axis < 3; axis++) {
      low[axis] = Math.min(low[axis], point[axis]);
      high[axis] = Math.max(high[axis], point[axis]);
    }
  }
  const step = roundStep(Math.max(0.5, ...high.map((h, axis) => h - low[axis])) / 5);
  // Sideways the path keeps clear of the box's edge; upwards it may touch the edge.
  const air = [0.2, 0.2, -0.2];
  return {
    step,
    low: low.map((l, axis) => step * Math.floor(l / step - air[axis])),
    high: high.map((h, axis) => step * Math.max(Math.ceil(h / step + air[axis]), 1)),
  };
}

// Returns 1, 2 or 5 times a power of ten, not below `least`.
function roundStep(least) {
  const power = 10 ** Math.floor(Math.log10(least));
  return power * [1, 2, 5, 10].find(factor => factor * power >= least * 0.999);
}

// Returns the map from points to pixels: all of the box visible, with room for labels.
function fit(box, project, width, height) {
  const corners = [0, 1, 2, 3, 4, 5, 6, 7].map(c => project([0, 1, 2].map(axis => (c >> axis & 1 ? box.high : box.low)[axis])));
  const [xs, ys] = [corners.map(c => c[0]), corners.map(c => c[1])];
  const [left, right, top, bottom] = [Math.min(...xs), Math.max(...xs), Math.min(...ys), Math.max(...ys)];
  const room = { left: 44, right: 28, top: 24, bottom: 40 };
  const scale = Math.min((width - room.left - room.right) / (right - left), (height - room.top - room.bottom) / (bottom - top));
  const middleX = (width + room.left - room.right) / 2, middleY = (height + room.top - room.bottom) / 2;
  return point => {
    const [x, y] = project(point);
    return [middleX + (x - (left + right) / 2) * scale, middleY + (y - (top + bottom) / 2) * scale];
  };
}

// One polyline, in the colour and dashes of a flight that has them; a null lifts the pen, points closer than half a pixel
// are left out.
function line(name, points, place, { colour, dash } = {}) {
  let path = '', last = null;
  for (const point of points) {
    if (!point) { last = null; continue; }
    const [x, y] = place(point);
    if (last && Math.hypot(x - last[0], y - last[1]) < 0.5) continue;
    path += `${last ? 'L' : 'M'}${x.toFixed(1)} ${y.toFixed(1)}`;
    last = [x, y];
  }
  const own = colour ? ` style="stroke:var(--${colour});stroke-dasharray:${dash?.join(' ') || 'none'}"` : '';
  return path ? `<path class="${name}" d="${path}"${own}/>` : '';
}

function ticks(box, axis) {
  const count = Math.round((box.high[axis] - box.low[axis]) / box.step);
  return Array.from({ length: count + 1 }, (_, i) => +(box.low[axis] + i * box.step).toFixed(6));
}

function text(x, y, anchor, words, name = 'tick') {
  return `<text class="${name}" x="${x.toFixed(1)}" y="${y.toFixed(1)}" text-anchor="${anchor}">${String(words).replace('-', '−')}</text>`;
}

// North and east lines at height `up`.
function ground(box, up, place) {
  const north = ticks(box, 0).map(n => line('grid', [[n, box.low[1], up], [n, box.high[1], up]], place));
  const east = ticks(box, 1).map(e => line('grid', [[box.low[0], e, up], [box.high[0], e, up]], place));
  return north.concat(east).join('');
}

function planBackdrop(box, place) {
  let svg = ground(box, 0, place);
  for (const n of ticks(box, 0)) {
    const [x, y] = place([n, box.low[1], 0]);
    svg += text(x - 8, y + 4, 'end', n);
  }
  for (const e of ticks(box, 1)) {
    const [x, y] = place([box.low[0], e, 0]);
    svg += text(x, y + 17, 'middle', e);
  }
  const [left, top] = place([box.high[0], box.low[1], 0]);
  const [right, bottom] = place([box.low[0], box.high[1], 0]);
  return svg + text(left, top - 9, 'middle', 'north [m]') + text((left + right) / 2, bottom + 34, 'middle', 'east [m]');
}

function spaceBackdrop(box, place) {
  const floor = box.low[2];
  const lower = (a, b) => (place(a)[1] > place(b)[1] ? a : b); // the edge nearer to the reader carries the labels
  const eastSide = lower([0, box.low[1], floor], [0, box.high[1], floor])[1];
  const northSide = lower([box.low[0], 0, floor], [box.high[0], 0, floor])[0];
  const middle = [0, 1].map(axis => (box.low[axis] + box.high[axis]) / 2);
  const outward = edge => Math.sign(place([...edge, floor])[0] - place([...middle, floor])[0]);
  const taken = []; // a high box is small at its foot, where only some labels have room
  const label = (point, side, words, far) => {
    const [atX, atY] = place([...point, floor]);
    const [x, y] = [atX + side * far, atY + far + 5];
    if (taken.some(other => Math.abs(other[0] - x) < 32 && Math.abs(other[1] - y) < 15)) return '';
    taken.push([x, y]);
    return text(x, y, 'middle', words);
  };
  const [eastOut, northOut] = [outward([middle[0], eastSide]), outward([northSide, middle[1]])];
  let svg = ground(box, floor, place);
  for (const n of ticks(box, 0)) svg += label([n, eastSide], eastOut, n, 12);
  for (const e of ticks(box, 1)) svg += label([northSide, e], northOut, e, 12);
  svg += label([middle[0], eastSide], eastOut, 'north [m]', 34) + label([northSide, middle[1]], northOut, 'east [m]', 34);

  const corners = [box.low[0], box.high[0]].flatMap(n => [box.low[1], box.high[1]].map(e => [n, e]));
  const post = corners.reduce((a, b) => (place([...a, floor])[0] < place([...b, floor])[0] ? a : b));
  svg += line('frame', [[...post, floor], [...post, box.high[2]]], place);
  for (const up of ticks(box, 2).slice(1)) {
    const [x, y] = place([...post, up]);
    svg += text(x - 7, y + 4, 'end', up);
  }
  const [x, y] = place([...post, box.high[2]]);
  return svg + text(x, y - 10, 'middle', 'up [m]');
}
