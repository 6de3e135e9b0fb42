// The mechanism with its changed numbers as a model file and as a Python script.

/** Text of a list of numbers: as it is, a matrix in rows, a single number alone. */
function listed(values, rows) {
  const text = (x) => (Number.isInteger(x) && Math.abs(x) < 1e15 ? `${x}.0` : String(x));
  if (values.length === 1) return text(values[0]);
  if (!rows) return `[${values.map(text).join(", ")}]`;
  return `[${[0, 3, 6].map((i) => listed(values.slice(i, i + 3), false)).join(", ")}]`;
}

/** Tables of a model file as this package writes it: each with the numbers of its lines. */
function tablesOf(lines) {
  const tables = [];
  lines.forEach((line, i) => {
    if (/^\[/.test(line)) tables.push({ first: i, name: "" });
    const at = tables[tables.length - 1];
    const named = /^name = (".*")$/.exec(line);
    if (at && named) at.name = JSON.parse(named[1]);
  });
  tables.forEach((table, n) => { table.end = n + 1 < tables.length ? tables[n + 1].first : lines.length; });
  return tables;
}

const OF_BODIES = ["mass", "inertia", "com"]; // of a solid they follow from its shape

/**
 * The model file with other numbers: `text` as drawn, `changed` {name: values}, drives {name: {level, value}}, `solids` {name: table}
 * as bodies, in place of the shapes of those with other numbers. Returns the text and the names for which the file has no place.
 */
function toToml(text, changed, drives, solids) {
  const lines = text.split("\n").filter((line) => !line.startsWith("# as saved by")), missing = [];
  const owners = Object.keys(changed).filter((name) => OF_BODIES.includes(name.slice(name.lastIndexOf(".") + 1)));
  for (const owner of new Set(owners.map((name) => name.slice(0, name.lastIndexOf("."))))) {
    const table = tablesOf(lines).find(({ name, first }) => name === owner && lines[first] === "[[solid]]");
    if (table) lines.splice(table.first, table.end - table.first, ...solids[owner].split("\n"));
  }
  const put = (owner, key, value) => {
    // names are unique among bodies, and among joints: the one that has the number, or may have it
    const has = ({ first, end }) => lines.slice(first, end).some((line) => line.startsWith(`${key} = `));
    const kind = owner === null ? "[mechanism]" : { com: "[[body]]", child_point: "[[joint]]" }[key];
    const named = tablesOf(lines).filter(({ name, first }) => (owner === null || name === owner) && (!kind || lines[first] === kind));
    const table = named.find((one) => lines[one.first] !== "[mechanism]" && has(one)) || named.find(({ first }) => kind === lines[first]);
    if (!table) return false;
    for (let i = table.first; i < table.end; i++) {
      if (!lines[i].startsWith(`${key} = `)) continue;
      let last = i, depth = 0;
      for (; last < table.end; last++) { // a value goes on while brackets are open
        for (const c of lines[last]) depth += c === "[" ? 1 : c === "]" ? -1 : 0;
        if (depth <= 0) break;
      }
      lines.splice(i, last - i + 1, `${key} = ${value}`);
      return true;
    }
    let end = table.first + 1;
    while (end < table.end && lines[end] !== "") end++;
    lines.splice(end, 0, `${key} = ${value}`);
    return true;
  };
  for (const [name, values] of Object.entries(changed)) {
    const at = name.lastIndexOf("."), key = name.slice(at + 1), owner = at < 0 ? null : name.slice(0, at);
    if (!put(owner, key, listed(values, key === "inertia"))) missing.push(name);
  }
  for (const [name, { level, value }] of Object.entries(drives)) if (!put(name, level, listed([value]))) missing.push(name);
  return { text: `${lines.join("\n").trimEnd()}\n`, missing };
}

/** A Python script that loads the model file and runs it from a position: targets and rates by joint. */
function toPython(file, toml, targets, rates, seconds) {
  const words = (numbers) => `{${Object.entries(numbers).map(([name, x]) => `${JSON.stringify(name)}: ${listed([x])}`).join(", ")}}`;
  const literal = toml.replaceAll("\\", "\\\\").replaceAll('"""', '\\"\\"\\"');
  return [
    '"""A mechanism from a playground, with the numbers that were set there."""', "", "from pathlib import Path", "",
    "import partita as pt", "", `MODEL = """\\`, `${literal}"""`, "",
    `path = Path(${JSON.stringify(file)})`, 'path.write_text(MODEL, encoding="utf-8")', "m = pt.load(path)",
    `start = m.assemble(targets=${words(targets)}, rates=${words(rates)})`,
    `run = m.simulate(${listed([seconds])}, initial=start)`, "print(run.message)",
    'run.to_html(path.with_suffix(".html"))', "",
  ].join("\n");
}
