// Functions that run inside a page: each is self-contained, because its source text is sent there.

// Runs before the page's own scripts: keeps the box of every text that is drawn on a canvas, until that is cleared.
export function recordCanvasText() {
  const texts = new WeakMap();
  window.canvasTexts = canvas => texts.get(canvas) ?? [];
  const proto = CanvasRenderingContext2D.prototype;
  const [fillText, clearRect] = [proto.fillText, proto.clearRect];
  proto.clearRect = function (...area) {
    texts.delete(this.canvas);
    clearRect.apply(this, area);
  };
  proto.fillText = function (text, x, y, ...more) {
    fillText.call(this, text, x, y, ...more);
    if (!String(text).trim()) return;
    const size = this.measureText(text);
    const [left, right] = [x - size.actualBoundingBoxLeft, x + size.actualBoundingBoxRight];
    const [top, bottom] = [y - size.actualBoundingBoxAscent, y + size.actualBoundingBoxDescent];
    const corners = [[left, top], [right, top], [left, bottom], [right, bottom]].map(([px, py]) => this.getTransform().transformPoint({ x: px, y: py }));
    const [xs, ys] = [corners.map(corner => corner.x), corners.map(corner => corner.y)];
    const box = { text, left: Math.min(...xs), right: Math.max(...xs), top: Math.min(...ys), bottom: Math.max(...ys) };
    texts.set(this.canvas, [...(texts.get(this.canvas) ?? []), box]);
  };
}

// Returns what a reader would find wrong with the layout of the document, one line each.
export function problemsInPage() {
  const SLACK_PX = 1.5; // antialiasing and rounding
  const LONGEST = 24; // longer words, such as hashes and paths, may be broken
  const found = new Set();
  const quoted = text => `"${text.trim().replace(/\s+/g, ' ').slice(0, 80)}"`;
  const width = document.documentElement.clientWidth;
  const isShown = element => element.checkVisibility({ visibilityProperty: true, opacityProperty: true });

  if (document.documentElement.scrollWidth > width) {
    found.add(`the page is ${document.documentElement.scrollWidth} px wide in a window of ${width} px`);
  }

  // Returns the boxes that clip an element, from the inside up to the first that scrolls.
  const clips = element => {
    const boxes = [];
    for (let box = element; box && box !== document.body; box = box.parentElement) {
      const style = getComputedStyle(box);
      if (/auto|scroll/.test(style.overflowX)) return boxes;
      const isPicture = box.tagName === 'svg';
      if (style.display !== 'inline' && /hidden|clip/.test(style.overflowX + style.overflowY) && (isPicture || !(box instanceof SVGElement))) boxes.push(box);
      if (box !== element && style.position === 'fixed') break;
    }
    return [...boxes, document.documentElement];
  };
  const isOutside = (rect, element) => clips(element).some(box => {
    const around = box === document.documentElement ? { left: 0, right: width, top: -Infinity, bottom: Infinity } : box.getBoundingClientRect();
    return rect.left < around.left - SLACK_PX || rect.right > around.right + SLACK_PX
      || rect.top < around.top - 4 || rect.bottom > around.bottom + 4; // a line is higher than its letters
  });
  // Text for screen readers alone is a pixel wide.
  const isForReaders = element => element.closest('.visually-hidden, .u-hz') !== null && element.getBoundingClientRect().width <= 1;

  const labels = new Map();
  const walker = document.createTreeWalker(document.body, NodeFilter.SHOW_TEXT);
  for (let node = walker.nextNode(); node; node = walker.nextNode()) {
    const element = node.parentElement;
    if (!node.data.trim() || element.closest('script, style, noscript, title') || !isShown(element) || isForReaders(element)) continue;
    const range = document.createRange();
    range.selectNodeContents(node);
    for (const rect of range.getClientRects()) {
      if (rect.width > 0.5 && isOutside(rect, element)) found.add(`clipped: ${quoted(node.data)}`);
    }
    const picture = element.closest('svg');
    if (picture) {
      const box = element.closest('text').getBoundingClientRect();
      const all = labels.get(picture) ?? labels.set(picture, new Map()).get(picture);
      all.set(element.closest('text'), { text: element.closest('text').textContent, left: box.left, right: box.right, top: box.top, bottom: box.bottom });
      continue;
    }
    if (element.closest('pre, code, h1')) continue; // commands and names of files may break anywhere
    for (const word of node.data.matchAll(/(?:(?<![\p{L}\p{N}])[+−-](?=\p{N}))?[\p{L}\p{N}]+(?:[.,][\p{L}\p{N}]+)*/gu)) {
      if (word[0].length > LONGEST || word[0].length < 2) continue;
      range.setStart(node, word.index);
      range.setEnd(node, word.index + word[0].length);
      const lines = new Set([...range.getClientRects()].filter(rect => rect.width > 0.5).map(rect => Math.round(rect.top)));
      if (lines.size > 1) found.add(`broken over ${lines.size} lines: ${quoted(word[0])} in ${quoted(element.textContent)}`);
    }
  }

  const overlapping = (texts, slack) => {
    for (const [i, a] of texts.entries()) {
      for (const b of texts.slice(i + 1)) {
        const [across, down] = [Math.min(a.right, b.right) - Math.max(a.left, b.left), Math.min(a.bottom, b.bottom) - Math.max(a.top, b.top)];
        if (across > slack && down > slack) found.add(`labels overlap: ${quoted(a.text)} and ${quoted(b.text)}`);
      }
    }
  };
  // The boxes of labels reach above and below the letters, so boxes that overlap slightly are no fault.
  for (const all of labels.values()) overlapping([...all.values()], 3);
  for (const canvas of document.querySelectorAll('canvas')) {
    const texts = window.canvasTexts?.(canvas) ?? [];
    overlapping(texts, 2 * devicePixelRatio);
    for (const { text, left, right, top, bottom } of texts) {
      if (left < -1 || top < -1 || right > canvas.width + 1 || bottom > canvas.height + 1) found.add(`clipped in a plot: ${quoted(text)}`);
    }
  }
  // The figures of a flight share their time, so its phases are named below the first figure only.
  const named = [...document.querySelectorAll('#course .lanes, #figures .lanes')].filter(lanes => lanes.querySelector('.phase'));
  if (named.length > 1) found.add(`the phases are named below ${named.length} figures`);
  return [...found];
}
