// The filter plane: shows its transmission and the light on it, and lets the user paint on it.

import { quantity, percent, round125 } from "./units.js";

const canvas = document.getElementById("filter"), context = canvas.getContext("2d");
const facts = document.getElementById("filter-facts"), showLight = document.getElementById("show-light");
let last = null, mark = null, hover = null, brush = null;

export function show(frame) {
  if (!frame.info.filter_pixels) return;
  last = frame;
  draw();
}

export function point(at) { mark = at; draw(); }
export const half = () => last ? last.info.filter_half_m : 0;

const toCanvas = m => [(m[0] / half() + 1) * 0.5 * canvas.width, (1 - m[1] / half()) * 0.5 * canvas.height];

function draw() {
  if (!last) return;
  const { info, filter, light } = last, n = info.filter_pixels;
  const image = new ImageData(n, n);
  // Logarithmic over 4 decades, because light is much denser where the flow does not bend it.
  const most = light.reduce((m, v) => Math.max(m, v), 0);
  for (let i = 0; i < n * n; i++) {
    const glow = showLight.checked && light[i] > 0 ? Math.max(0, 1 + Math.log10(light[i] / most) / 4) : 0;
    // The transmission is dimmed, so that light (yellow) stands out on white as well as on black.
    for (let c = 0; c < 3; c++) {
      const ground = filter[3 * i + c] * (showLight.checked ? 0.62 : 1) + (showLight.checked ? 14 : 0);
      image.data[4 * i + c] = ground * (1 - 0.65 * glow) + [255, 190, 40][c] * 0.65 * glow;
    }
    image.data[4 * i + 3] = 255;
  }
  const small = new OffscreenCanvas(n, n);
  small.getContext("2d").putImageData(image, 0, 0);
  context.imageSmoothingEnabled = false;
  context.drawImage(small, 0, 0, canvas.width, canvas.height);

  // Axes, a bar with its length, and the point to which the pointer's pixel is traced.
  context.lineWidth = 1;
  context.strokeStyle = "rgba(128,150,190,0.6)";
  context.beginPath();
  context.moveTo(canvas.width / 2, 0); context.lineTo(canvas.width / 2, canvas.height);
  context.moveTo(0, canvas.height / 2); context.lineTo(canvas.width, canvas.height / 2);
  context.stroke();
  const bar = round125(half() / 2), long = bar / half() * canvas.width / 2;
  context.fillStyle = "#fff"; context.strokeStyle = "#000"; context.lineWidth = 3;
  context.font = "12px system-ui, sans-serif";
  const label = `${quantity(bar, "m")} = ${quantity(bar / info.focal_length_m, "rad")}`;
  context.strokeText(label, 10, canvas.height - 14); context.fillText(label, 10, canvas.height - 14);
  context.fillRect(10, canvas.height - 9, long, 3);
  if (mark) ring(mark, 5 / canvas.width * 2 * half(), "#39f");
  if (hover && brush) ring(hover, brush(), "#39f");
  const shown = 100 * (1 - info.light_outside);
  facts.textContent = `±${quantity(half(), "m")} around the axis, f₂ = ${quantity(info.focal_length_m, "m")}; ${Number(shown.toPrecision(4))} % of the light is shown`;
}

function ring(at, radius, color) {
  const [x, y] = toCanvas(at), r = Math.max(2, radius / half() * canvas.width / 2);
  for (const [width, style] of [[3, "#000"], [1.5, color]]) {
    context.lineWidth = width; context.strokeStyle = style;
    context.beginPath(); context.arc(x, y, r, 0, 2 * Math.PI); context.stroke();
  }
}

// `actions`: paints() returns whether the filter can be painted on; radius() in m; paint(points in m).
export function interact(actions) {
  brush = () => actions.paints() ? actions.radius() : 0;
  let points = null;
  const place = e => {
    const box = canvas.getBoundingClientRect();
    return [((e.clientX - box.left) / box.width * 2 - 1) * half(), (1 - (e.clientY - box.top) / box.height * 2) * half()];
  };
  canvas.addEventListener("pointerdown", e => {
    if (e.button !== 0 || !actions.paints()) return;
    canvas.setPointerCapture(e.pointerId);
    points = [place(e)];
    e.preventDefault();
  });
  canvas.addEventListener("pointermove", e => {
    hover = actions.paints() ? place(e) : null;
    draw();
    if (!points) return;
    points.push(place(e));
    if (points.length > 8) { actions.paint(points); points = [points[points.length - 1]]; }
  });
  const end = () => { if (points) actions.paint(points); points = null; };
  canvas.addEventListener("pointerup", end);
  canvas.addEventListener("pointercancel", end);
  canvas.addEventListener("pointerleave", () => { hover = null; draw(); });
  showLight.addEventListener("change", draw);
}

export const lock = locked => canvas.classList.toggle("locked", locked);
export { percent };
