// The list of objects, and the material of the one that is chosen.

import { element, hex, rows } from "./controls.js";
import { number } from "./charts.js";

const shown = 200;

export class Objects {
  constructor(fields, set, reset) {
    this.fields = fields.filter(f => f.path.startsWith("material."));
    this.set = set;
    this.reset = reset;
    this.chosen = null;
    this.list = document.getElementById("objects");
    this.box = document.getElementById("object-settings");
    this.filter = document.getElementById("objects-filter");
    this.filter.addEventListener("input", () => this.program && this.update(this.program, this.settings, true));
    this.drawn = "";
  }

  choose(key) {
    this.chosen = key === this.chosen ? null : key;
    this.box.hidden = this.chosen === null;
    this.box.replaceChildren();
    if (this.chosen !== null) {
      const close = element("button", { textContent: "as all others", type: "button", id: "object-reset" });
      close.addEventListener("click", () => this.reset(`objects.${key}`));
      this.rows = rows(this.fields, `objects.${key}`, this.set, this.reset);
      this.box.append(element("fieldset", {}, [element("legend", { textContent: `material of ${key}` }), ...this.rows.elements, close]));
    }
    if (this.program) this.update(this.program, this.settings, true);
  }

  update(program, settings, free) {
    this.program = program;
    this.settings = settings;
    const text = this.filter.value.trim().toLowerCase();
    const found = program.objects.filter(o => !text || o.key.toLowerCase().includes(text) || (o.name || "").toLowerCase().includes(text));
    const changed = key => Object.keys(program.assignments).some(p => p.startsWith(`objects.${key}.`));
    const now = JSON.stringify([found.slice(0, shown), this.chosen, Object.keys(program.assignments)]);
    document.getElementById("objects-count").textContent = `${program.objects_total}${found.length > shown ? `, the largest ${shown} shown` : ""}`;
    if (now !== this.drawn) {
      this.drawn = now;
      this.list.replaceChildren(...found.slice(0, shown).map(o => {
        const swatch = element("i");
        const own = settings.objects?.[o.key]?.color || o.color;
        if (own) swatch.style.background = hex(own);
        const b = element("button", { className: "object", type: "button" }, [swatch, element("span", { className: "key", textContent: o.key }),
          element("span", { className: "name", textContent: o.name }), element("span", { className: "count", textContent: `${number(o.triangles)} triangles` })]);
        b.dataset.key = o.key;
        b.classList.toggle("changed", changed(o.key));
        b.setAttribute("aria-pressed", o.key === this.chosen);
        b.addEventListener("click", () => this.choose(o.key));
        return b;
      }));
    }
    if (this.chosen !== null) this.rows.update(program, settings, free);
  }
}
