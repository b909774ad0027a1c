// The form works without this; here a change shows at once, and the address stays short.
const form = document.getElementById("controls");

function address() {
  const pairs = [];
  for (const [name, value] of new FormData(form)) {
    const control = form.elements[name];
    if (value !== "" && value !== control.dataset?.default) pairs.push([name, value]);
  }
  const query = new URLSearchParams(pairs).toString();
  return query ? `/?${query}` : "/";
}

document.documentElement.classList.add("live");
form.addEventListener("change", () => location.assign(address()));
form.addEventListener("submit", (event) => {
  event.preventDefault();
  location.assign(address());
});
