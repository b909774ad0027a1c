// Sends the form as a study that compiles, and goes to its page. Refusals' sentences are shown as they are.
const form = document.getElementById("compile");
const problem = document.getElementById("problem");
let sent = null;
let key = null;

function body() {
  const data = new FormData(form);
  const axes = [...form.querySelectorAll("[data-axis]")].map(({ dataset: { axis } }) => [axis, data.getAll(axis)]);
  return {
    name: "compiled from the page",
    scenes: data.getAll("scenes"),
    axes: Object.fromEntries([...axes, ["size", data.get("size")]]),
    gpus: data.getAll("gpus"),
  };
}

// The same study sent again, as by a double click, has the same key: it is taken once.
function keyOf(text) {
  if (text !== sent) {
    key = [...crypto.getRandomValues(new Uint8Array(16))].map((byte) => byte.toString(16).padStart(2, "0")).join("");
    sent = text;
  }
  return key;
}

function refuse(sentence) {
  problem.textContent = sentence;
  problem.hidden = false;
  problem.scrollIntoView({ block: "nearest" });
}

// A page that is shown again from the browser's memory is a new page: what is sent from it is a new study.
addEventListener("pageshow", () => {
  sent = null;
});
form.addEventListener("submit", async (event) => {
  event.preventDefault();
  problem.hidden = true;
  const asked = body();
  if (asked.gpus.length === 0) {
    refuse("No GPU is ticked: tick at least one.");
    return;
  }
  const text = JSON.stringify(asked);
  try {
    const answer = await fetch("/api/v1/studies", {
      method: "POST",
      headers: { "Content-Type": "application/json", "Idempotency-Key": keyOf(text) },
      body: text,
    });
    const result = await answer.json();
    if (answer.ok) location.assign(`/studies/${result.id}`);
    else refuse(result.detail);
  } catch {
    refuse("The service does not answer.");
  }
});
