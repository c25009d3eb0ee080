// Formats numbers with units and SI prefixes.

const PREFIXES = [[1e-12, "p"], [1e-9, "n"], [1e-6, "µ"], [1e-3, "m"], [1, ""], [1e3, "k"], [1e6, "M"], [1e9, "G"]];

export function quantity(value, unit, digits = 3) {
  if (value === null || value === undefined || !Number.isFinite(value)) return "–";
  if (value === 0) return `0 ${unit}`;
  const size = Math.abs(value);
  let chosen = PREFIXES[0];
  for (const p of PREFIXES) if (size >= p[0] * 0.9995) chosen = p;
  return `${Number((value / chosen[0]).toPrecision(digits))} ${chosen[1]}${unit}`;
}

export const percent = (v, digits = 2) => v === null || v === undefined ? "–" : `${Number((100 * v).toPrecision(digits))} %`;
export const short = (v, digits = 4) => String(Number(v.toPrecision(digits)));

// The largest 1, 2 or 5 times a power of ten that is not above the value.
export function round125(value) {
  const power = 10 ** Math.floor(Math.log10(value));
  for (const step of [5, 2, 1]) if (step * power <= value) return step * power;
  return power;
}

// sRGB bytes of an <input type=color> to linear light.
export function linear(hex) {
  return [1, 3, 5].map(i => {
    const v = parseInt(hex.slice(i, i + 2), 16) / 255;
    return v <= 0.04045 ? v / 12.92 : ((v + 0.055) / 1.055) ** 2.4;
  });
}
