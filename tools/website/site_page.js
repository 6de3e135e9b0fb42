// What a reader would stumble over on a page: parts that leave it, tables that are cut, formulas that are not drawn, words
// that cannot be read, code without its button. A list of sentences.
(() => {
  const bad = [], root = document.documentElement, wide = root.clientWidth;
  const name = (e) => `${e.tagName.toLowerCase()}${e.id ? `#${e.id}` : ""}${e.className && e.className.baseVal === undefined ? `.${String(e.className).trim().split(/\s+/).join(".")}` : ""} "${e.textContent.trim().slice(0, 40).replace(/\s+/g, " ")}"`;
  const seen = (e) => e.checkVisibility({ visibilityProperty: true, opacityProperty: true });
  const article = document.querySelector("article") || document.body;
  if (root.scrollWidth > wide + 1) bad.push(`the page is ${root.scrollWidth} px wide on a screen of ${wide}`);
  // Whatever is wider than the screen must stand in something that scrolls.
  const scrolls = (e) => { for (let at = e; at && at !== document.body; at = at.parentElement) if (["auto", "scroll"].includes(getComputedStyle(at).overflowX)) return at; return null; };
  for (const e of article.querySelectorAll("table, pre, math, img, svg, iframe, dt.sig, .card")) {
    if (!seen(e)) continue;
    const box = e.getBoundingClientRect();
    if (box.right > wide + 1 && !scrolls(e)) bad.push(`${name(e)} is cut at the right`);
  }
  // What is clipped without a way to scroll is cut as well.
  for (const e of article.querySelectorAll("*")) {
    if (e.scrollWidth > e.clientWidth + 1 && e.clientWidth > 0 && ["hidden", "clip"].includes(getComputedStyle(e).overflowX) && seen(e) && !e.closest("svg, math, .visually-hidden"))
      bad.push(`${name(e)} hides ${e.scrollWidth - e.clientWidth} px`);
  }
  // A column of a table must hold a word or two, else a cell is a tower of letters.
  for (const cell of article.querySelectorAll("td, th")) {
    const box = cell.getBoundingClientRect();
    if (seen(cell) && box.width < 90 && cell.textContent.trim().length > 40) bad.push(`${name(cell)}: a column of words ${Math.round(box.width)} px wide`);
    if (seen(cell) && cell.textContent.trim().length > 40 && box.height > 9 * box.width) bad.push(`${name(cell)} is ${Math.round(box.width)} px wide and ${Math.round(box.height)} px high`);
  }
  // A name in code stands on one line, in tables too.
  const range = document.createRange();
  for (const code of article.querySelectorAll("table.docutils code")) {
    const texts = document.createTreeWalker(code, NodeFilter.SHOW_TEXT);
    for (let text = texts.nextNode(); text; text = texts.nextNode()) for (const word of text.data.matchAll(/[\w.]+/g)) {
      range.setStart(text, word.index);
      range.setEnd(text, word.index + word[0].length);
      if (new Set([...range.getClientRects()].map((box) => Math.round(box.top))).size > 1) bad.push(`"${word[0]}" is broken within itself in ${name(code)}`);
    }
  }
  // On a wide screen an example and what it prints are seen whole.
  if (wide > 1072) for (const e of article.querySelectorAll("div:is(.highlight-python, .highlight-default, .highlight-output) pre"))
    if (e.scrollWidth > e.clientWidth + 1) bad.push(`${name(e)} goes on ${e.scrollWidth - e.clientWidth} px out of sight`);
  // A number stands on one line with its unit, in tables of the site itself.
  for (const cell of article.querySelectorAll("table.docutils td")) {
    const texts = [cell, ...cell.querySelectorAll("*")].filter((e) => !e.closest("code, pre, math")).flatMap((e) => [...e.childNodes].filter((n) => n.nodeType === 3));
    const parted = texts.map((n) => n.data.match(/\d (ns|us|µs|ms|s|mm|m|kg|N|MB)\b/)).find(Boolean);
    if (parted) bad.push(`${name(cell)}: "${parted[0]}" may be parted between two lines`);
    // A path may go on below behind each of its folders: no column is as wide as all of it.
    const path = texts.map((n) => n.data.match(/[\w.-]+(\/[\w.-]+)*\/[\w-]+\.[a-z]+\b/)).find(Boolean);
    if (path) bad.push(`${name(cell)}: "${path[0]}" is one word`);
  }
  for (const e of article.querySelectorAll(".math")) {
    const drawn = e.querySelector("math"), box = drawn && drawn.getBoundingClientRect();
    if (!drawn || box.width < 2 || box.height < 2) bad.push(`${name(e)} is no drawn formula`);
    else if (e.querySelector("merror")) bad.push(`${name(e)} has an error in it`);
  }
  if (article.innerText.includes("Alias for field number")) bad.push("a field without words of its own");
  if (/\$\$|\\frac|\\mathbf|:math:|\{doc\}|\{ref\}/.test([...article.querySelectorAll("p, li, td, dd")].filter((e) => !e.querySelector("pre, code")).map((e) => e.innerText).join("\n"))) bad.push("raw LaTeX or markup in the text");
  for (const e of article.querySelectorAll("img")) if (e.complete && !e.naturalWidth) bad.push(`picture ${e.getAttribute("src")} is not there`);
  for (const e of article.querySelectorAll("div.highlight-python, div.highlight-bash, div.highlight-toml, div.highlight-console, div.highlight-sh"))
    if (!e.querySelector("button.copybtn")) bad.push(`no button to copy ${name(e)}`);
  for (const e of article.querySelectorAll("section")) {
    const rest = [...e.children].filter((c) => !/^H\d$/.test(c.tagName) && !(c.tagName === "SPAN" && !c.textContent.trim()));
    if (!rest.length) bad.push(`nothing under the heading ${name(e)}`);
  }
  // Contrast, by the formula of the accessibility guidelines (WCAG 2, 1.4.3).
  const canvas = document.createElement("canvas"); canvas.width = canvas.height = 1;
  const pen = canvas.getContext("2d", { willReadFrequently: true }), known = new Map();
  const parse = (text) => {
    if (!known.has(text)) { pen.clearRect(0, 0, 1, 1); pen.fillStyle = text; pen.fillRect(0, 0, 1, 1); const d = pen.getImageData(0, 0, 1, 1).data; known.set(text, [d[0], d[1], d[2], d[3] / 255]); }
    return known.get(text);
  };
  const over = (a, b) => [0, 1, 2].map((i) => a[i] * a[3] + b[i] * (1 - a[3])).concat(1);
  const linear = (x) => (x / 255 <= 0.04045 ? x / 255 / 12.92 : ((x / 255 + 0.055) / 1.055) ** 2.4);
  const light = (c) => 0.2126 * linear(c[0]) + 0.7152 * linear(c[1]) + 0.0722 * linear(c[2]);
  const ratio = (a, b) => { const [x, y] = [light(a), light(b)].sort((p, q) => q - p); return (x + 0.05) / (y + 0.05); };
  const behind = (e) => { const layers = []; for (let at = e; at; at = at.parentElement) layers.push(parse(getComputedStyle(at).backgroundColor)); return layers.reverse().reduce((below, layer) => over(layer, below), [255, 255, 255, 1]); };
  const pale = new Map();
  for (const e of document.querySelectorAll("body *")) {
    const own = [...e.childNodes].some((n) => n.nodeType === 3 && n.textContent.trim());
    if (!own || ["SCRIPT", "STYLE", "NOSCRIPT", "OPTION", "TITLE", "TEMPLATE"].includes(e.tagName) || e.closest("math, svg, .headerlink, .tooltip") || !seen(e)) continue;
    const paper = behind(e), found = ratio(over(parse(getComputedStyle(e).color), paper), paper);
    if (found < 4.5) { const key = `${e.tagName}.${e.className}`; if (!pale.has(key)) pale.set(key, `${name(e)} has a contrast of ${found.toFixed(2)}`); }
  }
  return [...new Set([...bad, ...pale.values()])];
})()
