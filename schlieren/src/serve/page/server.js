// Communicates with the program: sends one change at a time and merges later ones meanwhile; receives frames.

let onState = () => {}, onError = () => {};
let waiting = null, busy = false;

export function listen(state, error) { onState = state; onError = error; }

// Replaces objects that select a kind, and the transfer functions together, as a whole, as the program does.
function merge(into, patch) {
  for (const [key, value] of Object.entries(patch)) {
    const nested = value && typeof value === "object" && !Array.isArray(value);
    if (nested && key !== "multifield" && !("kind" in value) && !("method" in value) && into[key] && typeof into[key] === "object") merge(into[key], value);
    else into[key] = value;
  }
  return into;
}

async function call(path, body) {
  const response = await fetch(path, body === undefined ? {} : { method: "POST", body: JSON.stringify(body) });
  const answer = await response.json().catch(() => ({ error: `the program answered ${response.status}` }));
  if (!response.ok) throw new Error(answer.error || `the program answered ${response.status}`);
  return answer;
}

// The frame is chosen or fitted: the later wish counts.
function choose(patch) {
  const keys = ["size", "field_of_view_m", "center_m"], film = waiting?.film;
  if (patch.fit && film) for (const key of keys) delete film[key];
  if (waiting && keys.some(key => patch.film && key in patch.film)) delete waiting.fit;
}

export async function change(patch) {
  choose(patch);
  waiting = waiting ? merge(waiting, patch) : structuredClone(patch);
  if (busy) return;
  busy = true;
  while (waiting) {
    const next = waiting;
    waiting = null;
    try { onState(await call("scene", next)); onError(null); }
    catch (e) {
      onError(e.message);
      try { onState(await call("state"), true); }
      catch { /* `frames` reports a lost connection. */ }
    }
  }
  busy = false;
}

export const refresh = async () => onState(await call("state"));
export const trace = at => call("trace", { at });
export const profile = (from, to) => call("profile", { from, to });

// To the last scene that was shown.
export async function back() {
  try { onState(await call("back", {}), true); onError(null); } catch (e) { onError(e.message); }
}

// Strokes are sent one after the other, so that later ones cover earlier ones.
let strokes = Promise.resolve();
export function paint(request) {
  strokes = strokes.then(() => call("paint", request)).then(async answer => {
    if (answer.note) onError(answer.note, true);
    await refresh();
    return answer;
  }).catch(e => onError(e.message));
  return strokes;
}

function decode(buffer) {
  const view = new DataView(buffer), length = view.getUint32(0, true);
  const info = JSON.parse(new TextDecoder().decode(new Uint8Array(buffer, 4, length)));
  let at = 4 + length;
  const take = n => { const bytes = new Uint8Array(buffer, at, n); at += n; return bytes; };
  const rgb = take(3 * info.width * info.height), n = info.filter_pixels * info.filter_pixels;
  const filter = take(3 * n);
  const light = new Float32Array(buffer.slice(at, at + 4 * n));
  at += 4 * n;
  return { info, rgb, filter, light, legend: take(3 * info.legend_size[0] * info.legend_size[1]) };
}

export async function frames(show, lost) {
  for (let after = 0, failures = 0; ;) {
    try {
      const response = await fetch(`frame?after=${after}`);
      if (failures) { failures = 0; lost(false); await refresh(); }
      if (response.status === 204) continue;
      if (!response.ok) throw new Error(`frame: ${response.status}`);
      const frame = decode(await response.arrayBuffer());
      after = frame.info.serial;
      show(frame);
      // Gives the browser time to draw between two frames.
      await new Promise(r => setTimeout(r, 0));
    } catch (e) {
      failures += 1;
      lost(true, e);
      await new Promise(r => setTimeout(r, Math.min(5000, 250 * failures)));
    }
  }
}
