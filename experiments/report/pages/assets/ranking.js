// The ranking of the first page: what is chosen above it decides which rows it is made from. What is
// chosen stands in the address after "#", so a view can be linked to.
"use strict";
(() => {
  const root = document.getElementById("ranking");
  const catalogue = JSON.parse(document.getElementById("catalogue").textContent);
  const { constants, fixed } = envlight;
  const at = (name) => root.querySelector(`[data-part="${name}"]`);
  const opening = { run: catalogue.run, budget: catalogue.budget, metric: constants.leading };
  const TICKS = [0.125, 0.25, 0.5, 0.7, 1, 1.25, 1.5, 2, 3, 4, 6, 8, 12, 16, 32, 64];

  // classes : of maps, none for all; without : names that were taken out, by kind
  const fresh = () => ({ ...opening, to: "", classes: new Set(),
    without: { samplers: new Set(), maps: new Set(), scenes: new Set() } });
  let state = fresh();

  const make = (tag, properties = {}, ...children) => {
    const { data, ...others } = properties;
    const element = Object.assign(document.createElement(tag), others);
    Object.assign(element.dataset, data);
    element.append(...children);
    return element;
  };
  const runNamed = (name) => catalogue.runs.find((run) => run.name === name);
  const inWords = Object.assign({}, ...catalogue.runs.map(({ words }) => words));
  const amount = (budget) => inWords[budget];
  const digits = (value, places) => (Number.isNaN(value) ? "–" : fixed(value, places));

  // The rows of a run: there already, or in a script of their own.
  const wanted = new Map();
  const load = (run) => {
    if (envlight.runs.has(run.name)) return Promise.resolve();
    if (!wanted.has(run.name)) {
      wanted.set(run.name, new Promise((done, failed) => {
        document.head.append(make("script", { src: run.file, onload: done,
          onerror: () => failed(new Error(`${run.file} is missing`)) }));
      }));
    }
    return wanted.get(run.name);
  };

  const chosen = (data) => {
    const { samplers, maps, scenes } = state.without;
    return {
      samplers: data.samplers.map((name) => !samplers.has(name)),
      scenes: data.scenes.map((name) => !scenes.has(name)),
      maps: data.maps.map((name, k) => !maps.has(name) && (!state.classes.size || state.classes.has(data.classes[k]))),
    };
  };

  const options = (select, names, words, value) => {
    select.replaceChildren(...names.map((name) => make("option", { value: name, textContent: words(name) })));
    select.value = value;
  };
  const pressed = (name, text, on, action, extra = {}) => {
    const made = make("button", { type: "button", data: { name }, ...extra }, text);
    made.setAttribute("aria-pressed", String(on));
    made.addEventListener("click", action);
    return made;
  };
  const labelOf = (data, name) => data.labels[data.samplers.indexOf(name)] ?? name;
  const boxes = (place, kind, names, data) => {
    place.replaceChildren(...names.map((name) => {
      const box = make("input", { type: "checkbox", checked: !state.without[kind].has(name), value: name });
      box.addEventListener("change", () => {
        state.without[kind][box.checked ? "delete" : "add"](name);
        show();
      });
      return make("label", {}, box, labelOf(data, name));
    }));
  };

  const controls = (run, data) => {
    const sizes = [...new Set(catalogue.runs.map(({ size }) => size))];
    options(at("size"), sizes, (size) => `${size} pixels`, run.size);
    const alike = catalogue.runs.filter(({ size }) => size === run.size);
    const budgets = catalogue.budgets.filter((budget) => alike.some((one) => one.budgets.includes(budget)));
    options(at("budget"), budgets, amount, state.budget);
    const runs = alike.filter((one) => one.budgets.includes(state.budget));
    options(at("run"), runs.map(({ name }) => name), (name) => {
      const one = runNamed(name);
      return `${name} (${one.samplers} samplers, ${one.maps} ${one.maps === 1 ? "map" : "maps"})`;
    }, state.run);
    for (const box of at("metric").querySelectorAll("input")) box.checked = box.value === state.metric;
    const classes = [...new Set(data.classes)].sort();
    at("classes").replaceChildren(
      pressed("", "all", !state.classes.size, () => { state.classes.clear(); show().then(() => again(at("classes"), "")); }),
      ...classes.map((name) => {
        const count = data.classes.filter((other) => other === name).length;
        return pressed(name, `${name} `, state.classes.has(name), () => {
          state.classes[state.classes.has(name) ? "delete" : "add"](name);
          show().then(() => again(at("classes"), name));
        }, { title: `${count} of ${data.maps.length} maps` });
      }));
    at("classes").querySelectorAll("button").forEach((button, k) => {
      if (k) button.append(make("small", { textContent: String(data.classes.filter((name) => name === button.dataset.name).length) }));
    });
    boxes(at("samplers"), "samplers", data.samplers, data);
    boxes(at("maps"), "maps", data.maps, data);
    boxes(at("scenes"), "scenes", data.scenes, data);
  };
  // Buttons are made anew; the one that was used keeps the focus.
  const again = (place, name) => [...place.children].find((one) => one.dataset.name === name)?.focus();

  const axisOf = (lines) => {
    const known = lines.filter(({ ratio }) => !Number.isNaN(ratio));
    if (!known.length) return [1, 2];
    const ends = known.flatMap(({ low, ratio, high }) => [low, ratio, high].filter((value) => !Number.isNaN(value)));
    return [Math.min(1, ...ends) / 1.03, Math.max(1.25, ...ends) * 1.03];
  };
  const position = (value, [low, high]) => (100 * Math.log(value / low)) / Math.log(high / low);
  const ticksOf = (axis) => TICKS.reduce((found, tick) => {
    const place = position(tick, axis);
    return place >= 0 && place <= 100 && found.every(([other]) => Math.abs(other - place) > 20) ? [...found, [place, tick]] : found;
  }, [[position(1, axis), 1]]);

  const cell = (text, value, properties = {}, ...more) => make("td", { data: { value }, ...properties }, text, ...more);
  const isFirst = ({ place, alike }) => place === 1 || alike;
  const nameOf = (line, data) => make("th", { scope: "row", className: "name", data: { value: data.labels[line.index] } },
    Object.assign(make("i", { className: "chip" }), { style: `background:${data.colors[line.index]}` }),
    make("a", { href: `samplers/${data.pages[line.index]}.html`, textContent: data.labels[line.index] }),
    ...(data.leagues[line.index] ? [make("small", { textContent: data.leagues[line.index] })] : []));
  const costsOf = (line) => constants.costs.map(({ name: kind, heading, digits: decimals }) => cell(digits(line.costs[kind], decimals),
    line.costs[kind], { className: `cost ${kind}`, title: heading, data: { value: line.costs[kind], cost: kind } }));
  // Who is over the budget has an error and costs, and no place.
  const rowOver = (line, result, data) => make("tr", { className: "over" },
    cell(make("abbr", { textContent: "†", title: "over the budget: not ranked" }), 1e9, { className: "place" }),
    nameOf(line, data), cell(digits(line.error, constants.metrics[result.metric][1]), line.error), cell("–", 1e9), ...costsOf(line),
    cell("", -1, { className: "wide" }), cell("", 1e9, { className: "axis" }), cell("", -1e9, { className: "duel" }),
    cell("", 2, { className: "duel wide" }));
  const row = (line, result, data, axis, ticks, separated) => {
    const [label, places] = constants.metrics[result.metric];
    const whisker = make("td", { className: "axis", data: { value: line.ratio } });
    if (!Number.isNaN(line.ratio)) {
      const bar = make("div", { className: "whisker" });
      bar.setAttribute("aria-hidden", "true");
      const put = (tag, left, width) => {
        const made = make(tag);
        made.style.left = `${left}%`;
        if (width !== undefined) made.style.width = `${width}%`;
        if (tag !== "s") made.style.background = data.colors[line.index];
        bar.append(made);
      };
      for (const [place] of ticks) put("s", place);
      if (!Number.isNaN(line.low)) put("b", position(line.low, axis), position(line.high, axis) - position(line.low, axis));
      put("i", position(line.ratio, axis));
      whisker.append(bar);
    }
    const interval = Number.isNaN(line.low) ? "" : ` [${fixed(line.low, 2)}, ${fixed(line.high, 2)}]`;
    whisker.append(make("span", { className: "ratio" }, digits(line.ratio, 2), make("span", { textContent: interval })));
    const own = line.sampler === result.baseline;
    const p = own || Number.isNaN(line.p) ? "" : (line.p < 0.001 ? line.p.toExponential(0) : fixed(line.p, 3));
    const ranks = Number.isNaN(line.rankLow) ? [] : [make("small", { textContent: ` [${fixed(line.rankLow, 1)}, ${fixed(line.rankHigh, 1)}]`,
      title: "95 % interval of a bootstrap over maps" })];
    return make("tr", { className: isFirst(line) && separated ? "first" : "" },
      cell(String(line.place), line.place, { className: "place" }, ...(line.alike ? [make("abbr", { textContent: " ≈",
        title: `ties with ${labelOf(data, result.samplers[0])}: Wilcoxon's signed-rank test, Holm's correction, ${constants.level}` })] : [])),
      nameOf(line, data),
      cell(digits(line.error, places), line.error, { title: label }),
      cell(fixed(line.rank, 2), line.rank, { className: "rank" }, ...ranks),
      ...costsOf(line),
      cell(String(line.firsts), line.firsts, { className: "wide", title: line.shared ? `tied on ${line.shared}` : "" }),
      whisker,
      cell(own ? "" : `${line.smaller} · ${line.equal} · ${line.larger}`, line.smaller - line.larger, { className: "duel" }),
      cell(p, line.p, { className: "duel wide" }));
  };
  const drawTable = (result, data) => {
    const axis = axisOf(result.lines);
    const ticks = ticksOf(axis);
    const [label] = constants.metrics[result.metric];
    at("error").textContent = label;
    for (const place of root.querySelectorAll("[data-part=against]")) place.textContent = labelOf(data, result.baseline);
    at("ticks").replaceChildren(...ticks.map(([place, tick]) => {
      const made = make("span", { textContent: `${tick}×` });
      made.style.left = `${place}%`;
      return made;
    }));
    const alike = result.lines.filter((line) => line.alike).length;
    const separated = Boolean(result.published?.p) && alike < result.lines.length - 1;
    at("rows").replaceChildren(...result.lines.map((line) => row(line, result, data, axis, ticks, separated)),
      ...result.over.map((line) => rowOver(line, result, data)));
    for (const head of root.querySelectorAll("thead th")) head.removeAttribute("aria-sort");
    options(at("to"), data.samplers.filter((name) => result.samplers.includes(name)), (name) => labelOf(data, name), result.baseline);
    const leaders = result.lines.filter(isFirst).map(({ sampler }) => labelOf(data, sampler));
    const counted = (count, noun) => `${count} ${noun}${count === 1 ? "" : "s"}`;
    const [plain, ...more] = (result.published?.verdict ?? "").split(/(?<=\.) (?!\()/);
    at("leader").textContent = separated ? plain : "";
    at("over").textContent = result.published ? [...(separated ? [] : [plain]), ...more].join(" ") : (result.lines.length
      ? `${leaders.join(" and ")}: least mean rank by ${label} at ${amount(result.budget)}, over ${counted(result.maps, "map")} and ${counted(result.cases, "case")}.`
        + " Intervals and tests are those over all samplers, maps and scenes, and not shown while some are left out."
      : "No map is left on which all of them have finished.");
  };

  const write = () => {
    const words = new URLSearchParams({ run: state.run, budget: state.budget, metric: state.metric });
    if (state.to) words.set("to", state.to);
    if (state.classes.size) words.set("class", [...state.classes].sort().join(","));
    for (const [kind, names] of Object.entries(state.without)) {
      if (names.size) words.set(`without-${kind}`, [...names].sort().join(" "));
    }
    const anchor = `#${words.toString().replaceAll("%3D", "=")}`;
    try { history.replaceState(null, "", anchor); } catch { /* some browsers refuse it on disk */ }
    at("link").href = anchor;
  };
  const read = () => {
    const words = new URLSearchParams(location.hash.slice(1));
    if (!["run", "budget", "class"].some((name) => words.has(name))) return false;
    state = fresh();
    const run = runNamed(words.get("run")) ?? runNamed(opening.run);
    state.run = run.name;
    state.budget = run.budgets.includes(words.get("budget")) ? words.get("budget") : run.budgets[0];
    if (words.get("metric") in constants.metrics) state.metric = words.get("metric");
    state.to = words.get("to") ?? "";
    state.classes = new Set((words.get("class") ?? "").split(",").filter(Boolean));
    for (const kind of Object.keys(state.without)) {
      state.without[kind] = new Set((words.get(`without-${kind}`) ?? "").split(" ").filter(Boolean));
    }
    return true;
  };

  const show = (keep = true) => {
    const run = runNamed(state.run);
    return load(run).then(() => {
      const data = envlight.runs.get(run.name);
      const known = new Set(data.classes);
      for (const name of [...state.classes]) if (!known.has(name)) state.classes.delete(name);
      controls(run, data);
      if (keep) write();
      drawTable(envlight.ranking(data, state.budget, state.metric, chosen(data), state.to), data);
      envlight.drawCosts?.(at("costs"), data, state.metric, chosen(data));
      root.dataset.ready = `${state.run} ${state.budget} ${state.metric}`;
    }).catch((error) => { at("over").textContent = `${error.message}; make the site anew.`; });
  };

  at("size").addEventListener("change", () => {
    const run = catalogue.runs.find(({ size, budgets }) => size === at("size").value && budgets.includes(state.budget))
      ?? catalogue.runs.find(({ size }) => size === at("size").value);
    state.run = run.name;
    if (!run.budgets.includes(state.budget)) [state.budget] = run.budgets;
    show();
  });
  at("budget").addEventListener("change", () => {
    state.budget = at("budget").value;
    const { size } = runNamed(state.run);
    if (!runNamed(state.run).budgets.includes(state.budget)) {
      state.run = catalogue.runs.find((one) => one.size === size && one.budgets.includes(state.budget)).name;
    }
    show();
  });
  at("run").addEventListener("change", () => { state.run = at("run").value; show(); });
  at("to").addEventListener("change", () => { state.to = at("to").value; show(); });
  at("metric").addEventListener("change", (event) => { state.metric = event.target.value; show(); });
  at("reset").addEventListener("click", () => { state = fresh(); show(); });
  for (const button of root.querySelectorAll("[data-all]")) {
    button.addEventListener("click", () => {
      const kind = button.dataset.all;
      const names = envlight.runs.get(state.run)[kind];
      state.without[kind] = button.dataset.none ? new Set(names) : new Set();
      show();
    });
  }
  const follow = () => {
    if (read()) show().then(() => root.scrollIntoView());
  };
  window.addEventListener("hashchange", follow);
  if (location.hash.includes("=")) follow(); else show(false);
})();
