// Sends the form as a study that compiles, and goes to its page.
import { axesOf, refuse, send } from "./sending.js";

const form = document.getElementById("compile");

form.addEventListener("submit", async (event) => {
  event.preventDefault();
  const data = new FormData(form);
  const gpus = data.getAll("gpus");
  if (gpus.length === 0) {
    refuse("No GPU is ticked: tick at least one.");
    return;
  }
  const study = await send("studies", {
    name: "compiled from the page",
    scenes: data.getAll("scenes"),
    axes: { ...axesOf(form), size: data.get("size") },
    gpus,
  });
  if (study) location.assign(`/studies/${study.id}`);
});
