// Follows a study or a job until it ends, then loads the page once more for its final form.
const OPEN = ["queued", "running"];
const PERIOD_MS = 1000;
const title = document.querySelector("[data-watch]");

function setState(element, state) {
  if (element.textContent === state) return;
  element.textContent = state;
  element.className = `state ${state}`;
}

function showJob(job) {
  const row = document.querySelector(`tr[data-job="${job.id}"]`);
  if (!row) return;
  setState(row.querySelector(".state"), job.state);
  row.querySelector(".reason").textContent = job.reason ?? "";
}

function show(view) {
  setState(document.getElementById("state"), view.state);
  document.getElementById("progress").value = view.slices.done;
  document.getElementById("slices").textContent = `${view.slices.done} of ${view.slices.total} slices`;
  for (const job of Array.isArray(view.jobs) ? view.jobs : []) showJob(job);
}

async function follow() {
  try {
    const view = await (await fetch(title.dataset.watch)).json();
    show(view);
    if (!OPEN.includes(view.state)) return location.reload();
  } catch {
    // The server may be restarting: ask again.
  }
  setTimeout(follow, PERIOD_MS);
}

if (OPEN.includes(title.dataset.state)) setTimeout(follow, PERIOD_MS);
