// The ring as a picture: nodes with their processes, topics with their ages.

const BOX = { width: 162, height: 84 };
const PLACES = [[4, 8], [262, 8], [262, 168], [4, 168]]; // plant, guidance, attitude-mpc, mixer: round the ring
// Arrow of each topic, and the places of its name and its age.
const TOPICS = [
  { arrow: 'M166 50H260', at: [213, 42, 'middle'], below: 26 },
  { arrow: 'M343 92V166', at: [351, 126, 'start'], below: 16 },
  { arrow: 'M262 218H168', at: [217, 210, 'middle'], below: 26 },
  { arrow: 'M85 168V94', at: [77, 126, 'end'], below: 16 },
];

export function ring(element, flight, status) {
  const names = ['plant', 'guidance', 'attitude-mpc', 'mixer'];
  const nodes = names.map(name => status?.nodes?.find(node => node.node === name));
  const words = [];
  let svg = '<defs><marker id="tip" viewBox="0 0 8 8" refX="7" refY="4" markerWidth="7" markerHeight="7" orient="auto"><path d="M0 0L8 4L0 8Z"/></marker></defs>';
  // STATE goes to all nodes.
  for (const path of ['M166 80L260 172', 'M124 92V166']) svg += `<path d="${path}" stroke-dasharray="2 3" marker-end="url(#tip)"/>`;
  TOPICS.forEach(({ arrow, at: [x, y, anchor], below }, i) => {
    const age = nodes[i]?.age_ms;
    svg += `<path d="${arrow}" marker-end="url(#tip)"/><text x="${x}" y="${y}" text-anchor="${anchor}">${flight.topics[i].toUpperCase()}</text>`;
    if (Number.isFinite(age)) svg += `<text class="quiet" x="${x}" y="${y + below}" text-anchor="${anchor}">${age.toFixed(1)} ms</text>`;
  });
  names.forEach((name, i) => {
    const [x, y] = PLACES[i];
    const node = nodes[i];
    const vacant = node && !node.epoch;
    const state = !node ? 'not seen yet' : vacant ? 'vacant' : `active: process ${node.epoch}`;
    // Numbers that a log does not have are left out.
    const told = counts => (node && !vacant ? counts.filter(([, value]) => value !== undefined).map(([name, value]) => `${name} ${value ?? 0}`).join(', ') : '');
    const counts = told([['pid', node?.pid === null ? '?' : node?.pid], ['restarts', node?.restarts]]);
    const lag = told([['misses', node?.misses], ['behind', node?.behind]]);
    const standby = node?.standby ? `standby: process ${node.standby}` : '';
    words.push(`${name} ${[state, standby, counts, lag].filter(Boolean).join(', ')}`);
    svg += `<g class="${vacant ? 'vacant' : ''}">`;
    if (standby) svg += `<rect class="standby" x="${x + 5}" y="${y + 5}" width="${BOX.width}" height="${BOX.height}" rx="6"/>`;
    svg += `<rect x="${x}" y="${y}" width="${BOX.width}" height="${BOX.height}" rx="6"/>`;
    const lines = [[name, 'name'], [state, 'state'], [standby || counts, standby ? '' : 'quiet'], [lag, 'quiet']];
    lines.forEach(([text, style], row) => { svg += `<text class="${style}" x="${x + 10}" y="${y + 19 + 18 * row}">${text}</text>`; });
    svg += '</g>';
  });
  element.innerHTML = `<svg viewBox="0 0 432 262" role="img">${svg}</svg>`;
  element.firstChild.setAttribute('aria-label', words.join('; '));
}
