// The page: turns the user's actions into changes of the scene, and shows the program's states and frames.

import * as server from "./server.js";
import * as image from "./image.js";
import * as filter from "./filter.js";
import * as settings from "./settings.js";
import * as flow from "./flow.js";
import * as axes from "./axes.js";
import * as legend from "./legend.js";
import * as profile from "./profile.js";
import * as rows from "./rows.js";
import * as save from "./save.js";
import * as curves from "./curves.js";
import { quantity, percent, linear } from "./units.js";

const $ = id => document.getElementById(id);
let state = null, info = null, angles = null, tool = "orbit", lostSince = null, failed = false;

// ---- From the program -------------------------------------------------------------------------------------------

const AXES = { x: [0, 0], y: [-90, 0], z: [-90, 90] };

// With `all`, fields that have the focus are written too: what was refused goes back.
function onState(next, all = false) {
  state = { ...next, half: filter.half() || 1e-3 };
  if (all) wanted = null;
  $("file").textContent = next.file || "";
  const direction = next.effective.view.direction;
  angles = AXES[direction] || direction.split(",").map(Number);
  showTime(next);
  settings.show(state, all);
  flow.show(state, all);
  curves.show(state);
  const paints = canPaint();
  filter.lock(!paints);
  $("brush").hidden = !paints;
  $("filter").closest("fieldset").hidden = !["schlieren", "shadowgraph", "interferogram", "bos"].includes(kind());
  document.querySelector("input[value=paint]").disabled = !paints;
  if (!paints && tool === "paint") setTool("orbit");
}

function showTime({ times, step }) {
  $("time").hidden = times.length < 2;
  if (times.length < 2) return;
  $("step").max = times.length - 1;
  if (document.activeElement !== $("step")) $("step").value = step;
  $("when").textContent = `${step + 1} of ${times.length}, t = ${Number(times[step].toPrecision(6))}`;
}

const kind = () => state?.effective.technique.kind;
const canPaint = () => kind() === "schlieren";

function onFrame(frame) {
  info = frame.info;
  $("progress").firstElementChild.style.width = info.finished ? "100%" : info.samples_wanted && !info.draft ? `${Math.round(10 + 80 * Math.log2(1 + info.samples) / Math.log2(1 + info.samples_wanted))}%` : "8%";
  // Another page, or the flow's shape, has changed the scene.
  if (state && info.generation > state.generation) server.refresh().catch(() => {});
  if (info.error) {
    failed = true;
    say(info.error, false, { text: "go back", act: server.back });
    $("done").textContent = "no image";
    mark();
    return;
  }
  if (failed) { failed = false; say(null); }
  if (info.generation === state?.generation) wanted = null;
  image.show(frame, info.film_size);
  filter.show(frame);
  axes.show(info);
  legend.show(frame, state?.effective, state?.overlay);
  profile.showFrame(frame, state?.overlay);
  if (state) state.half = filter.half();
  if (!$("radius").dataset.touched && info.filter_half_m) $("radius").value = Number((info.filter_half_m * 1e3 / 12).toPrecision(2));
  const rate = info.rays / info.elapsed_secs;
  $("done").textContent = info.finished ? "finished" : info.draft ? "draft…" : "refining…";
  const t = state?.effective;
  numbers([
    ["noise", info.noise_rms === null ? "none" : `${percent(info.noise_rms)} of white`],
    ["samples per second", info.rays ? quantity(rate, "") : "–"],
    ["photons per pixel", info.samples === null ? "none" : info.samples_wanted > info.samples ? `${info.samples} of ${info.samples_wanted}` : `${info.samples}`],
    ["largest deflection", quantity(info.largest_deflection_rad, "rad")],
    ["error of deflections", info.deflection_error_rad === null ? "when finished" : `± ${quantity(info.deflection_error_rad, "rad", 2)}`],
    ["error of the flow's lattice", info.resolution_error_rad === null ? "–" : `± ${quantity(info.resolution_error_rad, "rad", 2)}`],
    ...(info.mesh_error_rad === null ? [] : [["error of the flow's mesh", `± ${quantity(info.mesh_error_rad, "rad", 2)}`]]),
    ["pixel", quantity(info.pixel_m, "m")],
    ["brightness", `${percent(info.levels[0], 3)} to ${percent(info.levels[1], 3)}`],
    ["light along", angles ? `azimuth ${Math.round(angles[0] * 10) / 10}°, elevation ${Math.round(angles[1] * 10) / 10}°` : "–"],
    ["march", info.march || "–"],
  ]);
  const warnings = (info.finished ? info.warnings : []).map(w =>
    Object.assign(document.createElement("li"), { textContent: inWords(w) }));
  $("warnings").replaceChildren(...warnings);
  mark();
}

