// Sends the form as JSON and goes to the new study's page; before that it says what the study would be.
// Refusals' sentences are shown as they are.
const PAUSE_MS = 250;
const OWN = ["frames", "rounds", "rays", "check"];
const form = document.getElementById("submit");
const own = document.getElementById("own");
const named = document.getElementById("named");
const problem = document.getElementById("problem");
const count = document.getElementById("count");
const refused = document.getElementById("refused");
let asking = null;
let timer = null;
let sent = null;
let key = null;

function body() {
  const data = new FormData(form);
  const name = data.get("study");
  const size = data.get("named_size").trim();
  const shared = { devices: data.getAll("devices"), priority: data.get("priority") };
  if (name) return { name, ...shared, ...(size && { size }) };
  const axes = Object.fromEntries(
    [...form.querySelectorAll("[data-axis]")].map(({ dataset: { axis } }) => [axis, data.getAll(axis)]),
  );
  return {
    name: "from the page",
    ...shared,
    scenes: data.getAll("scenes"),
    axes: { ...axes, size: data.get("size"), sah: data.get("sah") },
    ...Object.fromEntries(OWN.map((field) => [field, data.get(field)])),
    vs_embree: data.has("vs_embree"),
    models: data.has("models"),
  };
}

function post(path, text, headers, signal) {
  return fetch(`/api/v1/${path}`, {
    method: "POST",
    headers: { "Content-Type": "application/json", ...headers },
    body: text,
    signal,
  });
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

// The same study sent again, as by a double click, has the same key: it is taken once.
function keyOf(text) {
  if (text !== sent) {
    const bytes = crypto.getRandomValues(new Uint8Array(16));
    key = [...bytes].map((byte) => byte.toString(16).padStart(2, "0")).join("");
    sent = text;
  }
  return key;
}

function refuse(sentence) {
  problem.textContent = sentence;
  problem.hidden = false;
  problem.scrollIntoView({ block: "nearest" });
}

form.addEventListener("submit", async (event) => {
  event.preventDefault();
  problem.hidden = true;
  const text = JSON.stringify(body());
  try {
    const answer = await post("studies", text, { "Idempotency-Key": keyOf(text) });
    const result = await answer.json();
    if (answer.ok) location.assign(`/studies/${result.id}`);
    else refuse(result.detail);
  } catch {
    refuse("The service does not answer: submit again, the study is taken once.");
  }
});

form.addEventListener("input", () => {
  choose();
  askSoon();
});
// A page that is shown again from the browser's memory is a new page: what is sent from it is a new study.
addEventListener("pageshow", () => {
  sent = null;
  choose();
  ask();
});
