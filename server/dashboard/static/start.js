// Submits the demo study and goes to its page.
const button = document.getElementById("demo");
const problem = document.getElementById("problem");

button.addEventListener("click", async () => {
  button.disabled = true;
  problem.hidden = true;
  const answer = await fetch("/api/v1/studies", {
    method: "POST",
    headers: { "Content-Type": "application/json" },
    body: JSON.stringify({ name: "demo" }),
  });
  const result = await answer.json();
  if (answer.ok) return location.assign(`/studies/${result.id}`);
  problem.textContent = result.detail;
  problem.hidden = false;
  button.disabled = false;
});
