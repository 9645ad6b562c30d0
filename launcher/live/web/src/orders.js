// The buttons: each sends an order, which the server carries out as a command line, and shows the command's output.

const KEPT = 8; // number of answers that are shown
const CONFIRM_MS = 4000;

export function orders() {
  const form = name => document.getElementById(name);
  const answers = document.getElementById('answers');
  const fields = name => Object.fromEntries(new FormData(form(name)));
  let faults = {};

  const option = (value, words = value) => Object.assign(document.createElement('option'), { value, textContent: words });
  const target = form('inject').elements.target;
  const kinds = () => form('inject').elements.kind.replaceChildren(...(faults[target.value] ?? []).map(kind => option(kind)));
  target.addEventListener('change', kinds);

  async function order(name, body, button) {
    const item = document.createElement('div');
    item.className = 'running';
    const line = document.createElement('code');
    line.textContent = `${name} …`;
    const said = document.createElement('pre');
    item.append(line, said);
    answers.prepend(item);
    while (answers.children.length > KEPT) answers.lastChild.remove();
    button.disabled = true;
    try {
      const response = await fetch('/command', {
        method: 'POST', headers: { 'Content-Type': 'application/json' }, body: JSON.stringify({ command: name, ...body }),
      });
      const answer = response.ok ? await response.json() : { line: name, ok: false, said: await response.text() };
      item.className = answer.ok ? 'done' : 'refused';
      line.textContent = answer.line || name;
      said.textContent = answer.said || (answer.ok ? 'done' : 'failed');
    } catch (error) {
      item.className = 'refused';
      said.textContent = `the page’s server does not answer (${error.message})`;
    }
    button.disabled = form('stop').dataset.flying !== 'yes';
  }

  const on = (name, body) => form(name).addEventListener('submit', event => {
    event.preventDefault();
    order(name, body(), event.submitter ?? form(name).querySelector('button'));
  });
  on('inject', () => fields('inject'));
  on('clear', () => ({ target: fields('clear').target || null }));
  on('swap', () => ({ node: fields('swap').node, set: fields('swap').set.split(/[ ;]+/).filter(Boolean) }));
  // The button `Stop` needs a second press.
  form('stop').addEventListener('submit', event => {
    event.preventDefault();
    const button = form('stop').querySelector('button');
    if (button.textContent === 'Stop') {
      button.textContent = 'Stop: press again';
      setTimeout(() => { button.textContent = 'Stop'; }, CONFIRM_MS);
    } else {
      button.textContent = 'Stop';
      order('stop', {}, button);
    }
  });

  return {
    begin(flight) {
      faults = flight.faults;
      target.replaceChildren(...Object.keys(faults).map(name => option(name)));
      target.value = 'mixer';
      kinds();
      form('clear').elements.target.replaceChildren(option('', 'everything'), ...Object.keys(faults).map(name => option(name)));
      form('swap').elements.node.replaceChildren(...flight.swaps.map(name => option(name)));
      form('swap').elements.node.value = 'attitude-mpc';
    },
    enable(flying) {
      form('stop').dataset.flying = flying ? 'yes' : 'no';
      for (const name of ['inject', 'clear', 'swap', 'stop']) form(name).querySelector('button').disabled = !flying;
    },
  };
}
