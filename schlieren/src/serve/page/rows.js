// Rows of settings: each defines what it reads from the state and which change it sends.

let send = () => {}, fail = () => {};

export function listen(change, error) { send = change; fail = error; }

export const number = (label, unit, factor, get, set, more = {}) =>
  ({ kind: "number", label, unit, factor, get, set, ...more });
export const range = (label, unit, low, high, step, get, set) =>
  ({ kind: "range", label, unit, low, high, step, factor: 1, get, set });
export const choice = (label, options, get, set, more = {}) =>
  ({ kind: "choice", label, options, get, set, ...more });
export const check = (label, get, set) => ({ kind: "check", label, get, set });
export const text = (label, unit, get, set, more = {}) =>
  ({ kind: "text", label, unit, get, set, ...more });

// Numbers in a text; a word that is none throws, because the program would not see what it was.
export function numbers(label, value) {
  return value.split(/[\s,×x]+/).filter(Boolean).map(word => {
    const n = Number(word);
    if (!Number.isFinite(n)) throw new Error(`${label}: “${word}” is not a number`);
    return n;
  });
}

export function one(label, value) {
  const all = numbers(label, value);
  if (all.length !== 1) throw new Error(`${label}: give one number, not “${value}”`);
  return all[0];
}

function hint(row) {
  const p = document.createElement("p");
  p.className = "hint";
  row.update = s => { p.textContent = row.get(s); };
  return p;
}

function written(row, s) {
  const v = row.get(s);
  if (row.kind === "text") return v;
  return v === undefined || v === null ? "" : String(Number((v * row.factor).toPrecision(6)));
}

// What was typed into a field. What cannot be sent goes back with a reason.
function typed(row, input) {
  if (row.kind === "text") return row.set(input.value, row.state);
  if (input.value === "") {
    if (input.validity.badInput) throw new Error(`${row.label}: this is not a number`);
    if (!row.empty) throw new Error(`${row.label}: a number is missing`);
    return row.set(null, row.state);
  }
  return row.set(Number(input.value) / row.factor, row.state);
}

function field(row, tell) {
  const input = document.createElement("input");
  input.type = row.kind === "number" ? "number" : "text";
  if (row.kind === "number") input.step = "any";
  if (row.empty) input.placeholder = row.empty;
  input.addEventListener("change", () => tell(() => typed(row, input)));
  row.update = (s, all) => {
    row.state = s;
    if (all || document.activeElement !== input) input.value = written(row, s);
  };
  return [input];
}

function selection(row, tell) {
  const input = document.createElement("select");
  for (const o of row.options) {
    const option = new Option(o, o);
    if (row.help?.[o]) option.dataset.help = row.help[o];
    input.append(option);
  }
  if (row.list) input.size = row.options.length;
  input.addEventListener("change", () => tell(() => row.set(input.value, row.state)));
  row.update = s => { row.state = s; input.value = row.get(s); };
  return [input];
}

function box(row, tell) {
  const input = document.createElement("input");
  input.type = "checkbox";
  input.addEventListener("change", () => tell(() => row.set(input.checked, row.state)));
  row.update = s => { row.state = s; input.checked = row.get(s); };
  return [input];
}

function slider(row, tell) {
  const input = document.createElement("input"), shown = document.createElement("b");
  Object.assign(input, { type: "range", min: row.low, max: row.high, step: row.step });
  const say = v => { shown.textContent = `${Number(Number(v).toPrecision(4))}${row.unit}`; };
  input.addEventListener("input", () => {
    say(input.value);
    tell(() => row.set(Number(input.value), row.state));
  });
  row.update = (s, all) => {
    row.state = s;
    if (all || document.activeElement !== input) input.value = row.get(s);
    say(input.value);
  };
  return [input, shown];
}

const MADE = { number: field, text: field, choice: selection, check: box, range: slider };

export function element(row, help = {}) {
  if (row.kind === "hint") return hint(row);
  const label = document.createElement("label"), name = document.createElement("span");
  label.className = "row";
  name.textContent = row.label;
  const tell = made => {
    try { send(made()); } catch (e) { fail(e.message); row.update(row.state, true); }
  };
  const [input, ...more] = MADE[row.kind](row, tell);
  input.name = row.label;
  if (help[row.label]) name.dataset.help = input.dataset.help = help[row.label];
  label.append(name, input, ...more);
  if (row.unit && row.kind !== "range") {
    label.append(Object.assign(document.createElement("em"), { textContent: row.unit }));
  }
  return label;
}

// Rows in a part of the page, which are made again when their shape changes. With `all`, rows that
// have the focus are written too: what was refused goes back.
export function shower(host, help, shapeOf, rowsOf) {
  let built = "", rows = [];
  return (state, all = false) => {
    const shape = JSON.stringify(shapeOf(state)), fresh = shape !== built;
    if (fresh) {
      built = shape;
      rows = rowsOf(state);
      const focused = document.activeElement?.name;
      const inside = host.contains(document.activeElement);
      host.replaceChildren(...rows.map(r => element(r, help)));
      // A row that changes the shape keeps the keyboard.
      if (inside && focused) host.querySelector(`[name="${CSS.escape(focused)}"]`)?.focus();
    }
    for (const row of rows) row.update(state, all || fresh);
  };
}
