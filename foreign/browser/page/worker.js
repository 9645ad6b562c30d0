// Flies in a thread of its own, so that the page stays responsive.

import { load } from './module.js';

const module = fetch('trefoil_browser.wasm').then(async response => {
  if (!response.ok) throw new Error(`${response.url}: ${response.status}`);
  return load(await response.arrayBuffer());
});

onmessage = async ({ data: settings }) => {
  try {
    const fly = await module;
    const start = performance.now();
    const flight = fly(settings);
    postMessage({ settings, flight, took_ms: performance.now() - start });
  } catch (error) {
    postMessage({ settings, flight: { error: String(error) } });
  }
};
