// The profile: a quantity along a line on the image, with a cursor that reads it out.

import * as axes from "./axes.js";
import * as server from "./server.js";
import { quantity, round125 } from "./units.js";
import { keep } from "./save.js";

const $ = id => document.getElementById(id);
const box = $("profile-box"), canvas = $("profile"), context = canvas.getContext("2d");
const QUANTITIES = {
  right: { name: "deflection, right", unit: "rad", of: p => p.deflection && p.deflection[0] },
  up: { name: "deflection, up", unit: "rad", of: p => p.deflection && p.deflection[1] },
  size: { name: "deflection", unit: "rad", of: p => p.deflection && Math.hypot(...p.deflection) },
  light: { name: "brightness", unit: "of white", of: p => p.light },
  // Only where fringes or dots are shown.
  phase: { name: "phase", unit: "waves", of: p => p.waves, needs: "waves" },
  dots_right: { name: "dots, right", unit: "m", of: p => p.dots && p.dots[0], needs: "dots_m" },
  dots_up: { name: "dots, up", unit: "m", of: p => p.dots && p.dots[1], needs: "dots_m" },
  dots: { name: "dots", unit: "m", of: p => p.dots && Math.hypot(...p.dots), needs: "dots_m" },
};
// A number on an axis, or more exactly below the plot.
const FORMATS = {
  "of white": (v, digits) => `${Number((100 * v).toPrecision(digits))} %`,
  waves: (v, digits) => `${Number(v.toPrecision(digits))} λ`,
};
const format = (v, unit, digits = 3) => FORMATS[unit]?.(v, digits) ?? quantity(v, unit, digits);
const AFTER = { "of white": " of white" };
let line = { from: [0, 0.5], to: [1, 0.5] }, cursor = 0.5;
let points = [], length_m = 0, frame = null, active = false, asking = false, again = false;
// Whether vectors are drawn over the image's brightness.
let covered = false;
let report = () => {};

export function listen(error) { report = error; }

export function setActive(on) {
  active = on;
  box.hidden = !on;
  axes.showLine(on ? { ...line, at: cursor } : null);
  if (on) ask();
}

export function showFrame(next, vectors) {
  // Drafts have coarse deflections, and would make the curve jump.
  if (next.info.draft || !next.info.width) return;
  frame = next;
  covered = Boolean(vectors);
  if (active) ask();
}

export function setLine(from, to) {
  if (from[0] === to[0] && from[1] === to[1]) return;
  line = { from, to };
  axes.showLine({ ...line, at: cursor });
  ask();
}

// Moves the line by parts of the image, as far as it stays inside.
export function move(dx, dy) {
  const inside = (c, d) => Math.min(1 - Math.max(line.from[c], line.to[c]),
    Math.max(-Math.min(line.from[c], line.to[c]), d));
  const by = [inside(0, dx), inside(1, dy)];
  setLine([0, 1].map(c => line.from[c] + by[c]), [0, 1].map(c => line.to[c] + by[c]));
}

// Linear brightness at a point, of the channel that the eye weighs most.
function light(at) {
  if (!frame || covered) return null;
  const { width, height } = frame.info;
  const [x, y] = [Math.min(width - 1, Math.floor(at[0] * width)),
    Math.min(height - 1, Math.floor(at[1] * height))];
  const v = frame.rgb[3 * (y * width + x) + 1] / 255;
  return v <= 0.04045 ? v / 12.92 : ((v + 0.055) / 1.055) ** 2.4;
}

async function ask() {
  if (asking) { again = true; return; }
  asking = true;
  do {
    again = false;
    const { from, to } = line;
    try {
      const answer = await server.profile(from, to);
      length_m = answer.length_m;
      const n = answer.deflection_rad.length - 1;
      points = answer.deflection_rad.map((deflection, i) => {
        const part = i / n, at = [0, 1].map(c => from[c] + part * (to[c] - from[c]));
        const waves = answer.waves[i] ?? null, dots = answer.dots_m[i] ?? null;
        return { part, at, deflection, waves, dots, light: light(at) };
      });
      offer(key => !QUANTITIES[key].needs || answer[QUANTITIES[key].needs].length > 0);
      draw();
    } catch (e) { report(e.message); }
  } while (again);
  asking = false;
}

