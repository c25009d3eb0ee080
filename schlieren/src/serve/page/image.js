// The image: shows frames, orbits, paints, and shows the deflection under the pointer.

import { quantity, round125 } from "./units.js";

const canvas = document.getElementById("image"), stage = document.getElementById("stage");
const context = canvas.getContext("2d");
const scale = document.getElementById("scale"), here = document.getElementById("here");

export function show(frame, wanted) {
  const { width, height } = frame.info;
  // The canvas keeps the final image's size, so that the layout does not jump while coarse images arrive.
  const [w, h] = wanted || [width, height];
  if (canvas.width !== w || canvas.height !== h) { canvas.width = w; canvas.height = h; }
  const image = new ImageData(width, height);
  for (let i = 0, j = 0; i < frame.rgb.length; i += 3, j += 4) {
    image.data[j] = frame.rgb[i]; image.data[j + 1] = frame.rgb[i + 1]; image.data[j + 2] = frame.rgb[i + 2]; image.data[j + 3] = 255;
  }
  if (width === w && height === h) context.putImageData(image, 0, 0);
  else {
    const small = new OffscreenCanvas(width, height);
    small.getContext("2d").putImageData(image, 0, 0);
    context.imageSmoothingEnabled = true;
    context.drawImage(small, 0, 0, w, h);
  }
  showScale(frame.info);
}

function showScale(info) {
  const box = canvas.getBoundingClientRect();
  if (!info.width || !box.width) return;
  const metres = info.pixel_m * info.width, bar = round125(metres / 4);
  scale.firstElementChild.textContent = quantity(bar, "m");
  scale.lastElementChild.style.width = `${bar / metres * box.width}px`;
  scale.style.left = `${box.left - stage.getBoundingClientRect().left + 12}px`;
}

const place = e => {
  const box = canvas.getBoundingClientRect();
  const clamp = v => Math.min(1, Math.max(0, v));
  return [clamp((e.clientX - box.left) / box.width), clamp((e.clientY - box.top) / box.height)];
};

// `actions`: angles() and orbit(azimuth, elevation); paints() and paint(points); trace(at) for the deflection; mark(point on the filter or null).
export function interact(actions) {
  let drag = null, points = [], tracing = false, next = null;

  canvas.addEventListener("pointerdown", e => {
    if (e.button !== 0) return;
    canvas.setPointerCapture(e.pointerId);
    drag = { x: e.clientX, y: e.clientY, angles: actions.angles(), paints: actions.paints() };
    points = drag.paints ? [place(e)] : [];
    canvas.focus();
    e.preventDefault();
  });
  canvas.addEventListener("pointermove", e => {
    if (!drag) { read(place(e)); return; }
    if (drag.paints) {
      for (const c of e.getCoalescedEvents?.().length ? e.getCoalescedEvents() : [e]) points.push(place(c));
      if (points.length > 12) flush(true);
      return;
    }
    // Dragging across the whole image is half a turn. The side near the camera follows the pointer.
    const turn = 180 / canvas.getBoundingClientRect().width;
    actions.orbit(drag.angles[0] - (e.clientX - drag.x) * turn, drag.angles[1] + (e.clientY - drag.y) * turn);
  });
  const end = () => { if (drag?.paints) flush(false); drag = null; };
  canvas.addEventListener("pointerup", end);
  canvas.addEventListener("pointercancel", end);
  canvas.addEventListener("pointerleave", () => { here.textContent = ""; actions.mark(null); });
  canvas.addEventListener("keydown", e => {
    const step = { ArrowLeft: [5, 0], ArrowRight: [-5, 0], ArrowUp: [0, -5], ArrowDown: [0, 5] }[e.key];
    if (!step) return;
    e.preventDefault();
    const [a, b] = actions.angles();
    actions.orbit(a + step[0], b + step[1]);
  });

  // Fills the gaps between pointer events pixel by pixel, because every pixel has its own point on the filter.
  function flush(goesOn) {
    const all = [];
    for (let i = 0; i < points.length; i++) {
      const [a, b] = [points[Math.max(0, i - 1)], points[i]];
      const steps = Math.max(1, Math.ceil(Math.hypot((b[0] - a[0]) * canvas.width, (b[1] - a[1]) * canvas.height)));
      for (let s = 1; s <= steps; s++) all.push([a[0] + (b[0] - a[0]) * s / steps, a[1] + (b[1] - a[1]) * s / steps]);
    }
    points = goesOn ? [points[points.length - 1]] : [];
    for (let i = 0; i < all.length; i += 2000) actions.paint(all.slice(i, i + 2000));
  }

  async function read(at) {
    next = at;
    if (tracing) return;
    tracing = true;
    while (next) {
      const now = next;
      next = null;
      try {
        const t = await actions.trace(now);
        if (t.dark) { here.textContent = "no light"; actions.mark(null); continue; }
        const [x, y] = t.deflection_rad;
        here.textContent = `deflected ${quantity(x, "rad")} right, ${quantity(y, "rad")} up`;
        actions.mark(t.filter_m);
      } catch { here.textContent = ""; }
    }
    tracing = false;
  }
}

export const setPainting = on => canvas.classList.toggle("painting", on);
