// Numbers in the address of the page. What comes in is data of strangers: read as numbers of known names alone, and bounded.

const MOST_LETTERS = 20000; // of an address
const MOST_NUMBERS = 2000;
const LARGEST = 1e15; // magnitude of a number

/** The numbers that differ from the drawing, as text for an address. */
function toAddress(changed, drives) {
  const text = JSON.stringify({ v: 1, numbers: changed, drives });
  const bytes = new TextEncoder().encode(text);
  let letters = "";
  for (const byte of bytes) letters += String.fromCharCode(byte);
  return btoa(letters).replaceAll("+", "-").replaceAll("/", "_").replace(/=+$/, "");
}

/**
 * The numbers in an address, {numbers, drives}, or {fault} with what is wrong with it. `known` maps names of numbers to how
 * many there are, `driven` has the names of drives.
 */
function fromAddress(text, known, driven) {
  const fault = (why) => ({ fault: `The numbers in the address are not used: ${why}.` });
  if (text.length > MOST_LETTERS) return fault("it is too long");
  if (!/^[A-Za-z0-9_-]*$/.test(text)) return fault("it is not in the form in which this page writes it");
  let data;
  try {
    const letters = atob(text.replaceAll("-", "+").replaceAll("_", "/"));
    data = JSON.parse(new TextDecoder("utf-8", { fatal: true }).decode(Uint8Array.from(letters, (c) => c.charCodeAt(0))));
  } catch {
    return fault("it is not in the form in which this page writes it");
  }
  const plain = (x) => x !== null && typeof x === "object" && !Array.isArray(x);
  if (!plain(data) || data.v !== 1 || !plain(data.numbers) || !plain(data.drives)) return fault("it is of another version");
  const numbers = {}, drives = {};
  let count = 0;
  for (const name of Object.keys(data.numbers)) {
    const values = data.numbers[name];
    if (!Object.hasOwn(known, name)) return fault("they belong to another mechanism");
    if (!Array.isArray(values) || values.length !== known[name]) return fault("a number is missing");
    if (!values.every((x) => typeof x === "number" && Math.abs(x) <= LARGEST)) return fault("one is not a number");
    count += values.length;
    numbers[name] = values;
  }
  for (const name of Object.keys(data.drives)) {
    if (!driven.includes(name)) return fault("they belong to another mechanism");
    if (typeof data.drives[name] !== "number" || !(Math.abs(data.drives[name]) <= LARGEST)) return fault("one is not a number");
    drives[name] = data.drives[name];
    count += 1;
  }
  return count > MOST_NUMBERS ? fault("there are too many") : { numbers, drives };
}
