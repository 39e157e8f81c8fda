// Tables whose headings sort them, and buttons that copy a text. A column that was sorted shows it
// by aria-sort; the same heading again turns the order round.
"use strict";
(() => {
  // A value to sort by: what the cell carries, or the number that its text begins with, or the text.
  const valueOf = (cell) => {
    const text = (cell?.dataset.value ?? cell?.textContent ?? "").trim();
    const number = Number.parseFloat(text.replace("−", "-"));
    return Number.isNaN(number) ? text : number;
  };
  const compare = (a, b) => {
    if (typeof a === "number" && typeof b === "number") return a - b;
    if (typeof a !== typeof b) return typeof a === "number" ? -1 : 1;
    return a.localeCompare(b);
  };
  const sort = (head) => {
    const table = head.closest("table");
    const column = [...head.parentNode.children].indexOf(head);
    const up = head.getAttribute("aria-sort") !== "ascending";
    for (const other of head.parentNode.children) other.removeAttribute("aria-sort");
    head.setAttribute("aria-sort", up ? "ascending" : "descending");
    const [body] = table.tBodies;
    const rows = [...body.rows].map((row) => [valueOf(row.cells[column]), row]);
    rows.sort(([a], [b]) => (up ? compare(a, b) : compare(b, a)));
    body.append(...rows.map(([, row]) => row));
  };
  for (const table of document.querySelectorAll("table.numbers, table.sortable")) {
    for (const head of table.tHead?.rows[0]?.cells ?? []) {
      if (!head.textContent.trim()) continue;
      let button = head.querySelector("button");
      if (!button) {
        button = document.createElement("button");
        button.type = "button";
        button.append(...head.childNodes);
        head.append(button);
      }
      button.title ||= "Sort by this column";
      button.addEventListener("click", () => sort(head));
    }
  }

  for (const button of document.querySelectorAll("button[data-copies]")) {
    button.addEventListener("click", () => {
      const text = document.getElementById(button.dataset.copies).textContent;
      const said = button.textContent;
      const done = (words) => {
        button.textContent = words;
        setTimeout(() => { button.textContent = said; }, 1500);
      };
      const select = () => {  // where a page from disk may not reach the clipboard
        const range = document.createRange();
        range.selectNodeContents(document.getElementById(button.dataset.copies));
        const selection = window.getSelection();
        selection.removeAllRanges();
        selection.addRange(range);
        done(document.execCommand("copy") ? "Copied" : "Selected");
      };
      if (navigator.clipboard) navigator.clipboard.writeText(text).then(() => done("Copied"), select);
      else select();
    });
  }
  // A link to something that is folded away opens it.
  const open = () => {
    const place = location.hash.includes("=") ? null : document.getElementById(decodeURIComponent(location.hash.slice(1)));
    const folded = place?.closest("details");
    if (folded) { folded.open = true; place.scrollIntoView(); }
  };
  window.addEventListener("hashchange", open);
  open();
})();
