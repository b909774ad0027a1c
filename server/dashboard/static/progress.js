// Follows a study's or a job's events until it ends, then loads the page once more for its final form; cancels it.
const AGAIN_MS = 3000;
const OVER = ".state.done, .state.failed, .state.cancelled";
const title = document.querySelector("[data-events]");
const isJob = "job" in title.dataset;
let last = title.dataset.after;
let source = null;

function setState(element, state) {
  element.textContent = state;
  element.className = `state ${state}`;
}

function showRow(change) {
  const row = document.querySelector(`tr[data-job="${change.job}"]`);
  if (!row) return;
  setState(row.querySelector(".state"), change.state);
  row.querySelector(".reason").textContent = change.reason ?? "";
  const group = row.closest("details.jobs");
  if (group) group.querySelector("[data-ended]").textContent = group.querySelectorAll(OVER).length;
}

function showHistory(change) {
  const entry = document.getElementById("change").content.cloneNode(true);
  const time = entry.querySelector("time");
  time.dateTime = change.at;
  time.textContent = change.at.slice(0, 19).replace("T", " ");
  setState(entry.querySelector(".state"), change.state);
  entry.querySelector(".reason").textContent = change.reason ?? "";
  document.querySelector(".history").append(entry);
}

function showProgress({ done, total }, left) {
  document.getElementById("progress").value = done;
  document.getElementById("slices").textContent = `${done} of ${total} slices`;
  document.getElementById("left").textContent = left ?? "";
}

function showJob(change) {
  setState(document.getElementById("state"), change.state);
  document.getElementById("reason").textContent = change.reason ?? "";
  showHistory(change);
}

function show(event) {
  const change = JSON.parse(event.data);
  last = event.lastEventId;
  if (isJob) {
    showProgress(change.progress, null);
    showJob(change);
  } else {
    showProgress(change.study_progress, change.study_left);
    showRow(change);
  }
}

// A browser opens six connections to a host at most: a tab that nobody sees gives its own back.
function listen() {
  source?.close();
  if (document.hidden) return;
  source = new EventSource(`${title.dataset.events}?after=${last}`);
  source.addEventListener("change", show);
  // Its session has ended when it is refused: the page that is loaded then is the login.
  for (const over of ["end", "refused"]) {
    source.addEventListener(over, () => {
      source.close();
      location.reload();
    });
  }
  source.addEventListener("error", () => {
    // After a refusal, as of a server that is starting, the browser does not try again by itself.
    if (source.readyState === EventSource.CLOSED) setTimeout(listen, AGAIN_MS);
  });
}

document.querySelector("[data-cancel]")?.addEventListener("click", async ({ target }) => {
  target.disabled = true;
  const answer = await fetch(target.dataset.cancel, { method: "POST", headers: { "Content-Type": "application/json" } });
  if (answer.ok) return location.reload();
  const problem = document.getElementById("problem");
  problem.textContent = (await answer.json()).detail;
  problem.hidden = false;
});

if ("open" in title.dataset) {
  document.addEventListener("visibilitychange", listen);
  listen();
}
