"use strict";
// Without this script the page shows everything at once; with it, what one asks for.
document.documentElement.classList.add("js");

for (const button of document.querySelectorAll("button[data-shows]")) {
  button.addEventListener("click", () => {
    const shown = button.getAttribute("aria-pressed") !== "true";
    button.setAttribute("aria-pressed", String(shown));
    document.querySelector(".overlay ." + button.dataset.shows).classList.toggle("shown", shown);
  });
}

const share = document.getElementById("share");
if (share) {
  const split = document.getElementById("split");
  const move = () => split.style.setProperty("--share", share.value + "%");
  share.addEventListener("input", move);
  move();
}

// A link leads to a pair that is folded away: unfold it, and fold the others.
function unfold() {
  const chosen = /^#pair-\d+$/.test(location.hash) && document.querySelector(location.hash);
  if (!chosen) return;
  for (const other of document.querySelectorAll(".pairs details[open]")) other.open = other === chosen;
  chosen.open = true;
  chosen.scrollIntoView({ block: "start" });
  chosen.querySelector("summary").focus({ preventScroll: true });
}
window.addEventListener("hashchange", unfold);
for (const link of document.querySelectorAll("a.edge")) {
  // the same link a second time changes no address
  link.addEventListener("click", () => { if (location.hash === link.getAttribute("href")) unfold(); });
}
unfold();
