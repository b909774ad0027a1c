// What pages that submit work share. A refusal's sentence is shown as it is.
const problem = document.getElementById("problem");
let sent = null;
let key = null;

// What is ticked on each axis of a form.
export function axesOf(form) {
  const data = new FormData(form);
  const axes = [...form.querySelectorAll("[data-axis]")];
  return Object.fromEntries(axes.map(({ dataset: { axis } }) => [axis, data.getAll(axis)]));
}

export function post(path, text, headers, signal) {
  return fetch(`/api/v1/${path}`, {
    method: "POST",
    headers: { "Content-Type": "application/json", ...headers },
    body: text,
    signal,
  });
}

export function refuse(sentence) {
  problem.textContent = sentence;
  problem.hidden = false;
  problem.scrollIntoView({ block: "nearest" });
}

// The same work sent again, as by a double click, has the same key: it is taken once.
function keyOf(text) {
  if (text !== sent) {
    const bytes = crypto.getRandomValues(new Uint8Array(16));
    key = [...bytes].map((byte) => byte.toString(16).padStart(2, "0")).join("");
    sent = text;
  }
  return key;
}

// What was made of `asked`, or null where it was refused, which the page then says.
export async function send(path, asked) {
  problem.hidden = true;
  const text = JSON.stringify(asked);
  try {
    const answer = await post(path, text, { "Idempotency-Key": keyOf(text) });
    const result = await answer.json();
    if (answer.ok) return result;
    refuse(result.detail);
  } catch {
    refuse("The service does not answer: send it again, it is taken once.");
  }
  return null;
}

// A page that is shown again from the browser's memory is a new page: what is sent from it is new.
addEventListener("pageshow", () => {
  sent = null;
});
