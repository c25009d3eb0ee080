// What the brightness and colours of the image mean.

import { quantity, short } from "./units.js";

const figure = document.getElementById("legend");
const canvas = document.getElementById("legend-colors"), context = canvas.getContext("2d");
const words = document.getElementById("legend-words");
let last = null, mark = null;

const byte = v => {
  const c = Math.min(1, Math.max(0, v));
  return 255 * (c <= 0.0031308 ? 12.92 * c : 1.055 * c ** (1 / 2.4) - 0.055);
};

// A strip of grey from left to right; `light` is the linear brightness at 0 to 1.
function strip(light) {
  canvas.width = 220;
  canvas.height = 18;
  const row = new ImageData(canvas.width, canvas.height);
  for (let i = 0; i < row.data.length; i += 4) {
    const x = i / 4 % canvas.width, v = byte(light((x + 0.5) / canvas.width));
    row.data.set([v, v, v, 255], i);
  }
  context.putImageData(row, 0, 0);
}

// The colours of a legend on a canvas of their own.
function colors({ info, legend }) {
  const [w, h] = info.legend_size, small = new OffscreenCanvas(w, h), image = new ImageData(w, h);
  for (let i = 0; i < w * h; i++) {
    image.data.set([legend[3 * i], legend[3 * i + 1], legend[3 * i + 2], 255], 4 * i);
  }
  small.getContext("2d").putImageData(image, 0, 0);
  return small;
}

// Colours of optical paths, from left to right.
function paths(frame) {
  canvas.width = frame.info.legend_size[0];
  canvas.height = 18;
  context.imageSmoothingEnabled = false;
  context.drawImage(colors(frame), 0, 0, canvas.width, canvas.height);
}

function square(frame) {
  const { info } = frame, small = colors(frame);
  canvas.width = canvas.height = 128;
  context.imageSmoothingEnabled = true;
  context.drawImage(small, 0, 0, 128, 128);
  context.strokeStyle = "rgba(110,140,190,0.8)";
  context.beginPath();
  context.moveTo(64, 0); context.lineTo(64, 128); context.moveTo(0, 64); context.lineTo(128, 64);
  context.stroke();
  if (!mark) return;
  const at = [0, 1].map(c => 64 * (1 + (c ? -1 : 1) * mark[c] / info.legend_half_rad));
  for (const [style, wide] of [["#000", 3], ["#39f", 1.5]]) {
    context.strokeStyle = style;
    context.lineWidth = wide;
    context.beginPath();
    context.arc(...at, 4, 0, 7);
    context.stroke();
  }
}

// Lines of explanation of each technique, after its strip is drawn.
const MEANING = {
  schlieren: e => {
    strip(v => v);
    return ["black: no light, white: all of it",
      "the legend of deflections comes with the finished image"];
  },
  shadowgraph: e => {
    strip(v => v);
    return [`black: no light, ${short(e.film.exposure, 3)} of white: undisturbed light, white: `
      + `${short(1 / e.film.exposure, 3)} times as much`];
  },
  interferogram: e => {
    const visibility = e.technique.visibility, nm = e.light.wavelengths_nm[0];
    if (e.light.wavelengths_nm.length > 1) {
      strip(v => v);
      return ["the legend of the fringes' colours comes with the finished image"];
    }
    strip(v => e.film.exposure * (0.5 + 0.5 * visibility * Math.cos(2 * Math.PI * v)));
    return [`optical path 0 to one wavelength (${short(nm)} nm); then it begins again`];
  },
  bos: () => ["the dots have no brightness to read; choose “vectors” to see how far they move"],
  volume: () => { strip(v => v); return ["an illustration: its brightness has no unit"]; },
  slice: () => { strip(v => v); return ["an illustration: its brightness has no unit"]; },
};

// `vectors` is what is drawn over the image; its scale is in the picture.
const VECTORS = {
  arrows: "arrows: their scale is in the lower left corner of the picture",
  lic: "colours are lengths of vectors: their scale is in the lower left corner of the picture",
};

export function show(frame, effective, vectors) {
  if (!effective || frame.info.draft) return;
  // Lines along vectors replace the picture, and its colours with it.
  const replaced = vectors === "lic", bos = effective.technique.kind === "bos";
  const { info } = frame, has_colors = info.legend_size[0] > 0 && !replaced;
  const is_square = has_colors && info.legend_half_rad !== null;
  last = is_square ? frame : null;
  const nm = effective.light.wavelengths_nm, of_first = nm.length > 1 ? ` at ${short(nm[0])} nm` : "";
  figure.hidden = false;
  canvas.hidden = replaced || bos;
  let lines;
  if (replaced || (vectors && bos)) lines = [VECTORS[vectors]];
  else if (is_square) {
    square(frame);
    lines = [`colour of each deflection${of_first}, up to `
      + `${quantity(info.legend_half_rad, "rad")} to the right, left, up and down`];
  } else if (has_colors) {
    paths(frame);
    lines = [`optical path${of_first}: 0 to ${quantity(info.legend_path_m, "m")}`];
  } else lines = MEANING[effective.technique.kind](effective);
  words.replaceChildren(...lines.map(l =>
    Object.assign(document.createElement("div"), { textContent: l })));
}

// The deflection under the pointer, or null.
export function point(deflection) {
  mark = deflection;
  if (last) square(last);
}
