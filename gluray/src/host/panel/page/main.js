// The page: which program, its numbers over time, its settings.

import { change, get, listen, news, pending, post } from "./server.js";
import { element, panel } from "./controls.js";
import { Chart, number } from "./charts.js";
import { Objects } from "./objects.js";

const room = 600;
const by = id => document.getElementById(id);
const message = by("message");
const say = text => { message.hidden = !text; message.textContent = text || ""; };
listen(say);

let chosen = null, programs = [];
const frames = new Map();
const fields = await get("fields");
const set = (path, value) => chosen !== null && change(chosen, { [path]: value });
const reset = path => chosen !== null && change(chosen, {}, [path]);
const settings = panel(by("settings"), fields, set, reset);
const objects = new Objects(fields, set, reset);
const times = new Chart("times", "ms", f => f.phases_ms, f => f.frame_ms);
const rays = new Chart("rays", "", f => f.rays);

async function choose(id) {
  chosen = id;
  if (objects.chosen !== null) objects.choose(objects.chosen);
  by("toml").href = `toml?id=${id}`;
  document.activeElement?.blur();
  try { frames.set(id, await get(`history?id=${id}`)); } catch { /* gone: the list says so */ }
  show(programs);
}

by("reset").addEventListener("click", () => { const p = programs.find(p => p.id === chosen); if (p) change(p.id, {}, Object.keys(p.assignments)); });
by("export").addEventListener("click", () => post("export", { id: chosen }).then(() => say(null), e => say(e.message)));

function tabs() {
  by("programs").replaceChildren(...programs.map(p => {
    const b = element("button", { type: "button", textContent: `${p.program} ${p.process}`, className: p.running ? "" : "ended", title: p.running ? "running" : "ended" });
    b.setAttribute("role", "tab");
    b.setAttribute("aria-selected", p.id === chosen);
    b.dataset.id = p.id;
    b.addEventListener("click", () => choose(p.id));
    return b;
  }));
}

function numbers(p, frame) {
  const total = Object.values(frame.rays).reduce((a, b) => a + b, 0);
  const list = [["frame", frame.frame], ["frames per second", frame.frame_ms > 0 ? (1000 / frame.frame_ms).toFixed(1) : "–"], ["milliseconds", number(frame.frame_ms)],
    ["picture", frame.size[0] ? `${frame.size[0]} × ${frame.size[1]}` : "–"], ["triangles", number(frame.triangles)], ["rays", number(total)],
    ["draws traced", frame.traced], ["draws passed", frame.passed], ["mode", p.settings.enabled ? p.settings.mode : "off"]];
  by("numbers").replaceChildren(...list.map(([k, v]) => element("div", {}, [element("dt", { textContent: k }), element("dd", { textContent: v })])));
  const reasons = Object.entries(frame.reasons).sort((a, b) => b[1] - a[1]);
  const rows = reasons.length ? reasons : [["nothing", 0]];
  by("reasons").tBodies[0].replaceChildren(...rows.map(([why, n]) => element("tr", {}, [element("td", { textContent: why }), element("td", { textContent: n })])));
}

function show(list) {
  programs = list;
  for (const p of programs) {
    const kept = frames.get(p.id) || [];
    const last = kept.at(-1)?.frame ?? -1;
    kept.push(...p.recent.filter(f => f.frame > last));
    frames.set(p.id, kept.slice(-room));
  }
  if (chosen === null || !programs.some(p => p.id === chosen)) {
    const first = programs.findLast(p => p.running) || programs.at(-1);
    chosen = null;
    if (first) return choose(first.id);
  }
  tabs();
  const p = programs.find(p => p.id === chosen);
  by("empty").hidden = !!p;
  document.querySelector("main").hidden = !p;
  if (!p) return;
  by("problems").replaceChildren(...p.problems.map(text => element("li", { textContent: text })));
  by("exported").hidden = !p.exported;
  if (p.exported) by("exported").textContent = p.exported.Ok ? `written: ${p.exported.Ok}` : `not written: ${p.exported.Err}`;
  by("reset").disabled = !p.running || Object.keys(p.assignments).length === 0;
  by("export").disabled = !p.running;
  const free = !pending();
  settings.update(p, p.settings, free);
  objects.update(p, p.settings, free);
  const own = frames.get(p.id);
  if (own.length) {
    numbers(p, own.at(-1));
    times.draw(own, room);
    rays.draw(own, room);
  }
  document.body.dataset.shown = p.id;
}

news(state => show(state.programs), (lost, e) => { by("lost").hidden = !lost; if (lost) console.info(String(e)); });
