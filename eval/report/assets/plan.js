// The floor plan of an episode: house, beliefs as heat over the rooms, things, the robot with its camera, its route.
// Drawn in centimetres: some browsers do not set type of less than a few units.
const cm = (metres) => Math.round(100 * metres);
const joined = (points) => points.map((p) => p.map(cm).join(",")).join(" ");
const [HALF_VIEW, VIEW_M] = [31.7 * Math.PI / 180, 2.2];

const targetOf = (action) => action.replace(/^.*\(|\)$/g, "");
const verbOf = (action) => action.replace(/\(.*$/, "");

// Where everything is after k whole steps and a share of the next one.
function stateAt(e, places, k, share) {
  const things = new Map(Object.entries(e.things));
  let [held, at, heading, metres] = [null, e.start ?? e.steps.find((s) => s[4].length)?.[4][0] ?? null, 0, 0];
  const named = (name) => things.has(name) ? name : [...things.keys()].find((id) => id.replace(/_\d+$/, "") === name.split("@")[0]);
  for (let i = 0; i < Math.min(e.steps.length, k + (share > 0 ? 1 : 0)); i++) {
    const [action, outcome, driven, , route] = e.steps[i];
    const part = i < k ? 1 : share;
    if (route.length > 1) [at, heading] = along(route, part);
    metres += driven * part;
    if (outcome !== "ok" || part < 1) continue;
    const target = targetOf(action);
    if (verbOf(action) === "GRASP") held = named(target) ?? null;
    else if (held && /^(PLACE|RELEASE)/.test(action)) {
      things.set(held, places.get(target) ?? things.get(named(target)) ?? at);
      held = null;
    }
  }
  if (held && at) things.set(held, at);
  return { things, held, at, heading, metres };
}

// The point at a share of a route's length, and the direction there.
function along(route, share) {
  const lengths = route.slice(1).map((p, i) => Math.hypot(p[0] - route[i][0], p[1] - route[i][1]));
  let left = share * lengths.reduce((a, b) => a + b, 0);
  for (let i = 0; i < lengths.length; i++) {
    const [a, b] = [route[i], route[i + 1]];
    if (left <= lengths[i] || i === lengths.length - 1) {
      const t = lengths[i] ? Math.min(1, left / lengths[i]) : 1;
      return [[a[0] + t * (b[0] - a[0]), a[1] + t * (b[1] - a[1])], Math.atan2(b[1] - a[1], b[0] - a[0])];
    }
    left -= lengths[i];
  }
  return [route[0], 0];
}

// Node -> rooms with their probabilities after k steps, of nodes that are uncertain then.
function beliefsAt(e, k) {
  const found = new Map();
  for (const [step, node, rooms] of e.beliefs) if (step <= k) {
    if (Object.keys(rooms).length > 1) found.set(node, new Map(Object.entries(rooms)));
    else found.delete(node);
  }
  return found;
}

function floorPlan(e) {
  const plan = Object.hasOwn(data.scenes, e.scene) ? data.scenes[e.scene] : null;
  if (!plan) return null;
  const corners = plan.rooms.flatMap((room) => room.points);
  const [xs, ys] = [corners.map((p) => p[0]), corners.map((p) => p[1])];
  const [x, y] = [Math.min(...xs) - 0.4, Math.min(...ys) - 0.4];
  const size = [Math.max(...xs) - x + 0.4, Math.max(...ys) - y + 0.4];
  const svg = draw("svg", { class: "plan", viewBox: [x, y, ...size].map(cm).join(" "), role: "img", "aria-label": `floor plan of ${e.scene}` });
  svg.style.setProperty("--type", Math.max(28, 10.5 * cm(size[0]) / Math.max(280, Math.min(760, byId("episode").clientWidth - 30))));
  const heat = new Map(), percent = new Map(), pieces = new Map(), places = new Map(Object.entries(plan.places));
  for (const room of plan.rooms) {
    svg.append(draw("polygon", { class: "room", points: joined(room.points), style: `--fill:${room.fill}` }));
    heat.set(room.id, draw("polygon", { class: "heat", points: joined(room.points), "fill-opacity": 0 }));
    svg.append(heat.get(room.id));
  }
  for (const opening of plan.openings) svg.append(draw("polyline", { class: "opening", points: joined(opening) }));
  for (const piece of plan.pieces) {
    const shape = draw("polygon", { class: "piece", points: joined(piece.points), style: `--fill:${piece.fill}` }, draw("title", {}, piece.id));
    pieces.set(piece.id, shape);
    svg.append(shape);
  }
  for (const room of plan.rooms) {
    const [cx, cy] = room.label.map(cm);
    percent.set(room.id, draw("text", { class: "percent", x: cx, y: cy, dy: "1.15em" }));
    svg.append(draw("text", { x: cx, y: cy }, room.title), percent.get(room.id));
  }
  const past = draw("path", { class: "past" }), now = draw("path", { class: "now" }), arrow = draw("path", { class: "arrow" });
  const start = draw("circle", { class: "start", r: 20 }), wedge = draw("path", { class: "wedge" }), robot = draw("path", { class: "robot" });
  const things = new Map();
  svg.append(past, now, arrow, start, wedge);
  for (const id of Object.keys(e.things)) {
    things.set(id, draw("g", { class: "thing" }, draw("circle", { r: 13 }), draw("text", { class: "name", y: -20 }, id.replace(/_\d+$/, "").replaceAll("_", " "))));
    svg.append(things.get(id));
  }
  svg.append(robot);
  const first = e.start ?? e.steps.find((s) => s[4].length)?.[4][0];
  if (first) { start.setAttribute("cx", cm(first[0])); start.setAttribute("cy", cm(first[1])); } else start.remove();

  function show(k, share, node) {
    const state = stateAt(e, places, k, share);
    const path = (routes) => routes.map((r) => `M${r.map((p) => p.map(cm).join(" ")).join("L")}`).join("");
    const done = e.steps.slice(0, k).map((s) => s[4]).filter((r) => r.length);
    past.setAttribute("d", path(done));
    const current = share > 0 ? e.steps[k]?.[4] : e.steps[k - 1]?.[4];
    now.setAttribute("d", current?.length ? path([current]) : "");
    const [middle, direction] = current?.length > 1 ? along(current, 0.55) : [null, 0];
    arrow.setAttribute("d", middle ? "M26 0L-14 -18L-14 18Z" : "");
    if (middle) arrow.setAttribute("transform", `translate(${cm(middle[0])} ${cm(middle[1])}) rotate(${direction * 180 / Math.PI})`);
    for (const part of [robot, wedge]) part.style.display = state.at ? "" : "none";
    if (state.at) {
      const place = `translate(${cm(state.at[0])} ${cm(state.at[1])}) rotate(${state.heading * 180 / Math.PI})`;
      robot.setAttribute("d", "M30 0L-18 -21L-9 0L-18 21Z");
      robot.setAttribute("transform", place);
      const [far, side] = [cm(VIEW_M) * Math.cos(HALF_VIEW), cm(VIEW_M) * Math.sin(HALF_VIEW)];
      wedge.setAttribute("d", `M0 0L${far} ${-side}A${cm(VIEW_M)} ${cm(VIEW_M)} 0 0 1 ${far} ${side}Z`);
      wedge.setAttribute("transform", place);
    }
    const crowd = new Map();
    for (const [id, mark] of things) {
      const at = state.things.get(id);
      const shift = crowd.get(String(at)) ?? 0;
      crowd.set(String(at), shift + 1);
      mark.setAttribute("transform", `translate(${cm(at[0])} ${cm(at[1]) + 34 * shift})`);
      mark.classList.toggle("held", id === state.held);
    }
    for (const piece of pieces.values()) piece.classList.remove("target");
    const step = share > 0 ? e.steps[k] : e.steps[k - 1];
    if (step) pieces.get(step[3] ?? targetOf(step[0]))?.classList.add("target");
    const belief = beliefsAt(e, k).get(node);
    for (const [id, room] of heat) {
      const p = belief?.get(id) ?? 0;
      room.setAttribute("fill-opacity", (0.75 * Math.sqrt(p)).toFixed(3));
      percent.get(id).textContent = p >= 0.005 ? `${Math.round(100 * p)} %` : "";
    }
    return state;
  }
  return { svg, show };
}
