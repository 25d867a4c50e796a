// What every part of the page uses: elements, the data, the theme.
const SVG = "http://www.w3.org/2000/svg";
const byId = (id) => document.getElementById(id);

// All text is set as text: nothing in a record can become markup.
function fill(node, attributes, children) {
  for (const [name, value] of Object.entries(attributes)) node.setAttribute(name, value);
  node.append(...children);
  return node;
}
const make = (tag, attributes = {}, ...children) => fill(document.createElement(tag), attributes, children);
const draw = (tag, attributes = {}, ...children) => fill(document.createElementNS(SVG, tag), attributes, children);
function button(text, attributes, act) {
  const node = make("button", { type: "button", ...attributes }, text);
  node.addEventListener("click", act);
  return node;
}

async function unpack() {
  const bytes = Uint8Array.from(atob(byId("data").textContent), (c) => c.charCodeAt(0));
  const stream = new Blob([bytes]).stream().pipeThrough(new DecompressionStream("gzip"));
  return new Response(stream).json();
}

// Light or dark as the system has it, until the reader chooses.
const system = matchMedia("(prefers-color-scheme: dark)");
function setTheme(chosen) {
  document.documentElement.dataset.theme = chosen || (system.matches ? "dark" : "light");
}
setTheme("");
system.addEventListener("change", () => setTheme(""));
byId("theme").addEventListener("click", () => setTheme(document.documentElement.dataset.theme === "dark" ? "light" : "dark"));
byId("keys").addEventListener("click", () => byId("help").showModal());

// --- tables, sorted by a click on a heading

function showTables(tables) {
  for (const grid of tables) {
    const head = make("tr"), body = make("tbody");
    const rows = grid.rows.map((row) => make("tr", {}, ...row.map((text, i) => make("td", { class: i < grid.labels ? "text" : "" }, text))));
    grid.header.forEach((name, i) => {
      const cell = make("th", { class: i < grid.labels ? "text" : "", scope: "col" });
      cell.append(button(name, {}, () => {
        const down = cell.getAttribute("aria-sort") === "ascending";
        for (const other of head.children) other.removeAttribute("aria-sort");
        cell.setAttribute("aria-sort", down ? "descending" : "ascending");
        const value = (row) => row.children[i].textContent;
        const number = (text) => { const n = parseFloat(text.replace(/[^\d.,-]/g, "")); return Number.isNaN(n) ? Infinity : n; };
        const compare = i < grid.labels ? (a, b) => value(a).localeCompare(value(b)) : (a, b) => number(value(a)) - number(value(b));
        body.append(...[...rows].sort((a, b) => (down ? -1 : 1) * compare(a, b)));
      }));
      head.append(cell);
    });
    body.append(...rows);
    const box = byId("tables");
    box.append(make("h2", {}, grid.title));
    if (grid.facts.length) box.append(make("p", { class: "facts" }, grid.facts.join(" · ")));
    box.append(make("div", { class: "scroll" }, make("table", {}, make("thead", {}, head), body)));
    for (const note of grid.notes) box.append(make("p", { class: "note" }, note));
  }
}
