// All text on the page against what lies behind it, by the formula of the accessibility guidelines (WCAG 2, 1.4.3).
(() => {
  const parse = (text) => { const n = text.match(/[\d.]+/g).map(Number); return n.length < 4 ? [...n.slice(0, 3), 1] : n; };
  const over = (a, b) => [0, 1, 2].map((i) => a[i] * a[3] + b[i] * (1 - a[3])).concat(1);
  const linear = (x) => (x / 255 <= 0.04045 ? x / 255 / 12.92 : ((x / 255 + 0.055) / 1.055) ** 2.4);
  const light = (c) => 0.2126 * linear(c[0]) + 0.7152 * linear(c[1]) + 0.0722 * linear(c[2]);
  const ratio = (a, b) => { const [x, y] = [light(a), light(b)].sort((p, q) => q - p); return (x + 0.05) / (y + 0.05); };
  const behind = (e) => {
    const layers = [];
    for (let at = e; at; at = at.parentElement) layers.push(parse(getComputedStyle(at).backgroundColor));
    return layers.reverse().reduce((below, layer) => over(layer, below), [255, 255, 255, 1]);
  };
  const bad = [], canvas = document.createElement("canvas").getContext("2d");
  for (const e of document.querySelectorAll("body *")) {
    const own = [...e.childNodes].some((n) => n.nodeType === 3 && n.textContent.trim());
    if (!own || !e.checkVisibility({ visibilityProperty: true }) || ["SCRIPT", "NOSCRIPT", "OPTION"].includes(e.tagName)) continue;
    const found = ratio(over(parse(getComputedStyle(e).color), behind(e)), behind(e));
    if (found < 4.5) bad.push(`${e.tagName}#${e.id}.${e.className} "${e.textContent.trim().slice(0, 30)}": ${found.toFixed(2)}`);
  }
  const paper = behind(document.getElementById("stage"));
  for (const word of globalThis.partita ? partita.written() : []) {
    canvas.fillStyle = word.colour;
    const hex = canvas.fillStyle, colour = [1, 3, 5].map((i) => parseInt(hex.slice(i, i + 2), 16));
    if (ratio(colour, paper) < 4.5) bad.push(`"${word.text}" on the drawing: ${ratio(colour, paper).toFixed(2)}`);
  }
  return bad;
})()
