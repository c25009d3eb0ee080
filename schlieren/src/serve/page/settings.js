// The settings of the bench: what each technique has.

import { check, choice, number, numbers, one, range, shower, text } from "./rows.js";
import { ROWS, TECHNIQUES } from "./help.js";

function cutoffRows(state) {
  const kinds = ["knife", "circle", "complemented-circle", "color", "painted"];
  if (state.image_filter) kinds.push("image");
  const of = s => s.effective.technique.cutoff;
  const set = part => s => ({ technique: { kind: "schlieren", cutoff: { ...of(s), ...part } } });
  const fresh = {
    "knife": s => ({ kind: "knife" }),
    "circle": s => ({ kind: "circle", radius_m: 5e-4 }),
    "complemented-circle": s => ({ kind: "complemented-circle", radius_m: 5e-4 }),
    "color": s => ({ kind: "color", radius_m: 5e-4 }),
    "painted": s => ({ kind: "painted", size_m: [s.half * 2, s.half * 2], ground_rgb: [1, 1, 1] }),
    "image": s => s.image_filter,
  };
  const change = (kind, s) => ({
    technique: { kind: "schlieren", cutoff: fresh[kind](s) },
    // Focal lengths and sources belong to a cut-off, so another cut-off resets them.
    lenses: { schlieren_m: null, collimator_m: null }, light: { source: null },
  });
  const rows = [choice("cut-off", kinds, s => of(s).kind, change)];
  const center = i => number(i ? "centre, up" : "centre, right", "mm", 1e3, s => of(s).center_m[i], (v, s) => {
    const c = [...of(s).center_m]; c[i] = v; return set({ center_m: c })(s);
  });
  switch (of(state).kind) {
    case "knife":
      rows.push(range("opens towards", "°", -180, 180, 1, s => of(s).angle_deg, (v, s) => set({ angle_deg: v })(s)));
      if (of(state).open_m === undefined) rows.push(range("left open", "", 0, 1, 0.01, s => of(s).open, (v, s) => set({ open: v })(s)));
      else rows.push(number("left open", "mm", 1e3, s => of(s).open_m, (v, s) => set({ open_m: v })(s)));
      break;
    case "circle": case "complemented-circle":
      rows.push(number("radius", "mm", 1e3, s => of(s).radius_m, (v, s) => set({ radius_m: v })(s)), center(0), center(1));
      break;
    case "color":
      rows.push(number("saturated at", "mm", 1e3, s => of(s).radius_m, (v, s) => set({ radius_m: v })(s)));
      rows.push(range("red towards", "°", -180, 180, 1, s => of(s).red_deg, (v, s) => set({ red_deg: v })(s)));
      break;
    case "image":
      rows.push(number("width", "mm", 1e3, s => of(s).width_m, (v, s) => set({ width_m: v })(s)));
      break;
    case "painted":
      rows.push({ kind: "hint", get: s => `${of(s).strokes.length} strokes. Paint on the filter plane, or choose “paint” above and paint on the image: each pixel is traced to its point on the filter. The smaller the light source, the better the directions are resolved.` });
  }
  return rows;
}

function techniqueRows(state) {
  const t = s => s.effective.technique;
  const set = part => s => ({ technique: { ...t(s), ...part } });
  switch (t(state).kind) {
    case "schlieren": return cutoffRows(state);
    case "interferogram": {
      const rows = [range("visibility", "", 0, 1, 0.01, s => t(s).visibility, (v, s) => set({ visibility: v })(s)),
        number("fringe spacing", "mm", 1e3, s => t(s).fringe_spacing_m, (v, s) => {
          const next = { ...t(s), fringe_spacing_m: v };
          if (v === null) { delete next.fringe_spacing_m; delete next.fringe_angle_deg; }
          return { technique: next };
        }, { empty: "infinite" })];
      if (t(state).fringe_spacing_m) rows.push(range("across fringes", "°", -90, 90, 1, s => t(s).fringe_angle_deg ?? 0, (v, s) => set({ fringe_angle_deg: v })(s)));
      return rows;
    }
    case "bos": {
      const optional = key => (v, s) => { const next = { ...t(s), [key]: v }; if (v === null) delete next[key]; return { technique: next }; };
      return [number("dot diameter", "mm", 1e3, s => t(s).dot_diameter_m, optional("dot_diameter_m"), { empty: "3 pixels" }),
        number("dot spacing", "mm", 1e3, s => t(s).dot_spacing_m, optional("dot_spacing_m"), { empty: "2 dots" })];
    }
    case "volume": return [number("strength", "", 1, s => t(s).strength, (v, s) => set({ strength: v })(s))];
    case "slice": return [number("strength", "", 1, s => t(s).strength, (v, s) => set({ strength: v })(s)),
      number("depth", "mm", 1e3, s => t(s).depth_m, (v, s) => set({ depth_m: v })(s))];
    default: return [];
  }
}

// What is drawn over an image: how far dots move, or how light is bent.
function vectorRows(state) {
  if (["volume", "slice"].includes(state.effective.technique.kind)) return [];
  return [choice("vectors", ["none", "arrows", "lic"], s => s.overlay ?? "none",
    v => ({ overlay: v === "none" ? null : v }))];
}

