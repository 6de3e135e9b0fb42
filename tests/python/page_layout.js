// Words on the drawing against each other, the tools and the border; arrows and joints against the border; nothing wider
// than the page, nothing of it over something else, no bar too short to read.
(() => {
  const words = partita.written(), [width, height] = partita.size(), bad = [];
  const meet = (a, b) => a.left < b.right - 0.5 && b.left < a.right - 0.5 && a.top < b.bottom - 0.5 && b.top < a.bottom - 0.5;
  words.forEach((a, i) => {
    if (a.left < 0 || a.top < 0 || a.right > width || a.bottom > height) bad.push(`"${a.text}" leaves the drawing`);
    for (const b of words.slice(i + 1)) {
      if (meet(a, b)) bad.push(`"${a.text}" on "${b.text}"`);
      else if (Math.abs(a.bottom - b.bottom) < 5 && Math.max(a.left - b.right, b.left - a.right) < 4) bad.push(`"${a.text}" runs into "${b.text}"`);
    }
    if (/^(hollow|double stroke):.*…/.test(a.text)) bad.push(`"${a.text}" is cut`);
    for (const box of partita.covered()) if (meet(a, box)) bad.push(`"${a.text}" under the tools`);
  });
  const inside = (p) => p.x >= 0 && p.y >= 0 && p.x <= width && p.y <= height;
  for (const [p, q] of partita.arrows()) if (!inside(p) || !inside(q)) bad.push(`an arrow to ${q.x}, ${q.y} leaves the drawing`);
  for (const p of partita.joints()) if (!inside(p)) bad.push(`${p.name} leaves the drawing`);
  const outside = partita.corners().filter((p) => !p || !inside(p));
  if (outside.length) bad.push(`${outside.length} points of bodies leave the drawing`);
  const under = partita.corners().filter((p) => p && partita.covered().some((box) =>
    meet({ left: p.x, right: p.x + 1, top: p.y, bottom: p.y + 1 }, box)));
  if (under.length) bad.push(`${under.length} points of bodies lie under the tools`);
  const wide = document.documentElement.clientWidth;
  for (const e of document.querySelectorAll("body *")) {
    const box = e.getBoundingClientRect();
    if (box.width && box.right > wide + 0.5 && e.checkVisibility()) bad.push(`${e.tagName}#${e.id} is wider than the page`);
  }
  const boxes = [...document.querySelectorAll("header > *, #stage, #plots, aside, footer > *")].filter((e) => e.checkVisibility());
  const fixed = (e) => e.parentElement.tagName === "FOOTER"; // on a phone it floats over what is scrolled
  boxes.forEach((a, i) => boxes.slice(i + 1).forEach((b) => {
    if (fixed(a) === fixed(b) && meet(a.getBoundingClientRect(), b.getBoundingClientRect())) bad.push(`${a.id} over ${b.id}`);
  }));
  for (const e of document.querySelectorAll(".row .name")) {
    const [box, end] = [e, e.lastElementChild].map((one) => one.getBoundingClientRect());
    if (e.checkVisibility() && end.right > box.right + 0.5) bad.push(`the end of the name ${e.textContent} is cut`);
  }
  for (const e of document.querySelectorAll(".row")) {
    const track = e.querySelector(".track").getBoundingClientRect();
    if (e.checkVisibility() && track.width < 60) bad.push(`a bar of ${track.width} px`);
  }
  for (const e of document.querySelectorAll(".row .value, .plot .read, .plot .open, #readouts dd, #trust dd, #trust p")) {
    const box = e.getBoundingClientRect(), home = e.closest("#plots, aside, header").getBoundingClientRect();
    if (!e.checkVisibility()) continue;
    if (e.scrollWidth > e.clientWidth + 1 && e.clientWidth || box.right > home.right) bad.push(`"${e.textContent}" is cut`);
  }
  for (const row of partita.ticks()) {
    (row || []).forEach((tick, i) => { if (i && tick.left < row[i - 1].right + 6) bad.push(`${row[i - 1].text} runs into ${tick.text}`); });
  }
  const last = [...document.querySelectorAll("#multiples .plot")].map((e) => e.getBoundingClientRect().right), strip = document.getElementById("multiples");
  if (last.length && strip.checkVisibility() && Math.max(...last) < strip.getBoundingClientRect().right - 2) bad.push("a part of the strip of plots is empty");
  return [...new Set(bad)];
})()
