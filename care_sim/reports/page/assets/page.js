// Sortable tables, and everything opened for print.

const read = (id) => JSON.parse(document.getElementById(id).textContent);

function sortTable(table, column, direction) {
  const value = (cell) => (cell.dataset.key === undefined ? null : Number(cell.dataset.key));
  const compare = (a, b) => {
    const [left, right] = [a, b].map((lines) => lines[0].cells[column]);
    const [x, y] = [value(left), value(right)];
    if (!left.textContent || !right.textContent) return !left.textContent - !right.textContent;
    if (x !== null && y !== null) return x === y ? 0 : direction * (x < y ? -1 : 1);
    if (x !== null || y !== null) return x !== null ? -1 : 1;
    return direction * left.textContent.localeCompare(right.textContent);
  };
  for (const body of table.tBodies) {
    const groups = [];
    for (const line of body.rows) {
      if (line.classList.contains("heading")) continue;
      if (line.classList.contains("attached") && groups.length) groups.at(-1).push(line);
      else groups.push([line]);
    }
    body.append(...groups.sort(compare).flat());
  }
}

for (const table of document.querySelectorAll("table.sortable")) {
  const heads = [...table.tHead.rows[0].cells];
  heads.forEach((head, column) =>
    head.firstChild.addEventListener("click", () => {
      const descending = head.getAttribute("aria-sort") === "ascending";
      heads.forEach((other) => other.removeAttribute("aria-sort"));
      head.setAttribute("aria-sort", descending ? "descending" : "ascending");
      sortTable(table, column, descending ? -1 : 1);
    }),
  );
}

let opened = [];
addEventListener("beforeprint", () => {
  opened = [...document.querySelectorAll("details:not([open])")];
  opened.forEach((part) => (part.open = true));
});
addEventListener("afterprint", () => opened.forEach((part) => (part.open = false)));
