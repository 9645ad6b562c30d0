// Happenings in lanes under a time axis: a bar for each phase, for each fault while it acts and for each node without a
// process, a line for each moment, and the words beside them. Words that have no room are left out, never drawn over
// others: the table of the page has them all.

function happenedLanes(happened) {
  'use strict';
  const LANE = 16, BAR = 12, GAP = 8, MOST = 12;
  const measure = document.createElement('canvas').getContext('2d');
  measure.font = '11px system-ui, sans-serif';
  const seconds = (from, to) => (to === null ? `from ${from.toFixed(2)} s to the end`
    : from === to ? `at ${from.toFixed(2)} s` : `${from.toFixed(2)} to ${to.toFixed(2)} s`);
  const bar = (style, words) => span => ({ style, words: words(span), from: span.from_s, to: span.to_s ?? Infinity,
    isMoment: span.from_s === span.to_s, title: `${words(span)}, ${seconds(span.from_s, span.to_s)}` });
  const spans = happened.phases.map(bar('phase', phase => phase.what))
    .concat(happened.faults.map(bar('fault', fault => `${fault.number || ''} ${fault.what}`.trim())))
    .concat(happened.absences.map(bar('absence', absence => absence.what)));

  // Events of one process that lie closer than their lines can be told apart become one.
  function groups(toX) {
    const all = [];
    for (const event of happened.events) {
      const x = toX(event.at_s);
      const near = all.findLast(group => group.node === event.node);
      if (near && x - near.x1 < 6) {
        near.x1 = x;
        near.whats.push(event.what);
        near.titles.push(`${event.at_s.toFixed(2)} s ${event.what}`);
      } else {
        all.push({ style: 'event', node: event.node, x0: x, x1: x, whats: [event.what],
          titles: [`${event.at_s.toFixed(2)} s ${event.what}${event.why ? `: ${event.why}` : ''}`] });
      }
    }
    return all.map(({ whats, titles, ...group }) => {
      const once = [...new Set(whats)].map(what => {
        const times = whats.filter(other => other === what).length;
        return times > 1 ? `${what} ×${times}` : what;
      });
      const short = `${group.node} ${once[0]}${once.length > 1 ? ' …' : ''}`;
      return { ...group, words: `${group.node} ${once.join(', ')}`, short, title: `${group.node}: ${titles.join('; ')}` };
    });
  }

  // Puts the words where there is room: in the bar, after it, or before it; `at` is `null` if there is no room.
  function placed(item, right) {
    const spot = besides(item, right);
    return spot.at === null && item.short ? besides({ ...item, words: item.short }, right) : spot;
  }

  function besides(item, right) {
    const width = measure.measureText(item.words).width;
    const { x0, x1 } = item;
    if (item.style !== 'event' && x1 - x0 > width + 8) return { ...item, from: x0, to: x1, at: x0 + 4, inside: true };
    if (x1 + 4 + width <= right) return { ...item, from: x0, to: x1 + 4 + width, at: x1 + 4 };
    if (x0 - 4 - width >= 0) return { ...item, from: x0 - 4 - width, to: x1, at: x0 - 4 - width };
    return { ...item, from: x0, to: x1, at: null };
  }

  // Draws the lanes below the plot `u` into `element`, which never shrinks, so that zooming does not move the page.
  return function draw(u, element) {
    const px = uPlot.pxRatio;
    const [left, right] = [u.bbox.left / px, (u.bbox.left + u.bbox.width) / px];
    const toX = at => left + u.valToPos(at, 'x');
    const inSight = item => item.x1 >= left - 0.5 && item.x0 <= right + 0.5;
    const clip = x => Math.min(Math.max(x, left), right);
    const bars = spans.map(span => ({ ...span, x0: toX(span.from), x1: span.to === Infinity ? right : toX(span.to) }))
      .filter(inSight).map(item => ({ ...item, x0: clip(item.x0), x1: item.isMoment ? item.x0 : Math.max(clip(item.x1), clip(item.x0) + 2) }));
    const marks = groups(toX).filter(inSight);
    const lanes = [];
    let svg = '';
    const pack = (items, first) => {
      for (const item of items.map(item => placed(item, right)).sort((a, b) => a.x0 - b.x0)) {
        let lane = first;
        while (lane < first + MOST - 1 && lane < lanes.length && lanes[lane] + GAP > item.from) lane++;
        const full = lane < lanes.length && lanes[lane] + GAP > item.from;
        lanes[lane] = Math.max(lanes[lane] ?? 0, full ? item.x1 : item.to);
        const top = lane * LANE + 2;
        svg += `<g class="${item.style}"><title>${escaped(item.title)}</title>`;
        svg += item.style === 'event' || item.isMoment
          ? `<path d="M${item.x0} ${top}v${BAR}${item.x1 > item.x0 ? `M${item.x1} ${top}v${BAR}` : ''}"/>`
          : `<rect x="${item.x0}" y="${top}" width="${item.x1 - item.x0}" height="${BAR}"/>`;
        if (item.at !== null && !full) svg += `<text x="${item.at}" y="${top + BAR - 2.5}">${escaped(item.words)}</text>`;
        svg += '</g>';
      }
    };
    pack(bars, 0);
    pack(marks, lanes.length);
    const height = Math.max(lanes.length * LANE + 4, element.clientHeight);
    element.style.minHeight = `${height}px`;
    element.innerHTML = `<svg width="${u.width}" height="${height}" role="img" aria-label="what happened">${svg}</svg>`;
  };

  function escaped(words) {
    return words.replace(/[&<>"]/g, c => `&#${c.charCodeAt(0)};`);
  }
}