// Offers the quantities that the image has.
function offer(has) {
  const select = $("quantity"), keys = Object.keys(QUANTITIES).filter(has);
  if ([...select.options].map(o => o.value).join() === keys.join()) return;
  const before = select.value;
  select.replaceChildren(...keys.map(key => new Option(QUANTITIES[key].name, key)));
  if (keys.includes(before)) select.value = before;
}

const chosen = () => QUANTITIES[$("quantity").value];
const PAD = { left: 62, right: 30, top: 10, bottom: 24 };
const inner = () => [canvas.width - PAD.left - PAD.right, canvas.height - PAD.top - PAD.bottom];

function draw() {
  const { of, unit } = chosen(), [width, height] = inner();
  const values = points.map(of), known = values.filter(v => v !== null);
  let [low, high] = [Math.min(0, ...known), Math.max(0, ...known)];
  if (high - low < 1e-15) [low, high] = [low - 1e-9, high + 1e-9];
  const X = part => PAD.left + part * width, Y = v => PAD.top + (high - v) / (high - low) * height;
  context.clearRect(0, 0, canvas.width, canvas.height);
  context.font = "12px system-ui, sans-serif";
  context.fillStyle = "#9aa2b0";
  context.strokeStyle = "#383d47";
  context.lineWidth = 1;
  context.textAlign = "right";
  context.textBaseline = "middle";
  const step = round125((high - low) / 3);
  for (let n = Math.ceil(low / step); n * step <= high; n++) {
    rule([PAD.left, Y(n * step)], [PAD.left + width, Y(n * step)]);
    context.fillText(format(n * step, unit), PAD.left - 4, Y(n * step));
  }
  context.textAlign = "center";
  context.textBaseline = "top";
  const along = round125(length_m / 4);
  for (let n = 0; n * along <= length_m; n++) {
    const x = X(n * along / length_m);
    rule([x, PAD.top], [x, PAD.top + height]);
    context.fillText(quantity(n * along, "m"), x, PAD.top + height + 6);
  }
  context.strokeStyle = "#ffb454";
  context.lineWidth = 1.5;
  context.beginPath();
  let gap = true;
  points.forEach((p, i) => {
    // A curve ends where no light lands.
    if (values[i] === null) { gap = true; return; }
    if (gap) context.moveTo(X(p.part), Y(values[i])); else context.lineTo(X(p.part), Y(values[i]));
    gap = false;
  });
  context.stroke();
  context.strokeStyle = "#39f";
  rule([X(cursor), PAD.top], [X(cursor), PAD.top + height]);
  read();
}

function rule(a, b) {
  context.beginPath();
  context.moveTo(...a);
  context.lineTo(...b);
  context.stroke();
}

function read() {
  const p = points[Math.round(cursor * (points.length - 1))];
  if (!p) return;
  const { name, of, unit } = chosen(), value = of(p);
  if (covered && unit === "of white") {
    $("profile-here").textContent = "the vectors cover the brightness; choose “vectors” none";
    return;
  }
  const shown = value === null ? "no light" : format(value, unit, 4) + (AFTER[unit] ?? "");
  $("profile-here").textContent =
    `${name} ${shown} at ${quantity(p.part * length_m, "m", 4)} (${axes.place(p.at)})`;
}

function setCursor(part) {
  cursor = Math.min(1, Math.max(0, part));
  axes.showLine({ ...line, at: cursor });
  draw();
}

canvas.addEventListener("pointermove", e => {
  const b = canvas.getBoundingClientRect(), x = (e.clientX - b.left) / b.width * canvas.width;
  setCursor((x - PAD.left) / inner()[0]);
});
canvas.addEventListener("keydown", e => {
  const step = { ArrowLeft: -1, ArrowRight: 1, PageDown: -20, PageUp: 20 }[e.key];
  if (!step) return;
  e.preventDefault();
  setCursor(cursor + step / Math.max(1, points.length - 1));
});
offer(key => !QUANTITIES[key].needs);
$("quantity").addEventListener("change", draw);
$("profile-csv").addEventListener("click", () => {
  const rows = points.map(p => [p.part * length_m, ...(p.deflection ?? ["", ""]), p.light ?? "",
    p.waves ?? "", ...(p.dots ?? ["", ""])]);
  const head = "distance_m,deflection_right_rad,deflection_up_rad,brightness,phase_waves,"
    + "dots_right_m,dots_up_m";
  const text = [head, ...rows.map(r => r.join()), ""].join("\n");
  const blob = new Blob([text], { type: "text/csv" });
  keep({ name: "schlieren-profile.csv", blob });
});
