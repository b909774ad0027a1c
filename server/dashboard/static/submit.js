// Sends the form as JSON and goes to the new study's page; before that it says what the study would be.
import { axesOf, post, send } from "./sending.js";

const PAUSE_MS = 250;
const OWN = ["frames", "rounds", "rays", "check"];
const form = document.getElementById("submit");
const own = document.getElementById("own");
const named = document.getElementById("named");
const count = document.getElementById("count");
const refused = document.getElementById("refused");
let asking = null;
let timer = null;

function body() {
  const data = new FormData(form);
  const name = data.get("study");
  const size = data.get("named_size").trim();
  const shared = { devices: data.getAll("devices"), priority: data.get("priority") };
  if (name) return { name, ...shared, ...(size && { size }) };
  return {
    name: "from the page",
    ...shared,
    scenes: data.getAll("scenes"),
    axes: { ...axesOf(form), size: data.get("size"), sah: data.get("sah") },
    ...Object.fromEntries(OWN.map((field) => [field, data.get(field)])),
    vs_embree: data.has("vs_embree"),
    models: data.has("models"),
  };
}

function number(value, word) {
  return `${value.toLocaleString("en")} ${word}${value === 1 ? "" : "s"}`;
}

function showRefused(items) {
  const reasons = Map.groupBy(items, (item) => item.reason);
  refused.hidden = items.length === 0;
  refused.querySelector("summary").textContent = `${number(items.length, "combination")} left out`;
  refused.querySelector("ul").replaceChildren(
    ...[...reasons].map(([reason, alike]) => {
      const line = document.createElement("li");
      line.textContent = `${number(alike.length, "combination")}: ${reason}`;
      return line;
    }),
  );
}

function showCount(plan) {
  const devices = plan.devices.length > 1 ? ` on ${number(plan.devices.length, "device")}` : "";
  count.className = "";
  count.textContent = `${number(plan.jobs, "job")}, ${number(plan.slices, "slice")}${devices}.`;
  showRefused(plan.refused);
}

function showWrong(sentence) {
  count.className = "wrong";
  count.textContent = sentence;
  showRefused([]);
}

async function ask() {
  asking?.abort();
  asking = new AbortController();
  try {
    const answer = await post("studies/plan", JSON.stringify(body()), {}, asking.signal);
    const result = await answer.json();
    if (answer.ok) showCount(result);
    else showWrong(result.detail);
  } catch (error) {
    if (error.name !== "AbortError") showWrong("The service does not answer.");
  }
}

function askSoon() {
  clearTimeout(timer);
  timer = setTimeout(ask, PAUSE_MS);
}

function choose() {
  const isNamed = new FormData(form).get("study") !== "";
  own.disabled = own.hidden = isNamed;
  named.hidden = !isNamed;
}

form.addEventListener("submit", async (event) => {
  event.preventDefault();
  const study = await send("studies", body());
  if (study) location.assign(`/studies/${study.id}`);
});

form.addEventListener("input", () => {
  choose();
  askSoon();
});
addEventListener("pageshow", () => {
  choose();
  ask();
});
