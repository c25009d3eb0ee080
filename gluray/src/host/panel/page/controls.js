// Rows that show and change settings, made from the panel's table of them.

const names = { ambient_occlusion_samples: "ambient occlusion rays", ambient_occlusion_radius: "ambient occlusion radius",
  light_radius_deg: "size of lights", aperture_radius: "aperture", max_bounces: "bounces", added: "added light", added_direction: "its direction",
  added_color: "its colour", color: "colour", ior: "refractive index", program: "program's lights", ambient: "ambient light", sky: "sky light" };
const own = path => path.slice(path.lastIndexOf(".") + 1);
const label = path => names[own(path)] || own(path).replaceAll("_", " ");
const element = (tag, set = {}, children = []) => { const e = Object.assign(document.createElement(tag), set); e.append(...children); return e; };
const hex = rgb => "#" + rgb.map(v => Math.round(255 * Math.min(1, Math.max(0, v))).toString(16).padStart(2, "0")).join("");
const rgb = text => [1, 3, 5].map(i => Number((parseInt(text.slice(i, i + 2), 16) / 255).toFixed(4)));

// What an optional setting shows while the program decides.
const unset = { switch: false, whole: 0, real: 0, color: [0.8, 0.8, 0.8], direction: [0, 0, 1] };

// One input for a kind: its element, how to show a value, and `changed` called with new ones.
function input(field, changed) {
  const number = (props, on) => { const e = element("input", { type: "number", step: "any", ...props }); e.addEventListener("change", () => on(e)); return e; };
  switch (field.kind) {
    case "switch": {
      const e = element("input", { type: "checkbox" });
      e.addEventListener("change", () => changed(e.checked));
      return { parts: [e], show: v => { e.checked = v; } };
    }
    case "word": {
      const e = element("select", {}, field.words.map(w => element("option", { value: w, textContent: w === "program" ? "as the program says" : w })));
      e.addEventListener("change", () => changed(e.value));
      return { parts: [e], show: v => { e.value = v ?? "program"; } };
    }
    case "color": {
      const e = element("input", { type: "color" });
      e.addEventListener("input", () => changed(rgb(e.value)));
      return { parts: [e], show: v => { e.value = hex(v); } };
    }
    case "direction": {
      const list = [0, 1, 2].map(() => number({ min: -1e5, max: 1e5 }, () => changed(list.map(e => Number(e.value)))));
      return { parts: [element("span", { className: "direction" }, list)], show: v => list.forEach((e, i) => { e.value = +v[i].toFixed(3); }) };
    }
    default: {
      const whole = field.kind === "whole";
      const e = number({ min: field.low, max: field.high, step: whole ? 1 : "any" }, () => { slider.value = toSlider(Number(e.value)); changed(Number(e.value)); });
      // Wide ranges go by powers, from the least step that matters.
      const least = whole ? 1 : Math.max(field.low, field.high / 1e4), wide = field.high >= 10;
      const toSlider = v => !wide ? (v - field.low) / (field.high - field.low) : v <= least ? 0 : Math.log(v / least) / Math.log(field.high / least);
      const fromSlider = s => { const v = !wide ? field.low + s * (field.high - field.low) : s <= 0 ? field.low : least * (field.high / least) ** s; return whole ? Math.round(v) : Number(v.toPrecision(3)); };
      const slider = element("input", { type: "range", min: 0, max: 1, step: 0.001 });
      slider.setAttribute("aria-label", label(field.path));
      slider.addEventListener("input", () => { e.value = fromSlider(Number(slider.value)); changed(Number(e.value)); });
      const unit = element("em", { textContent: field.unit });
      return { parts: [e, slider, unit], show: v => { e.value = whole ? v : Number(Number(v).toPrecision(4)); slider.value = toSlider(v); } };
    }
  }
}

// Rows for fields; `set(path, value)` and `reset(path)` are called with paths below `prefix`.
export function rows(fields, prefix, set, reset) {
  const list = fields.map(field => {
    const path = prefix ? `${prefix}.${own(field.path)}` : field.path;
    const made = input(field, value => set(path, value));
    const undo = element("button", { className: "undo", textContent: "↺", title: "take this change back", type: "button" });
    undo.addEventListener("click", () => reset(path));
    const row = element("label", { className: "row", title: field.about }, [element("span", { textContent: label(field.path) }), ...made.parts, undo]);
    row.dataset.path = path;
    return { field, path, row, show: made.show };
  });
  return {
    elements: list.map(r => r.row),
    update(program, settings, free) {
      for (const { field, path, row, show } of list) {
        const value = path.split(".").reduce((at, key) => at?.[key], settings);
        const idle = field.modes.length > 0 && !field.modes.includes(settings.mode);
        const deaf = program.obeys.length > 0 && !program.obeys.includes(field.path);
        row.classList.toggle("changed", path in program.assignments);
        row.classList.toggle("idle", idle || deaf || value === undefined);
        row.title = deaf ? `${field.about} (not yet obeyed by this library)` : idle ? `${field.about} (changes nothing in mode ${settings.mode}: takes effect in ${field.modes.join(", ")})` : field.about;
        row.querySelectorAll("input, select").forEach(e => { e.disabled = deaf || !program.running; });
        // What somebody is working on is not touched.
        if (free && !row.contains(document.activeElement)) show(value === undefined ? unset[field.kind] : value);
        else if (free && document.activeElement?.type === "checkbox" && row.contains(document.activeElement)) show(value ?? false);
      }
    },
  };
}

const titles = { "": "picture", effects: "effects", lights: "lights", material: "material of everything" };

// All settings in boxes.
export function panel(into, fields, set, reset) {
  const groups = new Map();
  for (const f of fields) {
    const group = f.path.includes(".") ? f.path.split(".")[0] : "";
    groups.set(group, [...(groups.get(group) || []), f]);
  }
  const made = [...groups].map(([group, list]) => {
    const r = rows(list, "", set, reset);
    into.append(element("fieldset", { id: `group-${group || "picture"}` }, [element("legend", { textContent: titles[group] || group }), ...r.elements]));
    return r;
  });
  return { update: (program, settings, free) => made.forEach(r => r.update(program, settings, free)) };
}

export { element, hex };
