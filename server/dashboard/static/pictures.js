// The page works without this; here a change of the form shows at once, and the two pictures lie over each other.
const form = document.getElementById("controls");
const cut = document.getElementById("cut");
const FIRST = 50;

function address(changed) {
  const pairs = new URLSearchParams(new FormData(form));
  // Jobs belong to their scene, and those of a study to it: another one chooses its own.
  if (changed === "scene" || changed === "study") for (const name of ["baseline", "against", "cut"]) pairs.delete(name);
  if (changed === "study") pairs.delete("scene");
  for (const [name, value] of [...pairs]) if (value === "" || (name === "cut" && Number(value) === FIRST)) pairs.delete(name);
  return `/pictures?${pairs}`;
}

document.documentElement.classList.add("live");
form.addEventListener("change", (event) => {
  if (event.target !== cut) location.assign(address(event.target.name));
});
form.addEventListener("submit", (event) => {
  event.preventDefault();
  location.assign(address());
});

if (cut) {
  const stage = document.querySelector(".slider .stage");
  const edge = stage.querySelector(".edge");

  const show = () => {
    stage.style.setProperty("--cut", `${cut.value}%`);
    cut.setAttribute("aria-valuetext", `${cut.value} % baseline, ${100 - cut.value} % against`);
  };
  const follow = (event) => {
    const box = edge.getBoundingClientRect();
    cut.value = (100 * (event.clientX - box.left)) / box.width;
    show();
  };
  const keep = () => history.replaceState(null, "", address());

  cut.closest("label").hidden = false;
  cut.addEventListener("input", show);
  cut.addEventListener("change", keep);
  edge.addEventListener("pointerdown", (event) => {
    if (event.button !== 0) return;
    event.preventDefault();
    edge.setPointerCapture(event.pointerId);
    cut.focus({ preventScroll: true });
    follow(event);
  });
  edge.addEventListener("pointermove", (event) => {
    if (edge.hasPointerCapture(event.pointerId)) follow(event);
  });
  edge.addEventListener("pointerup", keep);
  show();
}
