// Usage: node picture.mjs FILE.png PAGE [SELECTOR]
//
// Takes a picture of a page, file or address, as it is after a moment: 1440 by 900 px, light, from the top of the page or
// of the first element SELECTOR.

import { pathToFileURL } from 'node:url';
import { GRAPHICS, open, start } from './harness.mjs';

const [file, page, selector] = process.argv.slice(2);
const MOMENT_MS = 6000;

const browser = await start(GRAPHICS);
const opened = await open(browser, /^https?:/.test(page) ? page : pathToFileURL(page).href);
if (selector) await opened.locator(selector).first().evaluate(element => element.scrollIntoView({ block: 'start' }));
await opened.waitForTimeout(MOMENT_MS);
await opened.screenshot({ path: file });
await browser.close();
