// Flies the survey in the page, in headless Chromium: prints what the page shows before and after a slider is moved.
// Usage: node page.mjs FOLDER OF THE BOOK, FOLDER FOR SCREENSHOTS; playwright-core and axe-core are in the present folder

import { createServer } from 'node:http';
import { readFile } from 'node:fs/promises';
import { createRequire } from 'node:module';
import { extname, join, normalize } from 'node:path';

const here = createRequire(`${process.cwd()}/`);
const { chromium } = here('playwright-core');
const [, , book, shots] = process.argv;
const TYPES = { '.html': 'text/html', '.js': 'text/javascript', '.css': 'text/css', '.wasm': 'application/wasm' };
const server = createServer(async (request, response) => {
  const path = normalize(decodeURIComponent(new URL(request.url, 'http://here').pathname));
  try {
    const body = await readFile(join(book, path));
    response.writeHead(200, { 'content-type': TYPES[extname(path)] ?? 'application/octet-stream' }).end(body);
  } catch {
    response.writeHead(404).end();
  }
});
await new Promise(resolve => server.listen(0, '127.0.0.1', resolve));
const origin = `http://127.0.0.1:${server.address().port}`;

// Returns what axe-core finds wrong for people who use the page by keyboard, screen reader or with little sight.
async function violations(page) {
  await page.addScriptTag({ path: here.resolve('axe-core') });
  return page.evaluate(async () => (await axe.run()).violations.map(v => `${v.id}: ${v.nodes.map(node => node.target).join(', ')}`));
}

const browser = await chromium.launch({
  executablePath: process.env.CHROMIUM ?? '/usr/bin/chromium',
  args: ['--no-sandbox', '--disable-gpu', '--disable-quic', '--no-first-run', '--disable-background-networking',
    '--disable-component-update', '--disable-sync'],
});
const told = { errors: [], elsewhere: [], pages: [] };
try {
  for (const [width, colorScheme] of [[1440, 'light'], [390, 'dark'], [390, 'light'], [1440, 'dark']]) {
    const page = await browser.newPage({ viewport: { width, height: 900 }, colorScheme });
    page.on('pageerror', error => told.errors.push(String(error)));
    page.on('console', message => message.type() === 'error' && told.errors.push(message.text()));
    page.on('request', request => /^https?:/.test(request.url()) && !request.url().startsWith(origin) && told.elsewhere.push(request.url()));
    const flown = async () => {
      await page.waitForFunction(() => /^[0-9a-f]{64}$/.test(document.getElementById('state-hash').textContent)
        && !document.body.ariaBusy && document.querySelectorAll('#flown iframe').length === 1
        && !document.querySelector('#flown .waiting'), null, { timeout: 120_000 });
      return page.evaluate(() => {
        const figures = document.querySelector('#flown iframe').contentDocument;
        return {
          hash: document.getElementById('state-hash').textContent,
          status: document.getElementById('status').textContent,
          command: document.getElementById('command').textContent,
          delay: document.querySelector('output[for=delay]').textContent,
          paths: figures.querySelectorAll('.space path.shown, .plan path.shown').length,
          plots: figures.querySelectorAll('canvas').length,
          tooWide: Math.max(...[document, figures].map(d => d.documentElement.scrollWidth - d.documentElement.clientWidth)),
        };
      });
    };
    await page.goto(`${origin}/fly.html`);
    const untouched = await flown();
    await page.screenshot({ path: join(shots, `fly-${width}-${colorScheme}.png`), fullPage: true });
    const found = await violations(page);
    // Moves a slider by the keyboard alone.
    const moved = async (slider, steps) => {
      await page.click('button[type=reset]');
      await page.waitForFunction(hash => document.getElementById('state-hash').textContent === hash, untouched.hash);
      await page.focus(slider);
      for (let i = 0; i < steps; i++) await page.keyboard.press('ArrowRight');
      await page.waitForFunction(hash => document.getElementById('state-hash').textContent !== hash && !document.body.ariaBusy, untouched.hash);
      return flown();
    };
    const late = await moved('#delay', 20);
    const windy = await moved('#wind', 10);
    told.pages.push({ width, colorScheme, untouched, late, windy, violations: found });
    await page.close();
  }
} finally {
  await browser.close();
  server.close();
}
console.log(JSON.stringify(told));