// For scripts that wait for a frame.
function mark() {
  document.body.dataset.serial = info.serial;
  document.body.dataset.generation = info.generation;
  document.body.dataset.finished = info.finished;
}

function numbers(pairs) {
  $("numbers").replaceChildren(...pairs.map(([name, value]) => {
    const div = document.createElement("div");
    div.append(Object.assign(document.createElement("dt"), { textContent: name }), Object.assign(document.createElement("dd"), { textContent: value }));
    return div;
  }));
}

// What the library's warnings name by keys and options, in the words of the page.
const WORDS = [
  ["flow.resample_nodes, --resample", "“resample to”"],
  ["flow.resample_nodes", "“resample to”"],
  // These are chosen when the program starts.
  ["flow.resample_samples", "--resample-samples at the start"],
  ["flow.density_unit_kg_m3", "--density-unit at the start"],
  ["flow.temperature_zero_k", "--temperature-zero at the start"],
  ["flow.pressure_unit_pa", "--pressure-unit at the start"],
  ["flow.pressure_zero_pa", "--pressure-zero at the start"],
  ["flow.length_unit_m", "--length-unit at the start"],
  ["flow.smoothing_nodes, --smoothing", "“smoothing”"],
  ["march.tolerance_rad, --tolerance", "“tolerance”"],
  ["flow.outside", "“outside the mesh”"],
  ["flow.hidden", "“hidden cells”"],
  ["flow.reconstruction", "“between points”"],
  ["flow.on_cells (--on-cells)", "“on cells”"],
];
const inWords = warning => WORDS.reduce((w, [key, label]) => w.replaceAll(key, label), warning);

// A message, or none; `action` is a button beside it.
function say(text, note = false, action = null) {
  const box = $("message");
  box.hidden = !text;
  box.textContent = text || "";
  if (action) {
    const button = Object.assign(document.createElement("button"), { textContent: action.text });
    button.addEventListener("click", action.act);
    box.append(button);
  }
  box.classList.toggle("note", note);
}

function onLost(lost) {
  if (lost) { lostSince ??= Date.now(); if (Date.now() - lostSince > 1000) say("The program does not respond: it has ended, or the connection is lost. This page continues when it is back."); }
  else { lostSince = null; say(null); }
}

// ---- To the program ---------------------------------------------------------------------------------------------

server.listen(onState, say);
rows.listen(patch => {
  if (patch.fit === false || patch.film?.size) fits = false;
  server.change(patch);
}, say);
profile.listen(say);
save.listen(say);
curves.listen(server.change);

function orbit(azimuth, elevation) {
  const turned = ((azimuth + 180) % 360 + 360) % 360 - 180;
  angles = [Math.round(turned * 100) / 100, Math.round(Math.min(90, Math.max(-90, elevation)) * 100) / 100];
  server.change({ view: { direction: `${angles[0]},${angles[1]}` } });
}

// A frame that follows the flow is fitted when a turn ends, because it would jump during one.
const turned = () => { if (state?.fit) server.change({ fit: true }); };

// ---- The frame

// The frame that was asked for and is not shown yet: width in metres and middle. `fits` is whether
// the frame followed the flow before it was zoomed.
let wanted = null, fits = false;

function frameNow() {
  if (wanted) return wanted;
  fits ||= state?.fit ?? false;
  return { width_m: info.pixel_m * info.width, center_m: info.center_m };
}

