// Clears and attaches devices over the API, and loads the page anew when something has changed.
const PERIOD_MS = 3000;
const problem = document.getElementById("problem");
const form = document.getElementById("attach");
let shown = null;

async function post(address, body) {
  problem.hidden = true;
  const answer = await fetch(address, {
    method: "POST",
    headers: { "Content-Type": "application/json" },
    body: JSON.stringify(body),
  });
  if (answer.ok) return location.reload();
  problem.textContent = (await answer.json()).detail;
  problem.hidden = false;
  problem.scrollIntoView();
}

for (const button of document.querySelectorAll("[data-clear]")) {
  button.addEventListener("click", () => post(`${button.dataset.clear}/clear`, {}));
}

form.addEventListener("submit", (event) => {
  event.preventDefault();
  const { address, code } = Object.fromEntries(new FormData(form));
  if (code) post("/api/v1/devices/pair", { address, code });
  else post("/api/v1/devices", { address });
});

// Whoever types is not interrupted.
const typing = () => form.contains(document.activeElement) || [...new FormData(form).values()].some(Boolean);

async function follow() {
  try {
    const answer = await fetch("/api/v1/devices");
    const text = answer.ok ? await answer.text() : shown;
    if (shown !== null && text !== shown && !typing() && problem.hidden) return location.reload();
    shown ??= text;
  } catch {
    // The server may be restarting: ask again.
  }
  setTimeout(follow, PERIOD_MS);
}

follow();
