// Opens pages in headless Chromium, narrow and wide, light and dark, and lists what is wrong with them.

import { createRequire } from 'node:module';
import { readFileSync } from 'node:fs';
import { chromium } from 'playwright-core';
import { problemsInPage, recordCanvasText } from './in-page.mjs';

const AXE = readFileSync(createRequire(import.meta.url).resolve('axe-core/axe.min.js'), 'utf8');

export const WIDTHS = [390, 1440];
export const SCHEMES = ['light', 'dark'];

// Arguments for pages that draw in three dimensions: a machine without a graphics processor draws them by software.
export const GRAPHICS = ['--use-angle=swiftshader', '--enable-unsafe-swiftshader', '--ignore-gpu-blocklist'];

// Starts the browser that the variable CHROMIUM names, or Debian's, with `more` arguments. The caller closes it.
export function start(more = []) {
  return chromium.launch({
    executablePath: process.env.CHROMIUM ?? '/usr/bin/chromium',
    args: ['--no-sandbox', '--disable-gpu', '--disable-quic', '--no-first-run', '--disable-background-networking',
      '--disable-component-update', '--disable-sync', ...more],
  });
}

// Opens `url` in a window of its own and returns the page. `page.faults` fills with errors of scripts, failed requests,
// and requests that leave the page's own server. The caller closes `page.context()`.
export async function open(browser, url, { width = 1440, scheme = 'light' } = {}) {
  const context = await browser.newContext({ viewport: { width, height: 900 }, colorScheme: scheme });
  await context.addInitScript(recordCanvasText);
  const page = await context.newPage();
  page.faults = [];
  page.on('pageerror', error => page.faults.push(`error in a script: ${error.message}`));
  page.on('console', message => message.type() === 'error' && page.faults.push(`error on the console: ${message.text()}`));
  page.on('requestfailed', request => page.faults.push(`failed request: ${request.url()}`));
  page.on('request', request => {
    const its = new URL(request.url());
    const isOwn = ['data:', 'blob:'].includes(its.protocol) || its.host === new URL(url).host;
    if (!isOwn) page.faults.push(`request to another server: ${request.url()}`);
  });
  await page.goto(url, { waitUntil: 'load' });
  return page;
}

// Returns everything that is wrong with an open page, as lines of text: text that is clipped or broken inside a number
// or a word, labels that overlap, a page wider than its window, violations of axe-core's rules, and `page.faults`.
export async function problems(page) {
  const found = await page.evaluate(problemsInPage);
  await page.evaluate(AXE);
  const { violations } = await page.evaluate(() => window.axe.run(document, { resultTypes: ['violations'] }));
  const told = violations.flatMap(({ id, help, nodes }) =>
    nodes.slice(0, 5).map(node => `axe ${id}: ${help}: ${node.target.join(' ')}: ${node.any.map(any => any.message).join('; ')}`));
  return [...page.faults, ...found, ...told];
}

// Looks at `url` in every width and scheme; returns the problems, each with its width and scheme. `prepare` gets each
// page before it is judged, for a page that needs a click or a wait; `shoot` names the file of its picture, if any.
export async function look(browser, url, { prepare = async () => {}, shoot = () => null } = {}) {
  const all = [];
  for (const width of WIDTHS) {
    for (const scheme of SCHEMES) {
      const page = await open(browser, url, { width, scheme });
      await prepare(page);
      const path = shoot(width, scheme);
      if (path) await page.screenshot({ path, fullPage: true });
      all.push(...(await problems(page)).map(problem => `${width} px ${scheme}: ${problem}`));
      await page.context().close();
    }
  }
  return all;
}
