// What a job's page does beside following its events: submits the job again, imports a profiler's file.
const again = document.querySelector("[data-again]");
const form = document.getElementById("import");
const wait = document.getElementById("wait");

function say(element, sentence) {
  element.textContent = sentence;
  element.hidden = false;
  element.scrollIntoView({ block: "nearest" });
}

async function refusalOf(answer) {
  try {
    return (await answer.json()).detail;
  } catch {
    return `The server answered with ${answer.status}: its log says why.`;
  }
}

again?.addEventListener("click", async () => {
  again.disabled = true;
  const problem = document.getElementById("problem");
  try {
    const answer = await fetch(again.dataset.again, {
      method: "POST",
      headers: { "Content-Type": "application/json" },
      body: again.dataset.body,
    });
    if (answer.ok) return location.assign((await answer.json()).page);
    say(problem, await refusalOf(answer));
  } catch {
    say(problem, "The server does not answer: try again.");
  }
  again.disabled = false;
});

// The column map as the API wants it: METRIC=COLUMN, @role=COLUMN, each a parameter of its own.
function mapOf(data) {
  const roles = [...data].filter(([name, value]) => name.startsWith("@") && value.trim());
  const lines = data.get("pairs").split("\n").filter((line) => line.trim());
  return [...roles.map(([role, column]) => `${role}=${column}`), ...lines];
}

form?.addEventListener("submit", async (event) => {
  event.preventDefault();
  const problem = document.getElementById("import-problem");
  const button = form.querySelector("button");
  const data = new FormData(form);
  const file = data.get("file");
  const query = new URLSearchParams({ name: file.name, format: data.get("format") });
  for (const pair of mapOf(data)) query.append("map", pair);
  problem.hidden = true;
  if (file.size > form.dataset.most * 1e6) {
    return say(problem, `The file has more than ${form.dataset.most} MB: split it, or raise RAYFARM_PROFILE_MB.`);
  }
  button.disabled = true;
  try {
    const answer = await fetch(`${form.dataset.post}?${query}`, {
      method: "POST",
      headers: { "Content-Type": "text/csv" },
      body: file,
    });
    if (answer.ok) {
      location.hash = "profiles";
      return location.reload();
    }
    say(problem, await refusalOf(answer));
  } catch {
    say(problem, "The file was not taken: the server does not answer.");
  }
  button.disabled = false;
});

// What it waited for is no longer true once its state changes.
if (wait) {
  const state = document.getElementById("state");
  const watch = new MutationObserver(() => {
    wait.hidden = state.textContent !== wait.dataset.state;
  });
  watch.observe(state, { childList: true });
}
