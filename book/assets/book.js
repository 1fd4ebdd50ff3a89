// Filters the table of the ledger page by paper, verdict, role and free text, unfolds what a link leads
// to, and lets the keyboard scroll what is wide; without this script the page shows every claim.
"use strict";

function filterLedger(form, rows) {
  const { paper, verdict, role, text } = form.elements;
  const words = text.value.toLowerCase().split(/\s+/).filter(Boolean);
  let shown = 0;
  for (const row of rows) {
    const keep =
      (!paper.value || row.dataset.paper === paper.value) &&
      (!verdict.value || row.dataset.verdict === verdict.value) &&
      (!role.value || row.dataset.role.split(" ").includes(role.value)) &&
      words.every((word) => row.textContent.toLowerCase().includes(word));
    row.hidden = !keep;
    shown += keep ? 1 : 0;
  }
  form.querySelector("output").textContent = `${shown} of ${rows.length} claims`;
}

function startLedger() {
  const form = document.querySelector("form.rcbook-filter");
  if (!form) return;
  const rows = [...document.querySelectorAll("table.rcbook-full tbody tr")];
  const asked = new URLSearchParams(window.location.search);
  for (const name of ["paper", "verdict", "role", "text"]) {
    if (asked.has(name)) form.elements[name].value = asked.get(name);
  }
  const update = () => filterLedger(form, rows);
  form.addEventListener("input", update);
  form.addEventListener("submit", (event) => event.preventDefault());
  form.addEventListener("reset", () => setTimeout(update)); // after the fields are empty
  // Whoever follows a link to one claim must see it.
  window.addEventListener("hashchange", () => {
    const target = document.getElementById(decodeURIComponent(location.hash.slice(1)));
    if (target && target.hidden) form.reset();
  });
  form.hidden = false;
  update();
}

// A link to a claim in its chapter leads to a row of a folded table.
function unfold() {
  const target = document.getElementById(decodeURIComponent(location.hash.slice(1)));
  const folded = target && target.closest("details:not([open])");
  if (!folded) return;
  folded.open = true;
  target.scrollIntoView({ block: "center" });
}

// What scrolls sideways in its own box is reached by Tab and scrolled by the arrows.
function letScroll() {
  const wide = ".highlight pre, mjx-container[display], div.math, .output, .rcbook-wide";
  for (const box of document.querySelectorAll(wide)) {
    if (box.scrollWidth > box.clientWidth && !box.hasAttribute("tabindex")) box.tabIndex = 0;
  }
}

// On a phone the rows of a table are cards, as our own tables are from the start; a table of Markdown
// or of pandas learns the names of its columns here.
function labelCells() {
  for (const table of document.querySelectorAll("article table:not(.rcbook-cards)")) {
    const heads = [...table.querySelectorAll("thead tr")];
    const names = heads.length === 1 ? [...heads[0].cells].map((cell) => cell.textContent.trim()) : [];
    const rows = [...table.querySelectorAll("tbody tr")];
    if (!names.length || rows.some((row) => row.cells.length !== names.length)) continue;
    table.classList.add("rcbook-cards");
    table.setAttribute("role", "table");
    for (const part of table.tHead ? [table.tHead, ...table.tBodies] : []) part.setAttribute("role", "rowgroup");
    for (const row of [heads[0], ...rows]) row.setAttribute("role", "row");
    for (const cell of heads[0].cells) cell.setAttribute("role", "columnheader");
    for (const row of rows) {
      [...row.cells].forEach((cell, i) => {
        cell.setAttribute("role", cell.tagName === "TH" ? "rowheader" : "cell");
        cell.dataset.label = names[i];
      });
    }
  }
}

labelCells();
startLedger();
unfold();
letScroll();
if (window.MathJax?.startup?.promise) MathJax.startup.promise.then(letScroll);
window.addEventListener("resize", letScroll);
window.addEventListener("hashchange", unfold);
