// Usage: node replay.mjs [--shots DIR] URL
//
// Uses the page of a recorded flight as a visitor would: looks at it in all widths and schemes, then pauses, scrubs and
// changes the speed, by keyboard alone and in two windows. Prints what is wrong, one line each; ends with 1 if there is
// anything. The flight must last 12 s, with the death of the mixer at 3 s.

import { look, open, problems, start } from './harness.mjs';

const args = process.argv.slice(2);
const shots = args[0] === '--shots' ? args.splice(0, 2)[1] : null;
const [url] = args;
const LIMIT_MS = 30_000;

const browser = await start(['--use-angle=swiftshader', '--enable-unsafe-swiftshader', '--ignore-gpu-blocklist']);
const found = [];
const expect = (what, holds) => { if (!holds) found.push(`not so: ${what}`); };
const until = (page, condition, value) => page.waitForFunction(condition, value, { timeout: LIMIT_MS })
  .catch(() => { throw new Error(`after ${LIMIT_MS} ms it is not so: ${condition}`); });
const order = body => fetch(new URL('command', url), { method: 'POST', headers: { 'Content-Type': 'application/json', Authorization: `Bearer ${new URL(url).searchParams.get('token')}` }, body: JSON.stringify(body) });

// Waits until every part of the page shows the flight.
const ready = page => until(page, () => document.querySelectorAll('.uplot').length >= 12
  && document.querySelectorAll('#nodes tbody tr').length === 4
  && /process [12]/.test(document.getElementById('ring').textContent)
  && document.querySelectorAll('#events time').length > 0);
const shows = (page, seconds) => until(page, at => Math.abs(parseFloat(document.getElementById('time').textContent) - at) < 0.11, seconds);

try {
  await order({ command: 'pause' });
  await order({ command: 'seek', time_s: 8 });
  found.push(...await look(browser, url, { prepare: ready, shoot: (width, scheme) => shots && `${shots}/replay-${width}-${scheme}.png` }));

  const page = await open(browser, url);
  const other = await open(browser, url);
  await ready(page);
  await ready(other);
  await shows(page, 8);
  expect('no button of a flight under way', await page.locator('#inject, #clear, #swap, #stop').count() === 0);
  expect('what a log does not know is left out', !/pid|behind|\d ms/.test(await page.locator('#ring').innerText()));
  expect('restarts are known', /restarts 1/.test(await page.locator('#ring').innerText()));

  // Uses the keyboard: Home and End move the time, and Space plays and pauses. Then changes the speed.
  await page.focus('#player [name=position]');
  await page.keyboard.press('Home');
  await shows(page, 0);
  await shows(other, 0);
  await until(page, () => document.querySelector('#events time') === null); // what came later is unknown again
  await page.keyboard.press('End');
  await shows(page, 12);
  await page.keyboard.press('Home');
  await shows(page, 0);
  await page.keyboard.press('Shift+Tab');
  expect('the button is before the time', await page.evaluate(() => document.activeElement.name) === 'play');
  await page.keyboard.press('Space');
  await until(page, () => document.getElementById('phase').textContent === 'playing');
  await until(other, () => document.querySelector('#player button').textContent === 'Pause');
  await until(page, () => parseFloat(document.getElementById('time').textContent) > 0.5);
  await page.keyboard.press('Space');
  await until(page, () => document.getElementById('phase').textContent === 'paused');
  await page.selectOption('#player [name=speed]', '10');
  await until(other, () => document.querySelector('#player select').value === '10');
  await page.click('#player button');
  await until(page, () => document.getElementById('phase').textContent === 'at the end');
  await shows(page, 12);
  await until(page, () => document.querySelector('.lanes .event, .lanes .absence, .lanes .fault') !== null);
  if (shots) await page.screenshot({ path: `${shots}/replay-end.png`, fullPage: true });

  await page.evaluate(() => { document.querySelector('#player option[value="20"]').value = '50'; });
  await page.selectOption('#player [name=speed]', '50');
  await until(page, () => /50 is no speed/.test(document.getElementById('refused').textContent));
  found.push(...await problems(page), ...await problems(other));
} catch (error) {
  found.push(`stuck: ${error.message}`);
}
await browser.close();
for (const problem of found) console.log(problem);
process.exitCode = found.length ? 1 : 0;
