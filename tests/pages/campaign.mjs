// Usage: node campaign.mjs [--shots DIR] URL
//
// Looks at the page of a campaign under way in all widths and schemes, and checks that a new version of the page keeps
// the scroll position and the unfolded parts. Prints one line for each fault of the page; exits with 1 if there is any.
// The campaign must fly for a minute or more, and have flights that fail.

import { look, open, problems, start } from './harness.mjs';

const args = process.argv.slice(2);
const shots = args[0] === '--shots' ? args.splice(0, 2)[1] : null;
const [url] = args;
const LIMIT_MS = 60_000;

const browser = await start();
const found = [];
const expect = (what, holds) => { if (!holds) found.push(`not so: ${what}`); };
const until = (page, condition, value) => page.waitForFunction(condition, value, { timeout: LIMIT_MS })
  .catch(() => { throw new Error(`after ${LIMIT_MS} ms it is not so: ${condition}`); });
const filled = page => until(page, () => document.getElementById('worst') && document.querySelector('main svg'));

try {
  found.push(...await look(browser, url, { prepare: filled, shoot: (width, scheme) => shots && `${shots}/campaign-${width}-${scheme}.png` }));
  const page = await open(browser, url);
  await filled(page);
  const before = await page.evaluate(() => {
    for (const details of document.querySelectorAll('details')) details.open = true;
    scrollTo(0, 400);
    return { title: document.title, flights: Number(document.querySelector('progress').value), top: scrollY };
  });
  expect('the window can be moved', before.top === 400);
  await until(page, title => document.title !== title, before.title);
  const after = await page.evaluate(() => ({
    flights: Number(document.querySelector('progress').value), top: scrollY,
    folded: [...document.querySelectorAll('details')].filter(details => !details.open).length,
  }));
  expect(`more flights are there: ${JSON.stringify([before, after])}`, after.flights > before.flights);
  expect('the window keeps its place', Math.abs(after.top - before.top) <= 1);
  expect('what is unfolded stays so', after.folded === 0);
  found.push(...await problems(page));
} catch (error) {
  found.push(`stuck: ${error.message}`);
}
await browser.close();
for (const problem of found) console.log(problem);
process.exitCode = found.length ? 1 : 0;