function lightRows(state) {
  const e = s => s.effective, light = s => e(s).light, kind = e(state).technique.kind, rows = [];
  const source = light(state).source;
  if (source && (kind === "schlieren" || kind === "shadowgraph")) {
    const fresh = { point: { kind: "point" }, slit: { kind: "slit", width_m: 1e-3, length_m: 5e-3 }, circle: { kind: "circle", diameter_m: 5e-4 } };
    rows.push(choice("light source", Object.keys(fresh), s => light(s).source.kind, v => ({ light: { source: fresh[v] }, ...(v === "point" ? { lenses: { collimator_m: null } } : {}) })));
    const part = (key, label) => number(label, "mm", 1e3, s => light(s).source[key], (v, s) => {
      const next = { ...light(s).source, [key]: v };
      // Without an angle of its own, the slit turns with the knife.
      if (!s.scene.light.source || s.scene.light.source.angle_deg === undefined) delete next.angle_deg;
      return { light: { source: next } };
    });
    if (source.kind === "slit") rows.push(part("width_m", "slit width"), part("length_m", "slit length"));
    if (source.kind === "circle") rows.push(part("diameter_m", "diameter"));
    if (source.kind !== "point") rows.push(number("collimator f₁", "m", 1, s => e(s).lenses.collimator_m, v => ({ lenses: { collimator_m: v } })));
  }
  const cutoff = e(state).technique.cutoff;
  if (cutoff && !(cutoff.kind === "knife" && cutoff.open_m === undefined))
    rows.push(number("schlieren lens f₂", "m", 1, s => e(s).lenses.schlieren_m, v => ({ lenses: { schlieren_m: v } })));
  if (e(state).film.focus_m !== undefined)
    rows.push(number({ shadowgraph: "film distance", bos: "background at" }[kind] || "in focus at", "mm", 1e3, s => e(s).film.focus_m, v => ({ film: { focus_m: v } })));
  rows.push(text("wavelengths", "nm", s => light(s).wavelengths_nm.join(", "),
    v => ({ light: { wavelengths_nm: numbers("wavelengths", v), weights: null } })));
  return rows;
}

function filmRows(state) {
  const e = s => s.effective, film = s => e(s).film, rows = [];
  rows.push(text("pixels", "", s => film(s).size.join(" × "),
    v => ({ film: { size: numbers("pixels", v) } })));
  rows.push(check("fit the flow", s => s.fit, v => ({ fit: v })));
  rows.push(number("field of view", "mm", 1e3, s => film(s).field_of_view_m, v => ({ film: { field_of_view_m: v } }), { empty: "all" }));
  rows.push(number("exposure", "×", 1, s => film(s).exposure, v => ({ film: { exposure: v } })));
  const sampling = e(state).sampling;
  if (!sampling) return rows;
  const photons = samples => ({ sampling: { method: "photons", samples } });
  const beams = { sampling: { method: "beams" } };
  const counts = [4, 16, 64, 256, 1024].map(String);
  if (sampling.method === "photons" && !counts.includes(String(sampling.samples))) counts.push(String(sampling.samples));
  rows.push(choice("photons per pixel", ["noise-free", ...counts], s => e(s).sampling.method === "beams" ? "noise-free" : String(e(s).sampling.samples), (v, s) => {
    if (v === "noise-free") return beams;
    const old = e(s).sampling;
    return old.method === "photons" ? { sampling: { ...old, samples: Number(v) } } : photons(Number(v));
  }));
  if (sampling.method === "photons") {
    const filters = { none: { kind: "none" }, gaussian: { kind: "gaussian", sigma_px: 0.8 }, mean: { kind: "mean", radius_px: 1 }, cone: { kind: "cone", nearest: 16 } };
    rows.push(choice("noise filter", Object.keys(filters), s => e(s).sampling.filter.kind, (v, s) => ({ sampling: { ...e(s).sampling, filter: filters[v] } })));
  }
  rows.push(text("tolerance", "rad",
    s => e(s).march.tolerance_rad.toExponential().replace("e+0", ""),
    v => ({ march: { tolerance_rad: one("tolerance", v) } })));
  return rows;
}

function shapeOf(state) {
  const e = state.effective, t = e.technique;
  return [t.kind, t.cutoff?.kind, t.cutoff?.open_m !== undefined, !!t.fringe_spacing_m,
    e.light.source?.kind, e.sampling?.method, e.sampling?.samples];
}

function rowsOf(state) {
  const technique = choice("technique", state.techniques, s => s.effective.technique.kind,
    v => ({ technique: { kind: v } }), { help: TECHNIQUES, list: true });
  const about = { kind: "hint", get: s => TECHNIQUES[s.effective.technique.kind] };
  return [technique, about, ...techniqueRows(state), ...vectorRows(state), ...lightRows(state),
    ...filmRows(state)];
}

export const show = shower(document.getElementById("technique"), ROWS, shapeOf, rowsOf);
