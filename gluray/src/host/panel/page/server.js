// Talking to the panel: news as they come, changes one at a time with later ones merged meanwhile.

let onError = () => {};
export const listen = error => { onError = error; };

export async function get(path) {
  const response = await fetch(path);
  if (response.status === 204) return null;
  const answer = await response.json().catch(() => ({}));
  if (!response.ok) throw new Error(answer.error || `the panel answered ${response.status}`);
  return answer;
}

export async function post(path, body) {
  const response = await fetch(path, { method: "POST", body: JSON.stringify(body) });
  const answer = await response.json().catch(() => ({}));
  if (!response.ok) throw new Error(answer.error || `the panel answered ${response.status}`);
  return answer;
}

const waiting = new Map();
let busy = false;

// `set` is an object of paths and values, `reset` a list of paths whose changes are taken back.
export async function change(id, set, reset = []) {
  const last = waiting.get(id) || { set: {}, reset: [] };
  for (const path of reset) {
    for (const p of Object.keys(last.set)) if (p === path || p.startsWith(path + ".")) delete last.set[p];
    last.reset.push(path);
  }
  Object.assign(last.set, set);
  waiting.set(id, last);
  if (busy) return;
  busy = true;
  while (waiting.size) {
    const [next, what] = waiting.entries().next().value;
    waiting.delete(next);
    try { await post("change", { id: next, set: what.set, reset: what.reset }); onError(null); }
    catch (e) { onError(e.message); }
  }
  busy = false;
}

// True while the page knows of changes that the panel does not.
export const pending = () => busy;

export async function news(show, lost) {
  for (let after = 0, failures = 0; ;) {
    try {
      const state = await get(`state?after=${after}`);
      if (failures) { failures = 0; lost(false); }
      if (state) { after = state.news; show(state); }
      // Between two states the browser must have time to draw.
      await new Promise(r => setTimeout(r, 0));
    } catch (e) {
      failures += 1;
      lost(true, e);
      await new Promise(r => setTimeout(r, Math.min(5000, 250 * failures)));
    }
  }
}
