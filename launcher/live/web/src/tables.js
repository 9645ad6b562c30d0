// Timing of the nodes, worst ticks with their causes, and the events.

const MOST = 60; // number of events that are shown

// Makes an element with text, or with children.
function make(name, content, attributes = {}) {
  const element = document.createElement(name);
  element.append(...[content].flat());
  for (const key in attributes) element.setAttribute(key, attributes[key]);
  return element;
}

export function showTiming(table, worst, { timing }) {
  if (!timing) return;
  const heads = ['node', 'deadline ms', 'misses', 'late', 'slips', 'jitter or hop', 'execution', 'response'];
  const figure = us => (us ? us.map(value => value.toFixed(0)).join(' / ') : '–');
  const rows = timing.nodes.map(node => [node.node, node.deadline_ms.toFixed(1), node.misses, node.late, node.slips, ...node.figures_us.map(figure)]);
  const cells = row => row.map((cell, i) => make('td', String(cell), { 'data-label': heads[i] }));
  table.replaceChildren(make('table', [
    make('thead', make('tr', heads.map(head => make('th', head, { scope: 'col' })))),
    make('tbody', rows.map(row => make('tr', cells(row)))),
  ]));
  const ticks = timing.worst.filter(tick => tick.late_ms > 0);
  worst.replaceChildren(...(ticks.length ? [make('h3', 'Worst ticks, and why')] : []), ...ticks.map(tick => make('div', [
    make('p', [make('b', `${tick.late_ms.toFixed(2)} ms`), ` at ${tick.time_s.toFixed(2)} s: ${tick.in_words}`]),
    ...(tick.known.length ? [make('p', tick.known.join('; '), { class: 'hint' })] : []),
  ], { class: 'worst' })));
}

export function showEvents(list, { faults, absences, events }) {
  const entries = events.map(event => ({ at: event.at_s, words: `${event.node} ${event.what}${event.why ? `: ${event.why}` : ''}` }))
    .concat(faults.map(fault => ({ at: fault.from_s, words: `fault ${fault.number} acts: ${fault.what}${fault.to_s === null ? '' : `, until ${fault.to_s.toFixed(2)} s`}` })))
    .concat(absences.map(absence => ({ at: absence.from_s, words: absence.what })))
    .sort((a, b) => b.at - a.at).slice(0, MOST);
  const item = ({ at, words }) => make('li', [make('time', `${at.toFixed(2)} s`), make('span', words)]);
  list.replaceChildren(...(entries.length ? entries.map(item) : [make('li', 'nothing yet', { class: 'hint' })]));
}