function setFrame(next) {
  wanted = next;
  const digits = v => Number(v.toPrecision(6));
  const center_m = next.center_m.map(digits);
  server.change({ film: { field_of_view_m: digits(next.width_m), center_m } });
}

const sides = ({ width_m }) => [width_m, width_m * info.height / info.width];

// The point under the pointer stays where it is.
function zoom(factor, at) {
  if (!info?.width) return;
  const now = frameNow(), width_m = now.width_m * factor;
  // Beyond the whole flow there is nothing, and far inside of it no more to see than a cell.
  if (factor > 1 && width_m >= info.whole_width_m) { whole(); return; }
  if (factor < 1 && width_m < 1e-3 * info.whole_width_m) return;
  const [w, h] = sides(now), from = [(at[0] - 0.5) * w, (0.5 - at[1]) * h];
  setFrame({ width_m, center_m: now.center_m.map((c, i) => c + from[i] * (1 - factor)) });
}

function pan() {
  if (!info?.width) return () => {};
  const start = frameNow(), [w, h] = sides(start);
  const moved = (dx, dy) => [start.center_m[0] - dx * w, start.center_m[1] + dy * h];
  return (dx, dy) => setFrame({ width_m: start.width_m, center_m: moved(dx, dy) });
}

function whole() {
  wanted = null;
  const same = fits || state?.fit;
  server.change(same ? { fit: true } : { film: { field_of_view_m: null, center_m: [0, 0] } });
}

// ---- Tools

const radius = () => Math.max(1e-9, Number($("radius").value) / 1e3 || 0);
const paint = on => points => server.paint({ on, points, radius_m: radius(), rgb: linear($("color").value) });

image.interact({
  angles: () => angles || [0, 0], orbit, turned, tool: () => tool, paint: paint("picture"),
  line: profile.setLine, moveLine: profile.move, zoom, pan, whole, trace: server.trace,
  mark: (at, deflection) => { filter.point(at); legend.point(deflection); },
});
filter.interact({ paints: canPaint, radius, paint: paint("filter") });

function setTool(next) {
  tool = next;
  document.querySelector(`input[name=tool][value=${next}]`).checked = true;
  image.setTool(next);
  profile.setActive(next === "profile");
}
for (const input of document.querySelectorAll("input[name=tool]")) input.addEventListener("change", () => setTool(input.value));
for (const button of document.querySelectorAll("[data-view]")) {
  button.addEventListener("click", () => {
    const view = { direction: button.dataset.view };
    server.change({ view, ...(state?.fit ? { fit: true } : {}) });
  });
}
$("whole").addEventListener("click", whole);
$("step").addEventListener("input", () => server.change({ step: Number($("step").value) }));
$("radius").addEventListener("input", () => { $("radius").dataset.touched = "1"; });

// A cleared filter keeps its size and the source that it was painted with.
const ground = rgb => server.change({
  light: { source: state.effective.light.source },
  technique: { kind: "schlieren", cutoff: { kind: "painted", size_m: [2 * filter.half(), 2 * filter.half()], ground_rgb: rgb } },
});
$("clear-white").addEventListener("click", () => ground([1, 1, 1]));
$("clear-black").addEventListener("click", () => ground([0, 0, 0]));
$("undo").addEventListener("click", () => {
  const cutoff = state.scene.technique.cutoff;
  if (cutoff?.kind !== "painted" || !cutoff.strokes.length) return say("there is no stroke to undo", true);
  return server.change({ technique: { kind: "schlieren", cutoff: { ...cutoff, strokes: cutoff.strokes.slice(0, -1) } } });
});
for (const color of ["#ffffff", "#808080", "#000000", "#ff2020", "#ffd020", "#20c040", "#20a0ff", "#a040ff"]) {
  const button = Object.assign(document.createElement("button"), { title: color });
  button.style.background = color;
  button.addEventListener("click", () => { $("color").value = color; });
  $("swatches").append(button);
}

await server.refresh().catch(e => say(e.message));
server.frames(onFrame, onLost);
