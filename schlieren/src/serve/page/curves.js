// Editor of transfer functions (section 5.7): for each array of the flow, a curve from its value to n - 1.

import { quantity, short } from "./units.js";

const box = document.getElementById("curves-box"), host = document.getElementById("curves");
let names = "", curves = {}, amplitude = 1e-4, rule = "sum", send = () => {}, cards = {}, own = false;

export function listen(change) { send = change; }

export function show(state) {
  box.hidden = state.arrays.length < 2;
  if (box.hidden) return;
  const given = state.scene.flow.multifield;
  const key = state.arrays.map(a => a.name).join();
  if (key !== names) {
    names = key;
    for (const a of state.arrays) curves[a.name] = { weight: 0, knots: [[a.range[0], 0], [a.range[1], -amplitude]] };
    build(state);
  }
  if (given && !own) {
    for (const a of state.arrays) if (curves[a.name]) curves[a.name].weight = 0;
    for (const [name, c] of Object.entries(given.fields)) curves[name] = structuredClone(c);
    for (const c of Object.values(given.fields)) for (const k of c.knots) amplitude = Math.max(amplitude, Math.abs(k[1]));
    rule = given.rule;
  }
  own = false;
  host.querySelector("#use").checked = !!given;
  host.querySelector("#rule").value = rule;
  for (const a of state.arrays) cards[a.name].draw(!!given);
}

function tell() {
  if (!host.querySelector("#use").checked) return;
  own = true;
  const fields = {};
  for (const [name, c] of Object.entries(curves)) if (c.weight !== 0) fields[name] = c;
  if (Object.keys(fields).length) send({ flow: { multifield: { rule, fields } } });
}

function build(state) {
  host.replaceChildren();
  const head = document.createElement("div");
  head.innerHTML = `<label class="row"><span>use these curves</span><input type="checkbox" id="use"></label>
    <label class="row"><span>contributions</span><select id="rule"><option value="sum">add up</option><option value="largest">largest wins</option></select></label>
    <label class="row"><span>full scale n − 1</span><input type="number" id="amplitude" step="any"></label>
    <p class="hint">Each array makes its own n − 1: illustration, not the physics of the gas. Drag knots; click to add one, double-click to remove it.</p>`;
  host.append(head);
  const use = head.querySelector("#use"), scale = head.querySelector("#amplitude");
  scale.value = amplitude;
  use.addEventListener("change", () => {
    if (!use.checked) { own = true; send({ flow: { multifield: null } }); return; }
    if (Object.values(curves).every(c => c.weight === 0)) curves[state.arrays[0].name].weight = 1;
    tell();
  });
  head.querySelector("#rule").addEventListener("change", e => { rule = e.target.value; tell(); });
  scale.addEventListener("change", () => {
    const next = Number(scale.value);
    if (!(next > 0)) { scale.value = amplitude; return; }
    for (const c of Object.values(curves)) for (const k of c.knots) k[1] *= next / amplitude;
    amplitude = next;
    tell();
    Object.values(cards).forEach(c => c.draw(use.checked));
  });
  for (const a of state.arrays) host.append(card(a));
}

function card(array) {
  const div = document.createElement("div"), [low, high] = array.range;
  div.className = "curve";
  const row = document.createElement("label"), name = document.createElement("span"), weight = document.createElement("input"), says = document.createElement("b");
  row.className = "row";
  name.textContent = array.name;
  Object.assign(weight, { type: "range", min: 0, max: 2, step: 0.05 });
  weight.name = `weight ${array.name}`;
  row.append(name, weight, says);
  const canvas = document.createElement("canvas"), c = canvas.getContext("2d");
  canvas.width = 340; canvas.height = 90;
  canvas.setAttribute("aria-label", `n - 1 by ${array.name}`);
  const ends = document.createElement("small");
  ends.innerHTML = "<span></span><span></span><span></span>";
  ends.children[0].textContent = short(low);
  ends.children[2].textContent = short(high);
  div.append(row, canvas, ends);

  const mine = () => curves[array.name];
  const pad = 8, X = v => pad + (v - low) / (high - low) * (canvas.width - 2 * pad), Y = n => canvas.height / 2 - n / amplitude * (canvas.height / 2 - pad);
  const draw = used => {
    weight.value = mine().weight;
    says.textContent = mine().weight ? `× ${short(mine().weight)}` : "off";
    c.clearRect(0, 0, canvas.width, canvas.height);
    c.strokeStyle = "#444"; c.lineWidth = 1;
    c.beginPath(); c.moveTo(0, Y(0)); c.lineTo(canvas.width, Y(0)); c.stroke();
    c.strokeStyle = c.fillStyle = used && mine().weight ? "#ffb454" : "#777";
    c.lineWidth = 2;
    const k = mine().knots;
    c.beginPath(); c.moveTo(0, Y(k[0][1]));
    for (const [v, n] of k) c.lineTo(X(v), Y(n));
    c.lineTo(canvas.width, Y(k[k.length - 1][1])); c.stroke();
    for (const [v, n] of k) { c.beginPath(); c.arc(X(v), Y(n), 4, 0, 7); c.fill(); }
  };
  cards[array.name] = { draw };
  weight.addEventListener("input", () => { mine().weight = Number(weight.value); draw(true); tell(); });

  let held = -1;
  const at = e => {
    const b = canvas.getBoundingClientRect();
    const x = (e.clientX - b.left) / b.width * canvas.width, y = (e.clientY - b.top) / b.height * canvas.height;
    const v = low + (x - pad) / (canvas.width - 2 * pad) * (high - low), n = (canvas.height / 2 - y) / (canvas.height / 2 - pad) * amplitude;
    return { x, y, v: Math.min(high, Math.max(low, v)), n: Math.min(amplitude, Math.max(-amplitude, n)) };
  };
  const near = p => mine().knots.findIndex(k => Math.hypot(X(k[0]) - p.x, Y(k[1]) - p.y) < 9);
  const say = k => { ends.children[1].textContent = k ? `${short(k[0])} → n − 1 = ${quantity(k[1], "")}` : ""; };
  canvas.addEventListener("pointerdown", e => {
    const p = at(e), k = mine().knots;
    canvas.setPointerCapture(e.pointerId);
    held = near(p);
    if (held < 0) {
      held = k.findIndex(q => q[0] > p.v);
      if (held < 0) held = k.length;
      k.splice(held, 0, [p.v, p.n]);
      if (mine().weight === 0) mine().weight = 1;
    }
    draw(true);
  });
  canvas.addEventListener("pointermove", e => {
    if (held < 0) return;
    const p = at(e), k = mine().knots, gap = (high - low) * 1e-4;
    const left = held > 0 ? k[held - 1][0] + gap : low, right = held + 1 < k.length ? k[held + 1][0] - gap : high;
    k[held] = [Math.min(right, Math.max(left, p.v)), p.n];
    say(k[held]);
    draw(true);
  });
  canvas.addEventListener("pointerup", () => { if (held >= 0) { held = -1; say(null); tell(); } });
  canvas.addEventListener("dblclick", e => {
    const i = near(at(e));
    if (i >= 0 && mine().knots.length > 1) { mine().knots.splice(i, 1); draw(true); tell(); }
  });
  return div;
}
