// Sortable tables, charts that draw themselves when there is time, and everything opened for print.

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

function fitted(spec, width) {
  // Panels side by side as far as there is room for them, else narrower ones below each other.
  if (!spec.facet) return spec;
  const axis = 60;
  const frame = spec.resolve.scale.y === "independent" ? axis : 22;
  const columns = Math.max(1, Math.min(spec.columns, Math.floor((width - axis) / (spec.spec.width + frame))));
  const panel = Math.floor((width - axis) / columns) - frame;
  return { ...spec, columns, spec: { ...spec.spec, width: Math.min(panel, 2 * spec.spec.width) } };
}

const ERRORS = 1; // what Vega logs

async function draw(plot, specs) {
  const width = plot.clientWidth;
  const config = {
    background: null,
    font: "system-ui, sans-serif",
    axis: { labelFontSize: 11, titleFontSize: 12, titleFontWeight: "normal" },
    header: { labelFontSize: 12, labelFontWeight: "bold" },
    legend: { orient: "bottom", columns: Math.max(1, Math.min(5, Math.floor(width / 150))), labelFontSize: 12, labelLimit: 200, symbolSize: 80, symbolStrokeWidth: 2 },
    view: { stroke: null },
  };
  const theme = matchMedia("(prefers-color-scheme: dark)").matches ? "dark" : "light";
  const options = { renderer: "svg", actions: false, config, tooltip: { theme }, logLevel: ERRORS };
  await vegaEmbed(plot, fitted(specs[Number(plot.dataset.chart)], width), options);
  plot.dataset.drawn = "";
}

async function drawAll() {
  const specs = read("specs");
  for (const plot of document.querySelectorAll(".plot")) {
    await draw(plot, specs);
    await new Promise((next) => setTimeout(next));
  }
}

if (document.querySelector(".plot")) requestAnimationFrame(() => setTimeout(drawAll));

let opened = [];
addEventListener("beforeprint", () => {
  opened = [...document.querySelectorAll("details:not([open])")];
  opened.forEach((part) => (part.open = true));
});
addEventListener("afterprint", () => opened.forEach((part) => (part.open = false)));
