// Explanations, shown while the pointer or the keyboard is on what they explain.

export const TECHNIQUES = {
  "shadowgraph": "Light falls on a film behind the flow. Where rays spread, it gets darker: the "
    + "image shows the second derivative of the density. Shocks are dark and bright lines.",
  "schlieren": "A lens focuses the light on a cut-off. Bent rays miss it or hit it: the image "
    + "shows the first derivative of the density, across the knife's edge.",
  "interferogram": "The light interferes with light that passed no flow. Each fringe is one "
    + "wavelength of optical path: the image shows the density itself, summed along the light.",
  "bos": "Background-oriented schlieren: a camera looks through the flow at dots. They seem to "
    + "move by the deflection times the distance; vectors show by how much.",
  "volume": "For comparison, without optics: smoke where the gradient of the density is large. "
    + "Its brightness is no measured quantity.",
  "slice": "For comparison, without optics: the gradient of the density on one plane, as most "
    + "flow programs draw it. Its brightness is no measured quantity.",
};

export const ROWS = {
  "technique": "How light becomes an image. Hold the pointer over a name for its explanation.",
  "cut-off": "What stands where the light is focused: a knife's edge, an iris, a spot that stops "
    + "undisturbed light, a colour filter, or a filter that you paint.",
  "opens towards": "The direction into which bent light gets past the knife and is brighter.",
  "left open": "How much of the source's image the knife lets through: the brightness of "
    + "undisturbed light. Less is more sensitive.",
  "saturated at": "Distance from the axis at which colours are full; smaller is more sensitive.",
  "light source": "Its shape. A smaller source makes schlieren more sensitive.",
  "collimator f₁": "The lens that makes the source's light parallel; a longer one makes the "
    + "source's image smaller and the bench more sensitive.",
  "schlieren lens f₂": "The lens behind the flow, which focuses the light on the cut-off.",
  "film distance": "From the middle of the flow; farther away is more sensitive and less sharp.",
  "background at": "Distance of the dots behind the flow; farther away they move more.",
  "vectors": "Drawn over the image with a scale: arrows, or lines along them (line integral "
    + "convolution) in the colours of their lengths. With bos, how far dots move; else how far "
    + "light is bent.",
  "wavelengths": "In vacuum, separated by commas. Each is traced by itself.",
  "fit the flow": "The image takes the flow's shape, also when it is turned.",
  "exposure": "Factor from light to brightness.",
  "photons per pixel": "More photons, less noise. Noise-free traces a lattice of rays instead.",
  "tolerance": "Largest accepted error of a deflection. A warning says when it is not kept.",
  "index from": "Which arrays of the file the index of refraction is computed from.",
  "outside the mesh": "What is where the data end: auto takes walls for bodies and open borders "
    + "for gas.",
  "hidden cells": "What cells are that the solver hides, as those of an overset mesh.",
  "between points": "Values between the points of a mesh: cubic is smooth, linear bends light at "
    + "the faces of its cells.",
  "on cells": "Light goes through the cells of the file themselves, and not through a lattice.",
  "smoothing": "Standard deviation of a smoothing of the density, for shocks that are one cell "
    + "wide; 0 for none.",
  "average jumps": "Jumps from one node to the next become averages over cells, which shocks "
    + "sampled at points need.",
  "resample to": "Nodes along the longest side of the lattice that light is traced through.",
};

const tip = document.createElement("div");
tip.id = "tip";
tip.setAttribute("role", "tooltip");
tip.hidden = true;
document.body.append(tip);
let owner = null;

function hide() {
  owner?.removeAttribute("aria-describedby");
  owner = null;
  tip.hidden = true;
}

function explain(target) {
  const on = target?.closest?.("[data-help]") ?? null;
  if (on === owner) return;
  hide();
  if (!on) return;
  owner = on;
  owner.setAttribute("aria-describedby", tip.id);
  tip.textContent = on.dataset.help;
  tip.hidden = false;
  put();
}

function put() {
  const at = owner.getBoundingClientRect(), size = tip.getBoundingClientRect();
  // Beside what stands in the right column, so that its neighbours stay readable; else below.
  const beside = at.left - size.width - 14, isBeside = at.left > innerWidth / 2 && beside > 8;
  const left = isBeside ? beside : Math.max(8, Math.min(at.left, innerWidth - size.width - 8));
  const top = isBeside ? at.top : at.bottom + 6;
  tip.style.left = `${left}px`;
  tip.style.top = `${Math.max(4, Math.min(top, innerHeight - size.height - 4))}px`;
}

document.addEventListener("mouseover", e => explain(e.target));
document.addEventListener("focusin", e => {
  // A click has its own pointer, which decides.
  if (e.target.matches(":focus-visible")) explain(e.target);
});
document.addEventListener("focusout", hide);
document.addEventListener("scroll", () => {
  // What is explained stays so while the pointer is on it.
  if (owner?.matches(":hover")) put(); else hide();
}, { passive: true });
document.addEventListener("keydown", e => { if (e.key === "Escape") hide(); });
