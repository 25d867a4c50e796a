"use strict";
const data = JSON.parse(document.getElementById("data").textContent);
const SVG = "http://www.w3.org/2000/svg";
const byId = (id) => document.getElementById(id);

// All text is set as text: nothing in a record can become markup.
function make(tag, attributes = {}, ...children) {
  const node = document.createElement(tag);
  for (const [name, value] of Object.entries(attributes)) node.setAttribute(name, value);
  node.append(...children);
  return node;
}
function draw(tag, attributes, ...children) {
  const node = document.createElementNS(SVG, tag);
  for (const [name, value] of Object.entries(attributes)) node.setAttribute(name, value);
  node.append(...children);
  return node;
}
// Drawn in centimetres: some browsers do not set type of less than a few units.
const cm = (metres) => Math.round(100 * metres);
const joined = (points) => points.map((p) => p.map(cm).join(",")).join(" ");

// --- tables

document.body.classList.toggle("alone", !data.tables.length && data.episodes.length === 1);

function showTables() {
  document.title = data.title;
  byId("title").textContent = data.title;
  for (const grid of data.tables) {
    const table = make("table");
    const cell = (tag) => (text, i) => make(tag, { class: i < grid.labels ? "text" : "" }, text);
    table.append(make("thead", {}, make("tr", {}, ...grid.header.map(cell("th")))));
    table.append(make("tbody", {}, ...grid.rows.map((row) => make("tr", {}, ...row.map(cell("td"))))));
    byId("tables").append(make("h2", {}, grid.title));
    if (grid.facts.length) byId("tables").append(make("p", { class: "facts" }, grid.facts.join(" · ")));
    byId("tables").append(make("div", { class: "scroll" }, table));
    for (const note of grid.notes) byId("tables").append(make("p", { class: "note" }, note));
  }
}

// --- list of episodes

let shown = [];
let current = -1;

function fill(select, values) {
  select.append(make("option", { value: "" }, "all"), ...values.map((v) => make("option", { value: v }, v)));
  select.addEventListener("change", refresh);
}

function refresh() {
  const [agent, outcome, kind] = ["agent", "outcome", "kind"].map((id) => byId(id).value);
  const words = byId("search").value.toLowerCase().split(/\s+/).filter(Boolean);
  shown = data.episodes.filter((e) =>
    (!agent || e.agent === agent) && (!outcome || (e.failure || "success") === outcome) && (!kind || e.kind === kind) &&
    words.every((word) => haystack(e).includes(word)));
  byId("count").textContent = `${shown.length} of ${data.episodes.length}`;
  byId("list").replaceChildren(...shown.slice(0, 500).map((e, i) => {
    const button = make("button", { type: "button", class: e.outcome },
      make("span", { class: "dot" }), `${e.id} `, make("small", {}, `${e.agent}, seed ${e.seed}, ${e.failure || "success"}`));
    button.addEventListener("click", () => select(i));
    return make("li", {}, button);
  }));
  if (shown.length > 500) byId("list").append(make("li", { class: "note" }, "… narrow the search to see the others"));
  if (shown.length) select(0); else byId("episode").replaceChildren("No episode fits.");
}

function haystack(e) {
  e.words ??= [e.id, e.text, e.scene, e.failure, ...e.steps.map((s) => s[0])].join(" ").toLowerCase();
  return e.words;
}

function select(index) {
  byId("list").children[current]?.firstChild?.removeAttribute?.("aria-current");
  current = index;
  const row = byId("list").children[index];
  row?.firstChild.setAttribute("aria-current", "true");
  row?.scrollIntoView?.({ block: "nearest" });
  showEpisode(shown[index]);
}

// --- one episode

let timer = null;

function showEpisode(e) {
  clearInterval(timer);
  const box = byId("episode");
  const facts = [e.scene, e.agent, e.planner, `seed ${e.seed}`, `${e.metres.toFixed(1)} m`, `planning ${e.planning} s`,
    e.attempts ? `${e.attempts} attempts` : ""].filter(Boolean).join(" · ");
  box.replaceChildren(
    make("h3", {}, make("span", { class: `dot ${e.outcome}` }), `${e.id}: ${e.failure || "success"}`),
    make("p", { class: "facts" }, facts), make("p", { class: "sentence" }, e.text));
  for (const [name, list] of [["Not met", e.unmet], ["Left", e.unsafe]])
    if (list.length) box.append(make("p", { class: "bad" }, `${name}: ${list.join(", ")}`));
  if (e.stopped) box.append(make("p", { class: "note" }, e.stopped));
  const steps = make("ol", { class: "plan" }, ...e.steps.map((s) => step(s)));
  if (e.steps.length) box.append(player(e, steps));
  const columns = make("div", { class: "columns" });
  if (e.steps.length) columns.append(make("div", {}, make("h4", {}, "Executed"), steps));
  e.tasks.forEach((task, i) => columns.append(showTask(task, i, e)));
  box.append(columns);
  if (e.error) box.append(make("pre", {}, e.error));
}

function step([action, outcome, metres, reached, , detail]) {
  const notes = [metres ? `${metres.toFixed(1)} m` : "", reached && !action.includes(reached) ? `→ ${reached}` : ""];
  const item = make("li", {}, `${action} `, make("small", { class: "note" }, notes.filter(Boolean).join(" ")));
  if (outcome !== "ok") item.append(make("span", { class: "bad" }, ` ${detail || outcome}`));
  return item;
}

