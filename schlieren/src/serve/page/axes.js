// Names and numbers of the axes around the image, the directions of the flow's axes in it, and the
// line of a profile.

import { round125 } from "./units.js";

const canvas = document.getElementById("axes"), context = canvas.getContext("2d");
const stage = document.getElementById("stage"), image = document.getElementById("image");
const UNITS = [[1, "m"], [1e-3, "mm"], [1e-6, "µm"], [1e-9, "nm"]];
const NAMES = ["x", "y", "z"];
let info = null, line = null;

const dot = (a, b) => a[0] * b[0] + a[1] * b[1] + a[2] * b[2];

// The name of an axis of the flow that a direction of the image is along, or null.
const along = direction => {
  const i = direction.findIndex(c => Math.abs(c - 1) < 1e-9);
  return i < 0 ? null : NAMES[i];
};

// Width and height of the image, and where it begins: in the flow's coordinates where the image's
// axes are the flow's, else from the middle of the flow.
export function extent(i = info) {
  const [right, up] = i.axes, named = along(right) && along(up);
  const size = [i.pixel_m * i.width, i.pixel_m * i.height];
  const middle = named
    ? [dot(i.flow_center_m, right) + i.center_m[0], dot(i.flow_center_m, up) + i.center_m[1]]
    : i.center_m;
  const low = [middle[0] - size[0] / 2, middle[1] - size[1] / 2];
  return { size, low, names: named ? [along(right), along(up)] : ["right", "up"] };
}

// A point of the image (0 to 1 from its upper left corner) in words.
export function place(at) {
  if (!info?.width) return "";
  const { size, low, names } = extent();
  const [factor, unit] = unitOf(Math.max(...size));
  const value = [low[0] + at[0] * size[0], low[1] + (1 - at[1]) * size[1]];
  const shown = value.map(v => (v / factor).toFixed(2));
  return `${names[0]} ${shown[0]}, ${names[1]} ${shown[1]} ${unit}`;
}

const unitOf = span => UNITS.find(u => span >= 2 * u[0]) ?? UNITS[UNITS.length - 1];

export function show(next) { info = next; draw(); }
export function showLine(next) { line = next; draw(); }

function draw() {
  if (!info?.width) return;
  const box = canvas.getBoundingClientRect(), inner = image.getBoundingClientRect();
  const ratio = window.devicePixelRatio || 1;
  canvas.width = Math.round(box.width * ratio);
  canvas.height = Math.round(box.height * ratio);
  context.setTransform(ratio, 0, 0, ratio, 0, 0);
  context.font = "12px system-ui, sans-serif";
  const [x, y] = [inner.left - box.left, inner.top - box.top];
  const frame = { x, y, width: inner.width, height: inner.height };
  ticks(frame);
  triad(frame);
  if (line) profile(frame);
}

function ticks({ x, y, width, height }) {
  const { size, low, names } = extent();
  const [factor, unit] = unitOf(Math.max(...size));
  const pixels = [width, height];
  context.fillStyle = "#9aa2b0";
  context.strokeStyle = "#9aa2b0";
  context.lineWidth = 1;
  for (const axis of [0, 1]) {
    // Numbers need room: about 70 pixels each beside the other, 30 above the other.
    const most = Math.max(2, Math.min(8, Math.floor(pixels[axis] / (axis ? 30 : 70))));
    let step = round125(size[axis] / most);
    while (size[axis] / step > most) step = next125(step);
    const decimals = Math.max(0, -Math.floor(Math.log10(step / factor) + 1e-9));
    const first = Math.ceil(low[axis] / step - 1e-9);
    context.textAlign = axis ? "right" : "center";
    context.textBaseline = axis ? "middle" : "top";
    for (let n = first; n * step <= low[axis] + size[axis] * (1 + 1e-9); n++) {
      const part = (n * step - low[axis]) / size[axis];
      // "-0" is written by toFixed where rounding left a rest.
      const text = (n === 0 ? 0 : n * step / factor).toFixed(decimals);
      const [a, b] = axis ? [x, y + height * (1 - part)] : [x + width * part, y + height];
      context.beginPath();
      context.moveTo(a, b);
      context.lineTo(axis ? a - 5 : a, axis ? b : b + 5);
      context.stroke();
      context.fillText(text, axis ? a - 8 : a, axis ? b : b + 7);
    }
  }
  context.fillStyle = "#e4e6ea";
  context.textAlign = "right";
  context.textBaseline = "top";
  context.fillText(`${names[0]} / ${unit} →`, x + width, y + height + 22);
  context.save();
  context.translate(x - 48, y);
  context.rotate(-Math.PI / 2);
  context.textBaseline = "middle";
  context.fillText(`${names[1]} / ${unit} →`, 0, 0);
  context.restore();
}

function next125(step) {
  const digit = Math.round(step / 10 ** Math.floor(Math.log10(step) + 1e-9));
  return step * (digit === 2 ? 2.5 : 2);
}

// The flow's axes as they are seen, in the upper right corner.
function triad({ x, y, width }) {
  const [right, up, forward] = info.axes, at = [x + width - 34, y + 34], long = 20;
  context.textAlign = "center";
  context.textBaseline = "middle";
  for (let i = 0; i < 3; i++) {
    const [dx, dy] = [right[i] * long, -up[i] * long], size = Math.hypot(dx, dy);
    const end = [at[0] + dx, at[1] + dy];
    for (const [style, wide] of [["#000", 4], [["#ff7b72", "#7ee787", "#79c0ff"][i], 1.6]]) {
      context.strokeStyle = context.fillStyle = style;
      context.lineWidth = wide;
      context.beginPath();
      if (size > 3) { context.moveTo(...at); context.lineTo(...end); }
      // Seen from ahead: towards the viewer with a dot, away from it with a cross.
      else {
        context.arc(...at, 5, 0, 7);
        const d = 3.5;
        if (forward[i] < 0) {
          context.moveTo(at[0] - d, at[1] - d); context.lineTo(at[0] + d, at[1] + d);
          context.moveTo(at[0] + d, at[1] - d); context.lineTo(at[0] - d, at[1] + d);
        } else { context.moveTo(at[0] + 1, at[1]); context.arc(...at, 1, 0, 7); }
      }
      context.stroke();
      const away = size > 3 ? [dx / size * (size + 9), dy / size * (size + 9)] : [-11, 11];
      const label = [at[0] + away[0], at[1] + away[1]];
      if (wide > 2) context.strokeText(NAMES[i], ...label);
      else context.fillText(NAMES[i], ...label);
    }
  }
}

function profile({ x, y, width, height }) {
  const [a, b] = [line.from, line.to].map(p => [x + p[0] * width, y + p[1] * height]);
  for (const [style, wide] of [["#000", 3], ["#39f", 1.5]]) {
    context.strokeStyle = style;
    context.lineWidth = wide;
    context.beginPath();
    context.moveTo(...a);
    context.lineTo(...b);
    context.stroke();
    for (const [p, r] of [[a, 3], [[0, 1].map(c => a[c] + line.at * (b[c] - a[c])), 5]]) {
      if (!Number.isFinite(p[0])) continue;
      context.beginPath();
      context.arc(...p, r, 0, 7);
      context.stroke();
    }
  }
}

new ResizeObserver(draw).observe(stage);
