// Error against what it costs, both axes logarithmic, means over the same cases as the ranking's:
// lines over numbers of lights, points at budgets of rays and seconds. Who is on the Pareto front has
// a colour and its name at its dearest point; all others are grey, and named by the legend.
"use strict";
(() => {
  const PER_LETTER = 6.4;
  const LETTER = 12;

  const SPACE = "http://www.w3.org/2000/svg";
  const EDGE = { left: 62, right: 14, top: 10, bottom: 44 };
  const COSTS = { rays: "rays per sub-pixel", ms: "milliseconds: prepare and render", lights: "lights" };
  const DASHES = { "-": "", "--": "6 3", ":": "1.5 2.5", "-.": "6 2 1.5 2" };
  const amountOf = (costs, kind) => (kind === "ms" ? costs.prepare_ms + costs.render_ms : costs[kind]);
  let cost = "ms";
  let marked = "";

  const make = (tag, attributes = {}, text = "") => {
    const made = document.createElementNS(SPACE, tag);
    for (const [name, value] of Object.entries(attributes)) made.setAttribute(name, value);
    made.textContent = text;
    return made;
  };
  // 1, 2 and 5 times powers of ten, as many of them as are not crowded; more where the range is small.
  const ticksOf = (low, high) => {
    const found = [];
    for (let power = Math.floor(Math.log10(low)) - 1; power <= Math.ceil(Math.log10(high)); power += 1) {
      for (const times of high > 4 * low ? [1, 2, 5] : [1, 1.2, 1.5, 2, 2.5, 3, 4, 5, 6, 7, 8, 9]) found.push(times * 10 ** power);
    }
    const inside = found.filter((value) => value >= low && value <= high);
    const few = inside.filter((value) => Math.abs(Math.log10(value) % 1) < 1e-9);
    return inside.length > 9 && few.length > 1 ? few : inside;
  };

  // The marker of a look, as the plots of the reports draw it, around a point.
  const POLYGONS = { s: [4, 45], D: [4, 0], d: [4, 0], "^": [3, -90], v: [3, 90], "<": [3, 180], ">": [3, 0], p: [5, -90], h: [6, -90] };
  const shapeOf = (marker, cx, cy) => {
    const at = (degrees, r) => `${(cx + r * Math.cos((degrees * Math.PI) / 180)).toFixed(1)} ${(cy + r * Math.sin((degrees * Math.PI) / 180)).toFixed(1)}`;
    const ring = (count, turn, radius) => `M${Array.from({ length: count }, (_, k) => at(turn + (360 * k) / count, radius(k))).join("L")}Z`;
    if (marker in POLYGONS) return ring(...POLYGONS[marker], () => (marker === "d" ? 4 : 5));
    if (marker === "*") return ring(10, -90, (k) => (k % 2 ? 2.4 : 5.6));
    if (marker === "P" || marker === "X") return ring(12, marker === "P" ? 15 : 60, (k) => (k % 3 === 2 ? 2.4 : 5.2));
    return `M${at(0, 4)}A4 4 0 1 1 ${at(180, 4)}A4 4 0 1 1 ${at(0, 4)}Z`;
  };

  envlight.drawCosts = (place, data, metric, chosen) => {
    const results = data.budgets.map(({ name }) => envlight.ranking(data, name, metric, chosen));
    const series = new Map();
    for (const { budget, lines } of results) {
      for (const line of lines) {
        const x = amountOf(line.costs, cost);
        if (!(x > 0 && line.error > 0)) continue;
        if (!series.has(line.sampler)) series.set(line.sampler, { shown: data.labels[line.index], color: data.colors[line.index], mark: data.marks[line.index], points: [] });
        series.get(line.sampler).points.push({ x, y: line.error, budget, sampler: line.sampler });
      }
    }
    const all = [...series.values()].flatMap(({ points }) => points);
    const [label, places] = envlight.constants.metrics[metric];
    const redraw = () => envlight.drawCosts(place, data, metric, chosen);
    const kinds = document.createElement("div");
    kinds.className = "kinds";
    kinds.append("Error against");
    const segments = document.createElement("div");
    segments.className = "segments";
    kinds.setAttribute("role", "group");
    kinds.setAttribute("aria-label", "Cost");
    for (const [name, words] of Object.entries(COSTS)) {
      const button = document.createElement("button");
      button.type = "button";
      button.textContent = name;
      button.title = words;
      button.setAttribute("aria-pressed", String(name === cost));
      button.addEventListener("click", () => { cost = name; redraw(); place.querySelectorAll(".segments button")[Object.keys(COSTS).indexOf(name)].focus(); });
      segments.append(button);
    }
    kinds.append(segments);
    place.replaceChildren(kinds);
    if (!all.length) return;
    const [WIDTH, HEIGHT] = place.clientWidth < 600 ? [380, 360] : [820, 460];
    const margin = (values, by) => [Math.min(...values) / by, Math.max(...values) * by];
    const [left, right] = margin(all.map(({ x }) => x), 1.15);
    const [low, high] = margin(all.map(({ y }) => y), 1.12);
    const x = (value) => EDGE.left + (Math.log(value / left) / Math.log(right / left)) * (WIDTH - EDGE.left - EDGE.right);
    const y = (value) => EDGE.top + (Math.log(high / value) / Math.log(high / low)) * (HEIGHT - EDGE.top - EDGE.bottom);
    const svg = make("svg", { viewBox: `0 0 ${WIDTH} ${HEIGHT}`, role: "img", "aria-label": `${label} against ${COSTS[cost]}` });
    for (const tick of ticksOf(left, right)) {
      svg.append(make("line", { class: "grid", x1: x(tick), x2: x(tick), y1: EDGE.top, y2: HEIGHT - EDGE.bottom }),
        make("text", { class: "tick", x: x(tick), y: HEIGHT - EDGE.bottom + 16, "text-anchor": "middle" }, String(Number(tick.toPrecision(2)))));
    }
    for (const tick of ticksOf(low, high)) {
      svg.append(make("line", { class: "grid", x1: EDGE.left, x2: WIDTH - EDGE.right, y1: y(tick), y2: y(tick) }),
        make("text", { class: "tick", x: EDGE.left - 7, y: y(tick) + 4, "text-anchor": "end" }, String(Number(tick.toPrecision(2)))));
    }
    svg.append(make("text", { class: "name", x: (EDGE.left + WIDTH) / 2, y: HEIGHT - 6, "text-anchor": "middle" }, COSTS[cost]),
      make("text", { class: "name", x: 14, y: HEIGHT / 2, "text-anchor": "middle", transform: `rotate(-90 14 ${HEIGHT / 2})` }, `mean ${label}`));
    // Whom nobody beats in both: each name stands beside its point, above those that it would overlap.
    let least = Infinity;
    const front = new Set();
    for (const point of [...all].sort((a, b) => a.x - b.x || a.y - b.y)) {
      if (point.y < least) front.add(point.sampler);
      least = Math.min(least, point.y);
    }
    const labels = new Map();
    const taken = [];
    const ends = [...front].map((name) => [name, series.get(name).points.reduce((last, point) => (point.x > last.x ? point : last))]);
    for (const [name, end] of ends.sort(([, a], [, b]) => a.y - b.y)) {
      const size = PER_LETTER * series.get(name).shown.length;
      const box = { left: x(end.x) + 7 + size > WIDTH ? x(end.x) - 7 - size : x(end.x) + 7, y: Math.min(y(end.y) + 4, HEIGHT - EDGE.bottom - 2) };
      while (taken.some((other) => Math.abs(other.y - box.y) < LETTER && other.left < box.left + size && box.left < other.right)) box.y -= 1;
      taken.push({ ...box, right: box.left + size });
      labels.set(name, box);
    }
    const legend = document.createElement("ul");
    legend.className = "legend";
    const ordered = [...series.entries()].sort((a, b) => a[0].localeCompare(b[0]));
    if (!series.has(marked)) marked = "";
    const mark = (name) => {
      marked = name;
      svg.classList.toggle("marking", Boolean(name));
      for (const group of svg.querySelectorAll("g")) group.classList.toggle("marked", group.dataset.sampler === name);
      for (const button of legend.querySelectorAll("button")) button.setAttribute("aria-pressed", String(button.dataset.sampler === name));
    };
    for (const [sampler, { shown, color, mark: [marker, dash], points }] of ordered) {
      const group = make("g", { class: front.has(sampler) ? "front" : "" });
      group.dataset.sampler = sampler;
      const line = points.filter(({ budget }) => budget.startsWith("lights=")).sort((a, b) => a.x - b.x);
      if (line.length > 1) {
        group.append(make("polyline", { points: line.map((point) => `${x(point.x).toFixed(1)},${y(point.y).toFixed(1)}`).join(" "), stroke: color, "stroke-dasharray": DASHES[dash] }));
      }
      if (labels.has(sampler)) group.append(make("text", { class: "label", x: labels.get(sampler).left, y: labels.get(sampler).y }, shown));
      for (const point of points) {
        const spot = make("path", { class: "spot", d: shapeOf(marker, x(point.x), y(point.y)), style: `fill:${color}` });
        spot.append(make("title", {}, `${shown}, ${point.budget}: ${label} ${envlight.fixed(point.y, places)} at ${Number(point.x.toPrecision(3))} ${cost}`));
        group.append(spot);
      }
      group.addEventListener("pointerenter", () => mark(sampler));
      svg.append(group);
      const button = document.createElement("button");
      button.type = "button";
      button.dataset.sampler = sampler;
      const chip = document.createElement("i");
      chip.className = "chip";
      chip.style.background = color;
      button.append(chip, shown);
      button.addEventListener("click", () => mark(marked === sampler ? "" : sampler));
      const item = document.createElement("li");
      item.append(button);
      legend.append(item);
    }
    place.append(svg, legend);
    mark(marked);
  };
})();
