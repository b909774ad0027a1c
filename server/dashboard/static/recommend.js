// Sends the form as JSON and goes to the new recommendation's page.
import { axesOf, send } from "./sending.js";

const FIELDS = ["scene", "device", "rays", "size", "error_budget", "rounds"];
const form = document.getElementById("recommend");

form.addEventListener("submit", async (event) => {
  event.preventDefault();
  const data = new FormData(form);
  const memory = data.get("memory_budget").trim();
  const made = await send("recommendations", {
    ...Object.fromEntries(FIELDS.map((field) => [field, data.get(field)])),
    ...(memory && { memory_budget: memory }),
    axes: axesOf(form),
  });
  if (made) location.assign(made.page);
});
