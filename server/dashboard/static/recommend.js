// Sends the form as JSON and goes to the new recommendation's page. A refusal's sentence is shown as it is.
const FIELDS = ["scene", "device", "rays", "size", "error_budget", "rounds"];
const form = document.getElementById("recommend");
const problem = document.getElementById("problem");
let sent = null;
let key = null;

function body() {
  const data = new FormData(form);
  const memory = data.get("memory_budget").trim();
  const axes = [...form.querySelectorAll("[data-axis]")].map(({ dataset: { axis } }) => [axis, data.getAll(axis)]);
  return {
    ...Object.fromEntries(FIELDS.map((field) => [field, data.get(field)])),
    ...(memory && { memory_budget: memory }),
    axes: Object.fromEntries(axes),
  };
}

form.addEventListener("submit", async (event) => {
  event.preventDefault();
  problem.hidden = true;
  const text = JSON.stringify(body());
  // The same request keeps its key, so that a second click is taken for the first.
  if (text !== sent) [sent, key] = [text, `page-${Date.now()}-${Math.random().toString(36).slice(2)}`];
  const answer = await fetch("/api/v1/recommendations", {
    method: "POST",
    headers: { "Content-Type": "application/json", "Idempotency-Key": key },
    body: text,
  });
  const result = await answer.json();
  if (answer.ok) return location.assign(result.page);
  problem.textContent = result.detail;
  problem.hidden = false;
});
