// One episode: its player, what was believed and met, its plans with their repairs, its conversation.
let stopPlaying = () => {};

function showEpisode(e, step) {
  stopPlaying();
  const facts = [e.scene, e.agent, `seed ${e.seed}`, `${e.metres.toFixed(1)} m`, `planning ${e.planning} s`,
    e.attempts ? `${e.attempts} ${e.attempts === 1 ? "call" : "calls"}` : ""].filter(Boolean).join(" · ");
  const box = byId("episode");
  box.replaceChildren(
    make("h3", { class: e.outcome }, make("span", { class: "sign" }, signOf(e)), `${e.id}: ${e.failure || "success"}`),
    make("p", { class: "facts" }, facts), make("p", { class: "sentence" }, e.text));
  for (const [name, list] of [["Not met", e.unmet], ["Left", e.unsafe]])
    if (list.length) box.append(make("p", { class: "bad" }, `${name}: ${list.join(", ")}`));
  if (e.stopped) box.append(make("p", { class: "note" }, e.stopped));
  if (e.steps.length) box.append(player(e, step));
  if (e.tasks.length) box.append(make("details", { open: "" }, make("summary", {}, "Plans and repairs"),
    make("div", { class: "columns" }, ...e.tasks.map((task, i) => showTask(task, placeOf(e, i))))));
  e.earlier.forEach((tasks, i) => box.append(make("details", {}, make("summary", {}, `Attempt ${i + 1}, not accepted`),
    make("div", { class: "columns" }, ...tasks.map((task, j) => showTask(task, `Task ${j + 1}`))))));
  if (e.calls.length) box.append(conversation(e.calls));
  if (e.error) box.append(make("pre", {}, e.error));
}

const signOf = (e) => e.outcome === "success" ? "✓" : e.outcome === "refused" || e.outcome === "rejected" ? "–" : "✗";

function placeOf(e, index) {
  const place = e.order.indexOf(index);
  return `Task ${index + 1}` + (place >= 0 && e.tasks.length > 1 ? ` (done ${place + 1} of ${e.tasks.length})` : "");
}

// --- player

function player(e, from) {
  const plan = floorPlan(e), last = e.steps.length;
  let [k, share, node, frame] = [Math.min(from ?? 0, last), 0, null, 0];
  const slider = make("input", { type: "range", min: 0, max: last, value: k, "aria-label": "step" });
  const line = make("div", { class: "now-line", "aria-live": "polite" });
  const goal = make("ul"), chips = make("div", { class: "chips" }), held = make("p", { class: "note" });
  const list = make("ol", { class: "steps" }, ...e.steps.map((s, i) => stepItem(s, () => go(i + 1))));
  const play = button("▶ play", { "aria-label": "play or pause" }, toggle);
  const chosen = () => {
    const beliefs = beliefsAt(e, k);
    const next = targetOf(e.steps[Math.min(k, last - 1)][0]);
    const wanted = [...beliefs.keys()].find((name) => name === next || name.split("@")[0] === next.split("@")[0]);
    return beliefs.has(node) ? node : wanted ?? beliefs.keys().next().value ?? null;
  };

  function show() {
    const state = plan?.show(k, share, chosen());
    slider.value = k;
    const step = share > 0 ? e.steps[k] : e.steps[k - 1];
    line.textContent = step ? `${Math.min(last, share > 0 ? k + 1 : k)}/${last}  ${step[0]}${step[1] === "ok" ? "" : `  ${step[5] || step[1]}`}  ·  ${(state?.metres ?? 0).toFixed(1)} m` : "start";
    [...list.children].forEach((item, i) => i === (share > 0 ? k : k - 1) ? item.setAttribute("aria-current", "true") : item.removeAttribute("aria-current"));
    held.textContent = state?.held ? `in hand: ${state.held}` : "";
    const met = new Set(e.met.filter(([s]) => s <= k).at(-1)?.[1] ?? []);
    goal.replaceChildren(...e.goal.map((text, i) => make("li", { class: met.has(i) ? "good" : "" }, `${met.has(i) ? "✓" : "○"} ${text}`)));
    const beliefs = beliefsAt(e, k), now = chosen();
    chips.replaceChildren(...[...beliefs].map(([name, rooms]) => {
      const best = [...rooms].sort((a, b) => b[1] - a[1])[0];
      return button(`${name} ${Math.round(100 * best[1])} %`, { "aria-pressed": String(name === now), title: `most likely ${best[0]}` }, () => { node = name; show(); });
    }));
    if (!beliefs.size) chips.append(make("span", { class: "note" }, e.beliefs.length ? "nothing is uncertain now" : "no beliefs are recorded"));
    const link = permalink(e, k);  // not at every frame: browsers allow some hundreds in a minute
    if (location.hash !== link) history.replaceState(null, "", link);
  }
  function go(to) { stop(); [k, share] = [Math.max(0, Math.min(last, to)), 0]; show(); }
  function stop() { cancelAnimationFrame(frame); frame = 0; play.textContent = "▶ play"; }
  function toggle() {
    if (frame) { stop(); share = 0; return show(); }
    if (k >= last) k = 0;
    play.textContent = "❚❚ pause";
    let before = performance.now();
    const tick = (time) => {
      const length = Math.max(450, Math.min(3500, 260 * e.steps[k][2]));
      share += Math.min(200, time - before) / length;
      before = time;
      if (share >= 1) { k += 1; share = 0; }
      show();
      if (k >= last) return stop();
      frame = requestAnimationFrame(tick);
    };
    frame = requestAnimationFrame(tick);
  }
  slider.addEventListener("input", () => go(Number(slider.value)));
  stopPlaying = stop;
  playerKeys = { ArrowRight: () => go(k + 1), ArrowLeft: () => go(k - (share > 0 ? 0 : 1)), " ": toggle, Home: () => go(0), End: () => go(last) };
  show();
  const left = make("div", {}, plan?.svg ?? make("p", { class: "note" }, `The floor plan of ${e.scene} is not shipped.`),
    make("div", { class: "player" }, play, slider), line, legend());
  const right = make("div", { class: "side" },
    make("div", {}, make("h4", {}, "Goal"), goal, held),
    make("div", {}, make("h4", {}, "Where it may be"), chips),
    make("div", {}, make("h4", {}, "Steps"), list));
  return make("div", { class: "stage" }, left, right);
}
let playerKeys = {};