function showTask(task, index, e) {
  const place = e.order.indexOf(index);
  const box = make("div", {}, make("h4", {}, `Task ${index + 1}` + (place >= 0 && e.tasks.length > 1 ? ` (done ${place + 1} of ${e.tasks.length})` : "")),
    make("p", {}, task.text), make("p", { class: "note" }, `Goal: ${task.goal.join(", ")}`));
  const list = make("ol", { class: "plan" });
  for (const [mark, action] of difference(task.proposed.length ? task.proposed : task.plan, task.plan))
    list.append(make("li", {}, mark === "=" ? action : make(mark, {}, action)));
  box.append(list);
  if (task.verdict) box.append(make("p", { class: task.verdict === "valid" ? "note" : "bad" }, task.verdict));
  for (const edit of task.edits) box.append(make("p", { class: "note" }, edit));
  return box;
}

// Longest common subsequence: what repair took out and put in.
function difference(before, after) {
  const length = Array.from({ length: before.length + 1 }, () => new Array(after.length + 1).fill(0));
  for (let i = before.length - 1; i >= 0; i--)
    for (let j = after.length - 1; j >= 0; j--)
      length[i][j] = before[i] === after[j] ? length[i + 1][j + 1] + 1 : Math.max(length[i + 1][j], length[i][j + 1]);
  const out = [];
  let [i, j] = [0, 0];
  while (i < before.length || j < after.length) {
    if (i < before.length && j < after.length && before[i] === after[j]) { out.push(["=", after[j]]); i++; j++; }
    else if (j < after.length && (i === before.length || length[i][j + 1] >= length[i + 1][j])) out.push(["ins", after[j++]]);
    else out.push(["del", before[i++]]);
  }
  return out;
}

// --- replay

function player(e, list) {
  const plan = data.scenes[e.scene];
  const box = make("div");
  const past = draw("path", { class: "past" }), now = draw("polyline", { class: "now" });
  const robot = draw("circle", { class: "robot", r: 22 });
  const pieces = {};
  if (plan) {
    const corners = plan.rooms.flatMap((room) => room.points);
    const [xs, ys] = [corners.map((p) => p[0]), corners.map((p) => p[1])];
    const [x, y] = [Math.min(...xs) - 0.4, Math.min(...ys) - 0.4];
    const size = [Math.max(...xs) - x + 0.4, Math.max(...ys) - y + 0.4];
    const svg = draw("svg", { viewBox: [x, y, ...size].map(cm).join(" "), role: "img", "aria-label": `floor plan of ${e.scene}` });
    for (const room of plan.rooms) svg.append(draw("polygon", { class: "room", points: joined(room.points), fill: room.fill }));
    for (const opening of plan.openings) svg.append(draw("polyline", { class: "opening", points: joined(opening) }));
    for (const piece of plan.pieces) {
      pieces[piece.id] = draw("polygon", { class: "piece", points: joined(piece.points), fill: piece.fill },
        draw("title", {}, piece.id));
      svg.append(pieces[piece.id]);
    }
    for (const room of plan.rooms) svg.append(draw("text", { x: cm(room.label[0]), y: cm(room.label[1]) }, room.title));
    svg.append(past, now, robot);
    box.append(svg);
  } else box.append(make("p", { class: "note" }, `The floor plan of ${e.scene} is not shipped.`));

  const slider = make("input", { type: "range", min: 0, max: e.steps.length, value: e.steps.length, "aria-label": "step" });
  const label = make("output"), play = make("button", { type: "button" }, "▶ play");
  const show = () => {
    const k = Number(slider.value);
    const routes = e.steps.slice(0, k).map((s) => s[4]).filter((r) => r.length);
    const metres = e.steps.slice(0, k).reduce((sum, s) => sum + s[2], 0);
    past.setAttribute("d", routes.map((r) => "M" + r.map((p) => p.map(cm).join(" ")).join("L")).join(""));
    now.setAttribute("points", k && e.steps[k - 1][4].length ? joined(e.steps[k - 1][4]) : "");
    const first = e.steps.find((s) => s[4].length);
    const at = routes.length ? routes.at(-1).at(-1) : first ? first[4][0] : null;
    robot.style.display = at ? "" : "none";
    if (at) { robot.setAttribute("cx", cm(at[0])); robot.setAttribute("cy", cm(at[1])); }
    for (const piece of Object.values(pieces)) piece.classList.remove("target");
    const target = k ? e.steps[k - 1][3] ?? e.steps[k - 1][0].replace(/^.*\(|\)$/g, "") : "";
    pieces[target]?.classList.add("target");
    [...list.children].forEach((item, i) => item.toggleAttribute("aria-current", false) || (i === k - 1 && item.setAttribute("aria-current", "true")));
    label.textContent = k ? `${k}/${e.steps.length} ${e.steps[k - 1][0]}, ${metres.toFixed(1)} m` : "start";
  };
  slider.addEventListener("input", show);
  const stop = () => { clearInterval(timer); play.textContent = "▶ play"; timer = null; };
  play.addEventListener("click", () => {
    if (timer) return stop();
    if (slider.value === slider.max) slider.value = 0;
    play.textContent = "❚❚ pause";
    timer = setInterval(() => {
      slider.value = Number(slider.value) + 1;
      show();
      if (slider.value === slider.max) stop();
    }, 700);
    show();
  });
  show();
  box.append(make("div", { class: "player" }, play, slider, label));
  return box;
}

showTables();
const unique = (name) => [...new Set(data.episodes.map(name))].sort();
fill(byId("agent"), unique((e) => e.agent));
fill(byId("outcome"), unique((e) => e.failure || "success"));
fill(byId("kind"), unique((e) => e.kind));
byId("search").addEventListener("input", refresh);
byId("filters").addEventListener("submit", (event) => event.preventDefault());
document.addEventListener("keydown", (event) => {
  if (["INPUT", "SELECT"].includes(document.activeElement?.tagName)) return;
  if (event.key === "j" && current + 1 < Math.min(shown.length, 500)) select(current + 1);
  if (event.key === "k" && current > 0) select(current - 1);
});
refresh();
