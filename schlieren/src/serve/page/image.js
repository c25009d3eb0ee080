// The image: shows frames, orbits, zooms, paints, and shows the deflection under the pointer.

import { place as placeInWords } from "./axes.js";
import { quantity, round125 } from "./units.js";

const canvas = document.getElementById("image"), stage = document.getElementById("stage");
const context = canvas.getContext("2d");
const scale = document.getElementById("scale"), here = document.getElementById("here");

let again = () => {};

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
  if (!frame.info.draft) again();
}

function showScale(info) {
  const box = canvas.getBoundingClientRect();
  if (!info.width || !box.width) return;
  const metres = info.pixel_m * info.width, bar = round125(metres / 4);
  scale.firstElementChild.textContent = quantity(bar, "m");
  scale.lastElementChild.style.width = `${bar / metres * box.width}px`;
  // Lower right: vectors have their own scale on the left.
  scale.style.right = `${stage.getBoundingClientRect().right - box.right + 12}px`;
}

const place = e => {
  const box = canvas.getBoundingClientRect();
  const clamp = v => Math.min(1, Math.max(0, v));
  return [clamp((e.clientX - box.left) / box.width), clamp((e.clientY - box.top) / box.height)];
};

// `actions`: tool(), "orbit", "paint" or "profile"; angles(), orbit(azimuth, elevation) and
// turned() when an orbit ends; paint(points); line(from, to) and moveLine(dx, dy) of the profile;
// zoom(factor, point), pan() for a function of the way in parts of the image, and whole(); trace(at)
// for the deflection; mark(point on the filter, deflection), null without light.
export function interact(actions) {
  let drag = null, points = [], tracing = false, next = null, pointer = null;
  // Another image has other values under a pointer that rests.
  again = () => { if (pointer && !drag) read(pointer); };

  canvas.addEventListener("pointerdown", e => {
    const moves = e.button === 1 || (e.button === 0 && e.shiftKey);
    if (e.button !== 0 && !moves) return;
    canvas.setPointerCapture(e.pointerId);
    const tool = moves ? "pan" : actions.tool();
    const { clientX: x, clientY: y } = e;
    drag = { x, y, at: place(e), angles: actions.angles(), tool, moved: false };
    if (moves) drag.pan = actions.pan();
    points = tool === "paint" ? [place(e)] : [];
    canvas.focus();
    e.preventDefault();
  });
  canvas.addEventListener("pointermove", e => {
    pointer = place(e);
    if (!drag) { read(pointer); return; }
    drag.moved = true;
    const box = canvas.getBoundingClientRect();
    const [dx, dy] = [(e.clientX - drag.x) / box.width, (e.clientY - drag.y) / box.height];
    switch (drag.tool) {
      case "paint":
        points.push(...(e.getCoalescedEvents?.().length ? e.getCoalescedEvents() : [e]).map(place));
        if (points.length > 12) flush(true);
        return;
      case "profile": actions.line(drag.at, place(e)); return;
      case "pan": drag.pan(dx, dy); return;
      // Dragging across the whole image is half a turn. The side near the camera follows the
      // pointer.
      default: actions.orbit(drag.angles[0] - 180 * dx,
        drag.angles[1] + 180 * (e.clientY - drag.y) / box.width);
    }
  });
  const end = () => {
    if (drag?.tool === "paint") flush(false);
    if (drag?.tool === "orbit" && drag.moved) actions.turned();
    drag = null;
  };
  canvas.addEventListener("pointerup", end);
  canvas.addEventListener("pointercancel", end);
  canvas.addEventListener("pointerleave", () => {
    next = pointer = null;
    here.textContent = "";
    actions.mark(null, null);
  });
  canvas.addEventListener("wheel", e => {
    e.preventDefault();
    // Lines or pages, where the mouse does not count in pixels.
    const pixels = e.deltaY * [1, 16, 400][e.deltaMode];
    actions.zoom(Math.exp(0.0015 * Math.max(-400, Math.min(400, pixels))), place(e));
  }, { passive: false });
  canvas.addEventListener("keydown", e => {
    if (e.ctrlKey || e.altKey || e.metaKey) return;
    const factor = { "+": 1 / 1.25, "=": 1 / 1.25, "-": 1.25 }[e.key];
    const ways = { ArrowLeft: [1, 0], ArrowRight: [-1, 0], ArrowUp: [0, -1], ArrowDown: [0, 1] };
    const way = ways[e.key];
    if (!factor && !way && e.key !== "0") return;
    e.preventDefault();
    if (factor) actions.zoom(factor, [0.5, 0.5]);
    else if (!way) actions.whole();
    else if (e.shiftKey) actions.pan()(0.1 * way[0], -0.1 * way[1]);
    else if (actions.tool() === "profile") actions.moveLine(-0.01 * way[0], 0.01 * way[1]);
    else {
      const [a, b] = actions.angles();
      actions.orbit(a + 5 * way[0], b + 5 * way[1]);
      actions.turned();
    }
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
        const at = placeInWords(now);
        if (t.dark) { here.textContent = `${at}: no light`; actions.mark(null, null); continue; }
        const [x, y] = t.deflection_rad;
        here.textContent = `${at}: deflected ${quantity(x, "rad")} right, ${quantity(y, "rad")} up`;
        actions.mark(t.filter_m, t.deflection_rad);
      } catch { here.textContent = ""; }
    }
    tracing = false;
  }
}

export function setTool(tool) {
  canvas.classList.toggle("painting", tool === "paint");
  canvas.classList.toggle("drawing", tool === "profile");
}
