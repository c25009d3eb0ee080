// Downloads. A file that cannot be made gives a message, which a plain link would not.

let busy = false;

async function fetched(kind) {
  const response = await fetch(`save/${kind}`);
  if (!response.ok) {
    const answer = await response.json().catch(() => ({}));
    throw new Error(answer.error || `the program answered ${response.status}`);
  }
  const given = /filename="([^"]+)"/.exec(response.headers.get("content-disposition") || "");
  return { name: given ? given[1] : `schlieren.${kind}`, blob: await response.blob() };
}

export function keep({ name, blob }) {
  const link = Object.assign(document.createElement("a"), { download: name });
  link.href = URL.createObjectURL(blob);
  link.click();
  // The browser reads it after this event.
  setTimeout(() => URL.revokeObjectURL(link.href), 10000);
  // For scripts that wait for a file.
  document.body.dataset.saved = `${document.body.dataset.saved || ""} ${name}`.trim();
}

// `say` gets a message, or null when all is well. One button may name several files.
export function listen(say) {
  for (const link of document.querySelectorAll("[data-save]")) {
    link.addEventListener("click", async e => {
      e.preventDefault();
      if (busy) return say("a file is being made; wait until it is there", true);
      busy = true;
      link.setAttribute("aria-busy", "true");
      say(`making ${link.dataset.name || "the file"}…`, true);
      try {
        for (const kind of link.dataset.save.split(" ")) keep(await fetched(kind));
        say(null);
      } catch (error) { say(error.message); }
      busy = false;
      link.removeAttribute("aria-busy");
      return undefined;
    });
  }
}
