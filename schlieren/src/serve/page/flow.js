// The settings of the flow: which arrays make the index, and how they become a lattice.

import { check, choice, number, shower, text } from "./rows.js";
import { ROWS } from "./help.js";

const KINDS = { density: "density", temperature: "temperature, pressure", n_minus_1: "n − 1" };
// Cells have none of what counts in nodes.
const CELLS = { on_cells: true, smoothing_nodes: 0, average_jumps: false, resample_nodes: null };
const LATTICE = { on_cells: false };
const names = state => state.arrays.map(a => a.name);

function kindOf(state) {
  const flow = state.scene.flow;
  return Object.keys(KINDS).find(k => flow[k] !== undefined && flow[k] !== null);
}

const nameOf = state => KINDS[kindOf(state)]
  ?? (state.scene.flow.multifield ? "transfer functions" : "free electrons");

// The array whose name says what it is, or the first.
function likely(state, pattern) {
  return names(state).find(n => pattern.test(n)) ?? names(state)[0];
}

function fresh(kind, state) {
  switch (kind) {
    case "density": return { density: likely(state, /^(rho|dens)/i) };
    case "n_minus_1": return { n_minus_1: likely(state, /^n/i) };
    default: return {
      temperature: likely(state, /^t/i),
      pressure: names(state).find(n => /^p/i.test(n)) ?? "101325",
    };
  }
}

function arrayRow(label, key, state) {
  const now = state.scene.flow[key];
  const all = names(state);
  // A number, or an array that is constant.
  if (now !== undefined && now !== null && !all.includes(now)) all.push(now);
  return choice(label, all, s => s.scene.flow[key], v => ({ flow: { [key]: v } }));
}

function rowsOf(state) {
  const flow = s => s.effective.flow, kind = kindOf(state), rows = [];
  const of = Object.fromEntries(Object.entries(KINDS).map(([key, label]) => [label, key]));
  const labels = Object.keys(of);
  // What the program started with, or the curves below, can be left here but not chosen.
  if (!kind) labels.push(nameOf(state));
  if (names(state).length) rows.push(choice("index from", labels, nameOf,
    (v, s) => of[v] ? { flow: fresh(of[v], s) } : {}));
  if (kind) {
    rows.push(arrayRow({ n_minus_1: "array of n − 1" }[kind] ?? kind, kind, state));
    if (kind === "temperature") rows.push(text("pressure", "Pa, or an array",
      s => s.scene.flow.pressure ?? "", v => ({ flow: { pressure: v.trim() } })));
  }
  rows.push(choice("outside the mesh", ["auto", "blank", "solid", "gas"], s => flow(s).outside,
    v => ({ flow: { outside: v } })));
  rows.push(choice("hidden cells", ["blank", "solid", "gas"], s => flow(s).hidden,
    v => ({ flow: { hidden: v } })));
  rows.push(choice("between points", ["cubic", "linear"], s => flow(s).reconstruction,
    v => ({ flow: { reconstruction: v } })));
  rows.push(check("on cells", s => flow(s).on_cells, v => ({ flow: v ? CELLS : LATTICE })));
  if (flow(state).on_cells) return rows;
  rows.push(number("smoothing", "nodes", 1, s => flow(s).smoothing_nodes,
    v => ({ flow: { smoothing_nodes: v } })));
  rows.push(check("average jumps", s => flow(s).average_jumps,
    v => ({ flow: { average_jumps: v } })));
  rows.push(number("resample to", "nodes", 1, s => flow(s).resample_nodes,
    v => ({ flow: { resample_nodes: v } }), { empty: "as the data" }));
  return rows;
}

const shapeOf = s => [nameOf(s), names(s), s.scene.flow[kindOf(s)], s.effective.flow.on_cells];

export const show = shower(document.getElementById("flow"), ROWS, shapeOf, rowsOf);
