// Stacked areas over the last minute.

import { element } from "./controls.js";

const colors = ["#5aa9e6", "#ffb454", "#7fc97f", "#d98cb3", "#b39ddb", "#e57373", "#80cbc4", "#c5e1a5", "#f0e68c", "#bcaaa4"];
const number = v => v >= 1e6 ? (v / 1e6).toPrecision(3) + " M" : v >= 1e4 ? (v / 1e3).toPrecision(3) + " k" : v >= 100 ? v.toFixed(0) : v.toPrecision(2);

// A number that people like, not below `v`.
function ceiling(v) {
  if (!(v > 0)) return 1;
  const power = 10 ** Math.floor(Math.log10(v));
  return [1, 2, 5, 10].map(m => m * power).find(c => c >= v * 0.999);
}

// `parts(frame)` gives an object of numbers to stack, `whole(frame)` a line over them or nothing.
export class Chart {
  constructor(id, unit, parts, whole) {
    this.canvas = document.getElementById(id);
    this.legend = document.getElementById(`${id}-legend`);
    this.parts = parts;
    this.whole = whole;
    this.unit = unit;
  }

  draw(frames, room) {
    const kinds = [...new Set(frames.flatMap(f => Object.keys(this.parts(f))))].sort();
    const scale = window.devicePixelRatio || 1, box = this.canvas.getBoundingClientRect();
    const w = this.canvas.width = Math.max(50, Math.round(box.width * scale)), h = this.canvas.height;
    const c = this.canvas.getContext("2d");
    c.clearRect(0, 0, w, h);
    const sums = frames.map(f => kinds.reduce((s, k) => s + (this.parts(f)[k] || 0), 0));
    const lines = this.whole ? frames.map(this.whole) : [];
    // One slow frame must not flatten all others: the highest of all but a fiftieth.
    const sorted = [...sums, ...lines].sort((a, b) => a - b);
    const top = ceiling(sorted[Math.floor(0.98 * (sorted.length - 1))] || 0);
    const x = i => (w - 1) * (room - frames.length + i) / Math.max(1, room - 1), y = v => h - 1 - (h - 14) * Math.min(1.05, v / top);
    c.font = `${11 * scale}px system-ui`;
    c.fillStyle = "#9aa2b0";
    c.strokeStyle = "#2c313a";
    for (const part of [0.5, 1]) {
      c.beginPath(); c.moveTo(0, y(part * top)); c.lineTo(w, y(part * top)); c.stroke();
      c.fillText(`${number(part * top)} ${this.unit}`, 4, y(part * top) + 11 * scale);
    }
    const below = frames.map(() => 0);
    kinds.forEach((kind, k) => {
      const above = frames.map((f, i) => below[i] + (this.parts(f)[kind] || 0));
      c.beginPath();
      above.forEach((v, i) => i ? c.lineTo(x(i), y(v)) : c.moveTo(x(i), y(v)));
      for (let i = frames.length - 1; i >= 0; i--) c.lineTo(x(i), y(below[i]));
      c.fillStyle = colors[k % colors.length] + "b0";
      c.fill();
      above.forEach((v, i) => { below[i] = v; });
    });
    if (lines.length) {
      c.beginPath();
      lines.forEach((v, i) => i ? c.lineTo(x(i), y(v)) : c.moveTo(x(i), y(v)));
      c.strokeStyle = "#fff"; c.lineWidth = 1.5; c.stroke();
    }
    const last = frames.at(-1);
    this.legend.replaceChildren(...kinds.map((kind, k) => {
      const swatch = element("i");
      swatch.style.background = colors[k % colors.length];
      return element("li", {}, [swatch, kind, element("b", { textContent: number(this.parts(last)[kind] || 0) })]);
    }), ...(lines.length ? [element("li", {}, [element("span", { textContent: "— whole frame" }), element("b", { textContent: number(lines.at(-1)) })])] : []));
    this.canvas.dataset.frames = frames.length;
  }
}

export { number };
