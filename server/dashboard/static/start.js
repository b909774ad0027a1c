// Submits the demo study and goes to its page.
import { send } from "./sending.js";

const button = document.getElementById("demo");

button.addEventListener("click", async () => {
  button.disabled = true;
  const study = await send("studies", { name: "demo" });
  if (study) location.assign(`/studies/${study.id}`);
  else button.disabled = false;
});
