// Flies the survey in node by the module of the page: prints the number of the module's imports, the flight, and the
// answer to refused settings.
// Usage: node module.mjs FOLDER OF THE BOOK

import { readFileSync } from 'node:fs';

const [, , book] = process.argv;
const { load } = await import(`${book}/module.js`);
const bytes = readFileSync(`${book}/trefoil_browser.wasm`);
const fly = await load(bytes);
fly('run.command_drop_probability=0.5'); // an earlier flight must not affect the next one
console.log(JSON.stringify({
  imports: WebAssembly.Module.imports(new WebAssembly.Module(bytes)).length,
  untouched: fly(''),
  refused: fly('run.command_delay_ms=-1'),
}));
