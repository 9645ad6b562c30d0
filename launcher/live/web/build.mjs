// Builds the script of the live page from the packages of the lock file. The result is committed, so that building
// the launcher needs no npm; CI builds it again and compares.

import { build } from 'esbuild';
import { copyFileSync, writeFileSync } from 'node:fs';

const here = path => new URL(path, import.meta.url).pathname;

const { outputFiles: [bundle] } = await build({
  entryPoints: [here('src/main.js')],
  bundle: true,
  minify: true,
  format: 'iife',
  target: 'es2022',
  charset: 'utf8',
  legalComments: 'inline',
  write: false,
});
// No text in the script may end the script's element in the page.
const script = bundle.text.replaceAll('</script', '<\\/script');
writeFileSync(here('../assets/live.js'), script);
copyFileSync(here('node_modules/three/LICENSE'), here('../assets/three.LICENSE'));

// The report, too, draws with the uPlot of the lock file.
const uplot = here('node_modules/uplot/');
const report = here('../../view/assets/report/');
copyFileSync(`${uplot}dist/uPlot.iife.min.js`, `${report}uPlot.iife.min.js`);
copyFileSync(`${uplot}dist/uPlot.min.css`, `${report}uPlot.min.css`);
copyFileSync(`${uplot}LICENSE`, `${report}uPlot.LICENSE`);
console.log(`live.js: ${(script.length / 1024).toFixed(0)} kB`);
