// The form works without this; here a change shows at once, and the address keeps what was chosen.
const form = document.getElementById("controls");
document.documentElement.classList.add("live");
form.addEventListener("change", () => form.requestSubmit());
