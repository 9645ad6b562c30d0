// Usage: node look.mjs [--shots DIR] PAGE...
//
// Looks at pages, files or addresses, at 390 and 1440 px, light and dark: prints what is wrong with them, one line each,
// and ends with 1 if there is anything. With --shots it writes pictures of them into a folder.

import { basename } from 'node:path';
import { pathToFileURL } from 'node:url';
import { look, start } from './harness.mjs';

const pages = process.argv.slice(2);
const shots = pages[0] === '--shots' ? pages.splice(0, 2)[1] : null;
if (!pages.length) {
  console.error('usage: node look.mjs [--shots DIR] PAGE...');
  process.exit(2);
}
const browser = await start();
let count = 0;
for (const page of pages) {
  const url = /^https?:/.test(page) ? page : pathToFileURL(page).href;
  const name = basename(page).replace(/\.html$/, '');
  const found = await look(browser, url, { shoot: (width, scheme) => shots && `${shots}/${name}-${width}-${scheme}.png` });
  for (const problem of found) console.log(`${basename(page)}: ${problem}`);
  count += found.length;
}
await browser.close();
process.exitCode = count ? 1 : 0;
