// Comparison of one case's images: toggling in place, a slider between two, FLIP maps, exposure.
// The state stands in the address after "#", so a view can be linked to.
"use strict";
(() => {
  const case = JSON.parse(document.getElementById("case").textContent);
  const root = document.getElementById("viewer");
  const REFERENCE = "reference";
  const STOPS = 4;

  const state = { budget: case.budgets[0].name, name: "", other: REFERENCE, mode: "toggle",
    split: 50, exposure: 0, flip: false, help: false };

  const make = (tag, properties = {}, ...children) => {
    const element = Object.assign(document.createElement(tag), properties);
    element.append(...children);
    return element;
  };
  const clamp = (value, low, high) => Math.min(high, Math.max(low, value));

  // Everything that can be shown at the present budget, in the order of the number keys.
  const entries = () => {
    const budget = case.budgets.find((found) => found.name === state.budget);
    const methods = budget.methods.filter((method) => method.image);
    return case.reference
      ? [{ name: REFERENCE, color: "#ffffff", image: case.reference, error: null }, ...methods]
      : methods;
  };
  const entry = (name) => entries().find((found) => found.name === name) || entries()[0];
  const firstName = () => {
    const found = entries();
    return (case.reference && found.length > 1 ? found[1] : found[0]).name;
  };
  const keyOf = (index) => {
    const number = case.reference ? index : index + 1;
    return number < 10 ? String(number) : "";
  };

  // Previews hold log(1 + steepness · x); the filter's table turns them into sRGB at an exposure.
  const setExposure = (stops) => {
    const scale = 2 ** stops;
    const top = Math.log1p(case.steepness * case.whitest);
    const values = Array.from({ length: 256 }, (_, code) => {
      const linear = clamp(Math.expm1((code / 255) * top) / case.steepness * scale, 0, 1);
      return (linear <= 0.0031308 ? 12.92 * linear : 1.055 * linear ** (1 / 2.4) - 0.055).toFixed(4);
    }).join(" ");
    for (const part of document.querySelector("#exposure feComponentTransfer").children) {
      part.setAttribute("tableValues", values);
    }
  };

  const stage = make("div", { className: "stage" });
  const divider = make("div", { className: "divider" });
  const tags = { left: make("div", { className: "tag left" }), right: make("div", { className: "tag right" }) };
  const methods = make("ol", { className: "methods" });
  const button = (text, title, action) => {
    const made = make("button", { type: "button", textContent: text, title });
    made.addEventListener("click", action);
    return made;
  };
  const buttons = {
    toggle: button("Toggle", "One image at a time", () => change({ mode: "toggle" })),
    slide: button("Slider", "Two images side by side (S)", () => change({ mode: "slide" })),
    flip: button("FLIP map", "Show the error map (F)", () => change({ flip: !state.flip })),
    help: button("Keys ?", "Keyboard help (H)", () => change({ help: !state.help })),
  };
  const exposure = make("input", { type: "range", min: -STOPS, max: STOPS, step: 0.25, id: "stops" });
  exposure.addEventListener("input", () => change({ exposure: Number(exposure.value) }));
  const exposureText = make("output", { htmlFor: "stops" });
  const split = make("input", { type: "range", min: 0, max: 100, step: 0.5 });
  split.addEventListener("input", () => change({ split: Number(split.value) }));
  const other = make("select");
  other.addEventListener("change", () => change({ other: other.value }));
  const budgets = make("select", {}, ...case.budgets.map(({ name }) => make("option", { value: name, textContent: name })));
  budgets.addEventListener("change", () => change({ budget: budgets.value }));
  const splitRow = make("div", { className: "controls" },
    make("label", {}, "right", other), make("label", {}, "split", split));
  const legend = make("div", { className: "legend" }, "FLIP 0", make("i"), "1");
  const help = make("p", { className: "help" });
  help.innerHTML = "<kbd>1</kbd>…<kbd>9</kbd> sampler, <kbd>0</kbd> reference, <kbd>←</kbd> <kbd>→</kbd> "
    + "step through all, <kbd>R</kbd> held: reference, <kbd>F</kbd> FLIP map, <kbd>S</kbd> slider, "
    + "<kbd>+</kbd> <kbd>−</kbd> exposure, <kbd>X</kbd> exposure 0, <kbd>P</kbd> <kbd>N</kbd> previous "
    + "and next case, <kbd>H</kbd> this help. Drag in the image to move the slider.";

  let images = new Map();
  const build = () => {
    if (!entries().some((found) => found.name === state.name)) state.name = firstName();
    if (!entries().some((found) => found.name === state.other)) state.other = entries()[0].name;
    images = new Map();
    stage.replaceChildren();
    for (const found of entries()) {
      const picture = (source, coded) => source && make("img", { src: source, alt: found.name,
        className: coded ? "coded" : "", draggable: false, decoding: "sync" });
      const pair = { image: picture(found.image, true), error: picture(found.error, false) };
      images.set(found.name, pair);
      stage.append(...[pair.image, pair.error].filter(Boolean));
    }
    stage.append(divider, tags.left, tags.right);
    methods.replaceChildren(...entries().map((found, index) => {
      const chip = make("i", { className: "chip" });
      chip.style.background = found.color;
      const made = button("", `Show ${found.name}`, () => change({ name: found.name }));
      made.append(make("kbd", { textContent: keyOf(index) }), chip, make("b", { textContent: found.name }),
        make("small", { textContent: found.flip ? `FLIP ${found.flip}` : "" }));
      made.dataset.name = found.name;
      return make("li", {}, made);
    }));
    other.replaceChildren(...entries().map(({ name }) => make("option", { value: name, textContent: name })));
  };

  const visible = (name) => {
    const pair = images.get(entry(name).name);
    return (state.flip && pair.error) || pair.image;
  };
  const label = (tag, name) => {
    const found = entry(name);
    const numbers = found.flip ? ` FLIP ${found.flip} · RMSE ${found.rmse}` : "";
    const note = state.flip && !found.error ? " (no error map)" : "";
    tag.replaceChildren(found.name + note, make("small", { textContent: numbers }));
  };

  const draw = () => {
    const sliding = state.mode === "slide";
    for (const pair of images.values()) {
      for (const image of [pair.image, pair.error]) {
        if (image) { image.classList.remove("shown"); image.style.clipPath = ""; image.style.zIndex = ""; }
      }
    }
    const left = visible(state.name);
    left.classList.add("shown");
    if (sliding && visible(state.other) !== left) {
      visible(state.other).classList.add("shown");
      left.style.zIndex = 1;
      left.style.clipPath = `inset(0 ${100 - state.split}% 0 0)`;
    }
    stage.classList.toggle("sliding", sliding);
    divider.hidden = tags.right.hidden = splitRow.hidden = !sliding;
    divider.style.left = `${state.split}%`;
    for (const layer of [divider, tags.left, tags.right]) layer.style.zIndex = 2;
    label(tags.left, state.name);
    label(tags.right, state.other);
    for (const made of methods.querySelectorAll("button")) {
      made.setAttribute("aria-pressed", String(made.dataset.name === state.name));
    }
    buttons.toggle.setAttribute("aria-pressed", String(!sliding));
    buttons.slide.setAttribute("aria-pressed", String(sliding));
    buttons.flip.setAttribute("aria-pressed", String(state.flip));
    buttons.help.setAttribute("aria-pressed", String(state.help));
    help.hidden = !state.help;
    legend.hidden = !state.flip;
    exposure.value = state.exposure;
    exposureText.textContent = `${state.exposure > 0 ? "+" : ""}${state.exposure} stops`;
    split.value = state.split;
    other.value = state.other;
    budgets.value = state.budget;
    setExposure(state.exposure);
  };

  const write = () => {
    const words = new URLSearchParams({ show: state.name });
    if (state.mode === "slide") { words.set("right", state.other); words.set("split", state.split); }
    if (state.flip) words.set("flip", "1");
    if (state.exposure) words.set("exposure", state.exposure);
    if (state.budget !== case.budgets[0].name) words.set("budget", state.budget);
    try { history.replaceState(null, "", `#${words}`); } catch { /* some browsers refuse it on disk */ }
  };
  const read = () => {
    const words = new URLSearchParams(location.hash.slice(1));
    const number = (name, low, high, normal) => {
      const value = Number(words.get(name) ?? normal);
      return Number.isFinite(value) ? clamp(value, low, high) : normal;
    };
    if (case.budgets.some(({ name }) => name === words.get("budget"))) state.budget = words.get("budget");
    state.name = words.get("show") ?? state.name;
    state.mode = words.has("right") ? "slide" : "toggle";
    state.other = words.get("right") ?? state.other;
    state.split = number("split", 0, 100, 50);
    state.exposure = number("exposure", -STOPS, STOPS, 0);
    state.flip = words.has("flip");
  };
  const change = (what) => {
    const rebuild = what.budget !== undefined && what.budget !== state.budget;
    Object.assign(state, what);
    if (rebuild) build();
    draw();
    write();
  };

  const step = (by) => {
    const names = entries().map(({ name }) => name);
    change({ name: names[(names.indexOf(state.name) + by + names.length) % names.length] });
  };
  let held = null;
  const follow = (id) => document.getElementById(id)?.click();
  const actions = {
    ArrowLeft: () => step(-1), ArrowUp: () => step(-1), ArrowRight: () => step(1), ArrowDown: () => step(1),
    f: () => change({ flip: !state.flip }),
    s: () => change({ mode: state.mode === "slide" ? "toggle" : "slide" }),
    "+": () => change({ exposure: clamp(state.exposure + 0.5, -STOPS, STOPS) }),
    "=": () => actions["+"](),
    "-": () => change({ exposure: clamp(state.exposure - 0.5, -STOPS, STOPS) }),
    x: () => change({ exposure: 0 }), h: () => change({ help: !state.help }), "?": () => actions.h(),
    p: () => follow("previous"), n: () => follow("next"),
  };
  document.addEventListener("keydown", (event) => {
    if (event.ctrlKey || event.metaKey || event.altKey) return;
    const target = event.target;
    if (target instanceof HTMLSelectElement) return;
    if (target instanceof HTMLInputElement && event.key.startsWith("Arrow")) return;
    const key = event.key.length === 1 ? event.key.toLowerCase() : event.key;
    if (/^[0-9]$/.test(key)) {
      const found = entries().find((_, index) => keyOf(index) === key);
      if (found) change({ name: found.name });
    } else if (key === "r" && case.reference) {
      if (held === null) { held = state.name; change({ name: REFERENCE }); }
    } else if (actions[key]) {
      actions[key]();
    } else {
      return;
    }
    event.preventDefault();
  });
  document.addEventListener("keyup", (event) => {
    if (event.key.toLowerCase() === "r" && held !== null) { change({ name: held }); held = null; }
  });
  const drag = (event) => {
    const box = stage.getBoundingClientRect();
    change({ split: Math.round(clamp((event.clientX - box.left) / box.width, 0, 1) * 1000) / 10 });
  };
  stage.addEventListener("pointerdown", (event) => {
    if (state.mode !== "slide") { step(event.shiftKey ? -1 : 1); return; }
    stage.setPointerCapture(event.pointerId);
    drag(event);
  });
  stage.addEventListener("pointermove", (event) => {
    if (state.mode === "slide" && stage.hasPointerCapture(event.pointerId)) drag(event);
  });
  window.addEventListener("hashchange", () => { read(); build(); draw(); });

  stage.style.aspectRatio = `${case.width} / ${case.height}`;
  stage.style.maxWidth = `calc(78vh * ${case.width / case.height})`;
  const side = make("div", { className: "side" },
    make("div", { className: "controls" }, buttons.toggle, buttons.slide, buttons.flip, buttons.help), help, legend);
  if (case.budgets.length > 1) side.append(make("div", { className: "controls" }, make("label", {}, "budget", budgets)));
  side.append(splitRow, make("div", { className: "controls" },
    make("label", { htmlFor: "stops" }, "exposure"), exposure, exposureText), methods);
  root.append(stage, side);
  read();
  build();
  draw();
  root.dataset.ready = "true";
})();
