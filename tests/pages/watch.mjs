// Usage: node watch.mjs ADDRESS
//
// Opens a live page and has it drawn until its flight ends; prints its title.

import { GRAPHICS, open, start } from './harness.mjs';

const browser = await start(GRAPHICS);
const page = await open(browser, process.argv[2]);
const title = await page.title();
const over = () => ['ended', 'disconnected'].includes(document.querySelector('#phase').textContent);
await page.waitForFunction(over, null, { timeout: 0 });
await browser.close();
console.log(title);
