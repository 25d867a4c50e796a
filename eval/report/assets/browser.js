// Choosing an episode: filters, list, permalinks, keyboard.
const MOST_SHOWN = 400;
const SORTS = new Map([
  ["in order", null], ["most metres", (a, b) => b.metres - a.metres], ["fewest metres", (a, b) => a.metres - b.metres],
  ["slowest planning", (a, b) => b.planning - a.planning], ["most calls", (a, b) => b.attempts - a.attempts], ["failures first", (a, b) => (a.outcome === "success") - (b.outcome === "success")],
]);
const FILTERS = { agent: (e) => e.agent, planner: (e) => e.planner, scene: (e) => e.scene, outcome: (e) => e.outcome, failure: (e) => e.failure, kind: (e) => e.kind };
let data, shown = [], current = -1;

const permalink = (e, step) => `#/${[e.id, e.seed, e.config, step].map(encodeURIComponent).join("/")}`;

function readLink() {
  const [mark, id, seed, config, step] = location.hash.split("/").map(decodeURIComponent);
  if (mark !== "#" || !id) return null;
  const episode = data.episodes.find((e) => e.id === id && String(e.seed) === seed && e.config === config);
  return episode ? { episode, step: Number(step) || 0 } : null;
}

function haystack(e) {
  e.words ??= [e.id, e.text, e.scene, e.failure, ...e.steps.map((s) => s[0])].join(" ").toLowerCase();
  return e.words;
}

function refresh(wanted) {
  const chosen = Object.keys(FILTERS).map((id) => [FILTERS[id], byId(id).value]).filter(([, value]) => value);
  const words = byId("search").value.toLowerCase().split(/\s+/).filter(Boolean);
  shown = data.episodes.filter((e) => chosen.every(([of, value]) => of(e) === value) && words.every((word) => haystack(e).includes(word)));
  const compare = SORTS.get(byId("sort").value);
  if (compare) shown.sort(compare);
  byId("count").textContent = `${shown.length} of ${data.episodes.length}`;
  byId("list").replaceChildren(...shown.slice(0, MOST_SHOWN).map((e, i) => make("li", {}, listed(e, i))));
  if (shown.length > MOST_SHOWN) byId("list").append(make("li", { class: "note" }, "… narrow the search to see the others"));
  if (!shown.length) return byId("episode").replaceChildren("No episode fits.");
  const index = wanted ? shown.indexOf(wanted.episode) : 0;
  select(Math.max(0, index), wanted?.step, Boolean(wanted));
}

function listed(e, i) {
  return fill(button("", { class: e.outcome }, () => select(i)), {},
    [make("span", { class: "sign" }, signOf(e)), e.id, make("small", {}, `${e.agent}, seed ${e.seed}, ${e.failure || "success"}, ${e.metres.toFixed(1)} m`)]);
}

function select(index, step, reveal = true) {
  byId("list").children[current]?.firstChild?.removeAttribute?.("aria-current");
  current = index;
  const row = byId("list").children[index];
  row?.firstChild.setAttribute("aria-current", "true");
  const list = byId("list");
  if (reveal && row) list.scrollTop = Math.max(0, row.offsetTop - list.clientHeight / 2);  // the page itself stays where it is
  showEpisode(shown[index], step);
}

function keyboard(event) {
  if (event.ctrlKey || event.metaKey || event.altKey || byId("help").open) return;
  if (["INPUT", "SELECT"].includes(event.target.tagName) && event.target.type !== "range") return;
  if (event.key === " " && event.target.tagName === "BUTTON") return;
  const acts = {
    j: () => current + 1 < Math.min(shown.length, MOST_SHOWN) && select(current + 1), k: () => current > 0 && select(current - 1),
    "/": () => byId("search").focus(), "?": () => byId("help").showModal(), ...playerKeys,
  };
  if (!Object.hasOwn(acts, event.key)) return;
  event.preventDefault();
  acts[event.key]();
}

unpack().then((unpacked) => {
  data = unpacked;
  document.title = byId("title").textContent = data.title;
  document.body.classList.toggle("alone", !data.tables.length && data.episodes.length === 1);
  showCharts(data.charts);
  showTables(data.tables);
  for (const [id, of] of Object.entries(FILTERS)) {
    const values = [...new Set(data.episodes.map(of))].filter(Boolean).sort();
    byId(id).append(make("option", { value: "" }, "all"), ...values.map((v) => make("option", { value: v }, v)));
    byId(id).parentElement.hidden = values.length < 2;
    byId(id).addEventListener("change", () => refresh());
  }
  byId("sort").append(...[...SORTS.keys()].map((name) => make("option", {}, name)));
  byId("sort").addEventListener("change", () => refresh());
  byId("search").addEventListener("input", () => refresh());
  byId("filters").addEventListener("submit", (event) => event.preventDefault());
  document.addEventListener("keydown", keyboard);
  byId("loading").remove();
  byId("results").hidden = !data.tables.length;
  byId("episodes").hidden = false;
  const wanted = readLink();
  refresh(wanted);
  if (wanted) byId("episodes").scrollIntoView();
  addEventListener("hashchange", () => {
    const link = readLink();
    if (link && shown[current] !== link.episode) refresh(link);
  });
}).catch((error) => { (byId("loading") ?? byId("episode")).textContent = `The data of this page cannot be shown: ${error.message}`; throw error; });
