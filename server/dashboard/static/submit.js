// Sends the form as JSON and goes to the new study's page; a refusal's sentence is shown as it is.
const PLAIN = ["size", "frames", "rounds", "rays", "check", "priority"];
const LISTS = ["scenes", "devices"];
const form = document.getElementById("submit");
const problem = document.getElementById("problem");

function body() {
  const data = new FormData(form);
  const names = new Set([...form.querySelectorAll("fieldset input")].map((input) => input.name));
  LISTS.forEach((name) => names.delete(name));
  const axes = Object.fromEntries([...names].map((name) => [name, data.getAll(name)]));
  const lists = Object.fromEntries(LISTS.map((name) => [name, data.getAll(name)]));
  const plain = Object.fromEntries(PLAIN.map((name) => [name, data.get(name)]));
  return { name: "from the page", ...lists, axes, ...plain, vs_embree: data.has("vs_embree") };
}

form.addEventListener("submit", async (event) => {
  event.preventDefault();
  problem.hidden = true;
  const answer = await fetch("/api/v1/studies", {
    method: "POST",
    headers: { "Content-Type": "application/json" },
    body: JSON.stringify(body()),
  });
  const result = await answer.json();
  if (answer.ok) return location.assign(`/studies/${result.id}`);
  problem.textContent = result.detail;
  problem.hidden = false;
  problem.scrollIntoView();
});
