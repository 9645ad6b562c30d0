// Usage: node live.mjs [--shots DIR] URL
//
// Uses the live page of a flight as a visitor would: looks at it in all widths and schemes, injects a fault by keyboard,
// clears it, swaps a process, reloads, and stops the flight. Prints what is wrong, one line each; ends with 1 if there
// is anything. The flight must be a hover in real time of a minute or more.

import { GRAPHICS, look, open, problems, start } from './harness.mjs';

const args = process.argv.slice(2);
const shots = args[0] === '--shots' ? args.splice(0, 2)[1] : null;
const [url] = args;
const LIMIT_MS = 30_000;

const browser = await start(GRAPHICS);
const found = [];
const expect = (what, holds) => { if (!holds) found.push(`not so: ${what}`); };
const text = (page, selector) => page.locator(selector).innerText();
const until = (page, condition, value) => page.waitForFunction(condition, value, { timeout: LIMIT_MS })
  .catch(() => { throw new Error(`after ${LIMIT_MS} ms it is not so: ${condition}`); });

// Waits until every part of the page shows the flight.
async function ready(page) {
  await until(page, () => document.getElementById('phase').textContent === 'flying'
    && document.querySelectorAll('.uplot').length >= 12
    && document.querySelectorAll('#nodes tbody tr').length === 4
    && /process 1/.test(document.getElementById('ring').textContent));
}

try {
  found.push(...await look(browser, url, { prepare: ready, shoot: (width, scheme) => shots && `${shots}/live-${width}-${scheme}.png` }));

  const page = await open(browser, url);
  await ready(page);
  const begun = parseFloat(await text(page, '#time'));
  await until(page, before => parseFloat(document.getElementById('time').textContent) > before + 0.3, begun);
  expect('the token has left the address', page.url() === new URL('/', url).href && await page.evaluate(() => document.cookie) === '');
  expect('the vehicle is drawn', await page.evaluate(() => document.querySelector('#scene canvas') !== null));

  // Injects a fault by keyboard alone, from the first field of the form on.
  await page.focus('#inject [name=target]');
  await page.keyboard.type('wind');
  await page.keyboard.press('Tab');
  await page.keyboard.press('Tab');
  await page.keyboard.type('600s');
  await page.keyboard.press('Enter');
  await until(page, () => document.querySelector('#answers .done'));
  const answer = await text(page, '#answers > div');
  expect(`the command line is shown: ${answer}`, /trefoil inject .*--for=600s.* wind step/.test(answer) && /injected: wind step/.test(answer));
  await until(page, () => /wind injected/.test(document.getElementById('events').textContent));
  await until(page, () => document.querySelector('.lanes .fault'));
  await until(page, () => parseFloat(document.getElementById('wind').textContent) > 0.5);
  if (shots) await page.screenshot({ path: `${shots}/live-wind.png`, fullPage: true });

  await page.click('#clear button');
  await until(page, () => /cleared: wind/.test(document.querySelector('#answers .done')?.textContent));

  await page.fill('#swap [name=set]', 'node.mixer.exec=/tmp/x.so');
  await page.click('#swap button');
  await until(page, () => /starts no other program/.test(document.querySelector('#answers .refused')?.textContent));
  await page.selectOption('#swap [name=node]', 'guidance');
  await page.fill('#swap [name=set]', '');
  await page.click('#swap button');
  await until(page, () => /guidance (on standby|took over)/.test(document.getElementById('events').textContent));
  await until(page, () => /standby: process|active: process 2/.test(document.getElementById('ring').textContent));
  if (shots) await page.screenshot({ path: `${shots}/live-swap.png`, fullPage: true });

  await page.reload();
  page.faults.length = 0; // a fault is the answer to the swap, which the reload has cut off
  await ready(page).catch(() => until(page, () => document.querySelectorAll('.uplot').length >= 12));
  expect('what happened is there after a reload', /wind injected/.test(await text(page, '#events')));

  await page.click('#stop button');
  expect('the end needs a second press', await text(page, '#phase') === 'flying');
  await page.click('#stop button');
  await until(page, () => ['ended', 'disconnected'].includes(document.getElementById('phase').textContent));
  await until(page, () => /stopped:/.test(document.querySelector('#answers .done')?.textContent));
  expect('the last picture stays', await page.locator('.uplot').count() >= 12 && /of/.test(await text(page, '#time')));
  // The server of `fly --web` has ended with the flight, so the attempts to connect again fail.
  found.push(...(await problems(page)).filter(problem => !/ERR_CONNECTION_REFUSED|ERR_CONNECTION_RESET/.test(problem)));
  if (shots) await page.screenshot({ path: `${shots}/live-ended.png`, fullPage: true });
} catch (error) {
  found.push(`stuck: ${error.message}`);
}
await browser.close();
for (const problem of found) console.log(problem);
process.exitCode = found.length ? 1 : 0;
