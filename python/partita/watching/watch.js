// Ask for what the file shows now; the answer comes when the file was saved, or after some seconds.

const $ = (id) => document.getElementById(id);
const SILENCE = "partita watch has ended; start it again, then reload this page.";
const AGAIN = 1500; // milliseconds until it is asked again where nobody answered

let number = 0, page = 0;

function show(found) {
  number = found.number;
  $("said").textContent = found.error ? `${found.at}: cannot be drawn; the picture is that of an earlier save` : `${found.at}: ${found.message}`;
  if (found.error && !found.page) $("said").textContent = `${found.at}: cannot be drawn`;
  $("wrong").hidden = !found.error;
  $("error").textContent = found.error ? found.message : "";
  $("excerpt").replaceChildren(...found.excerpt.map(([line, text]) => {
    const row = document.createElement("div");
    row.className = line === found.line ? "here" : "";
    row.textContent = `${String(line).padStart(4)}  ${text}`;
    return row;
  }));
  $("drawn").className = found.error ? "old" : "";
  if (found.page && found.page !== page) {
    page = found.page;
    $("drawn").contentWindow.location.replace(`page/${page}`); // not a step of the browser's history
  }
  $("remarks").replaceChildren(...found.remarks.map((words) => {
    const item = document.createElement("li");
    item.textContent = words;
    return item;
  }));
}

async function follow() {
  for (;;) {
    try {
      const response = await fetch(`since/${number}`);
      if (!response.ok) throw new Error(response.statusText);
      const found = await response.json();
      if (found.number !== number) show(found);
    } catch {
      $("said").textContent = SILENCE;
      await new Promise((r) => setTimeout(r, AGAIN));
    }
  }
}
follow();
window.watching = { number: () => number };
