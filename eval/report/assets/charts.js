// Bars of success and of metres, as SVG.
const KINDS = new Map([["single", "single tasks"], ["multi", "multi-task instructions"], ["behavior", "BEHAVIOR activities"]]);

function showCharts(charts) {
  for (const chart of charts) {
    const about = (KINDS.get(chart.kind) ?? chart.kind) + chart.part;
    bars(`Success, ${about}`, chart.rows.filter((r) => r.success).map((r) => ({ ...r, value: r.success })), 100, (v) => `${v.toFixed(0)} %`,
      "thin line: 95 % interval over instructions, or ± over seeds");
    const driven = chart.rows.filter((r) => r.metres);
    if (driven.length > 1) {
      const most = Math.max(...driven.map((r) => r.metres[2]));
      bars(`Metres on the ${chart.matched} episodes that all of these solved, ${about}`, driven.map((r) => ({ ...r, value: r.metres })), most,
        (v) => `${v.toFixed(1)} m`, "thin line: ±; less is better");
    }
  }
}

function bars(title, rows, most, words, note) {
  if (!rows.length) return;
  const [line, left, width] = [30, 190, 560];
  const span = width - left - 70;
  const svg = draw("svg", { viewBox: `0 0 ${width} ${rows.length * line + 4}`, role: "img", "aria-label": title });
  rows.forEach((row, i) => {
    const y = i * line + 4;
    const x = (v) => left + (span * Math.max(0, Math.min(v, most))) / (most || 1);
    const [mean, low, high] = row.value;
    const name = draw("text", { x: 0, y: y + 16 }, row.name.length > 27 ? `${row.name.slice(0, 26)}…` : row.name);
    name.append(draw("title", {}, row.name));
    svg.append(name, draw("rect", { class: "rail", x: left, y, width: span, height: 22, rx: 4 }),
      draw("rect", { x: left, y, width: x(mean) - left, height: 22, rx: 4, fill: `var(--c${row.privileged ? 7 : i % 7})` }),
      draw("line", { class: "whisker", x1: x(low), x2: x(high), y1: y + 11, y2: y + 11 }),
      draw("text", { class: "value", x: left + span + 8, y: y + 16 }, words(mean)));
  });
  byId("charts").append(make("figure", { class: "chart" }, make("figcaption", {}, title), svg, make("p", { class: "note" }, note)));
}