function legend() {
  const part = (mark, text, colour) => make("span", {}, make("i", { style: `color:var(${colour})` }, mark), text);
  return make("p", { class: "legend" }, part("○", "start", "--route"), part("➤", "robot, and what its camera faces", "--accent"),
    part("━", "route", "--route"), part("▦", "where the chosen thing may be", "--heat"), part("●", "movables", "--ink"));
}

function stepItem([action, outcome, metres, reached, , detail], act) {
  const notes = [metres ? `${metres.toFixed(1)} m` : "", reached && !action.includes(reached) ? `→ ${reached}` : ""];
  const item = make("li", {}, button(action, {}, act), " ", make("small", { class: "note" }, notes.filter(Boolean).join(" ")));
  if (outcome !== "ok") item.append(make("span", { class: "bad" }, ` ✗ ${detail || outcome}`));
  return item;
}

// --- plans

function showTask(task, title) {
  const before = task.proposed.length ? task.proposed : task.plan;
  const list = make("ul", { class: "diff" }, ...difference(before, task.plan).map(([mark, action]) => make("li", {}, make(mark, {}, action))));
  const box = make("div", {}, make("h4", {}, title), make("p", {}, task.text), make("p", { class: "note" }, `Goal: ${task.goal.join(", ")}`), list);
  if (task.edits.length) box.append(make("ul", { class: "edits" }, ...task.edits.map((edit) => make("li", {}, edit))));
  if (task.proposed_verdict && task.proposed_verdict !== task.verdict) box.append(make("p", { class: "note" }, `as proposed: ${task.proposed_verdict}`));
  if (task.verdict) box.append(make("p", { class: /^(valid|reference)$/.test(task.verdict) ? "good" : "bad" }, task.verdict));
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
    if (i < before.length && j < after.length && before[i] === after[j]) { out.push(["span", after[j]]); i++; j++; }
    else if (j < after.length && (i === before.length || length[i][j + 1] >= length[i + 1][j])) out.push(["ins", after[j++]]);
    else out.push(["del", before[i++]]);
  }
  return out;
}

// --- conversation

const CUT = { length: "answer cut at the most tokens", filter: "answer cut by a content filter" };

function conversation(calls) {
  const box = make("details", {}, make("summary", {}, `Conversation (${calls.length} ${calls.length === 1 ? "call" : "calls"})`));
  calls.forEach((call, i) => {
    const settings = Object.entries(call.decoding).map(([name, value]) => `${name} ${value}`).join(", ");
    box.append(make("p", { class: "facts" }, `${i + 1}. ${call.model} · ${settings} · ${call.tokens[0]} + ${call.tokens[1]} tokens · ${call.seconds} s`));
    if (call.cut) box.append(make("p", { class: "facts cut" }, CUT[call.cut]));
    for (const [role, text] of call.turns)
      box.append(make("div", { class: `turn ${role === "answer" ? "answer" : ""}` }, make("b", {}, role), make("pre", {}, data.texts[text])));
  });
  return box;
}
