// Comparison of one case's images: toggling in place, a slider between two, error maps, exposure,
// and a zoom and place that all of them share. An image's pixels are whole pixels of the screen.
// The state stands in the address after "#", so a view can be linked to.
"use strict";
(() => {
  const page = JSON.parse(document.getElementById("case").textContent);
  const root = document.getElementById("viewer");
  const REFERENCE = "reference";
  const STOPS = 4;
  // Screen pixels per image pixel; whole numbers from 1 on, so that all pixels are alike.
  const ZOOMS = [1 / 8, 1 / 4, 1 / 2, 1, 2, 3, 4, 6, 8, 12, 16, 24, 32, 48, 64];
  const STILL = 4;

  // zoom : 0 is what fits; at : the image's point in the middle of the stage, in its pixels
  const state = { budget: page.budgets[0].name, name: "", other: REFERENCE, mode: "toggle",
    split: 50, exposure: 0, error: "", help: false, zoom: 0,
    at: [page.width / 2, page.height / 2] };

  const make = (tag, properties = {}, ...children) => {
    const element = Object.assign(document.createElement(tag), properties);
    element.append(...children);
    return element;
  };
  const clamp = (value, low, high) => Math.min(high, Math.max(low, value));

  // Everything that can be shown at the present budget, in the order of the number keys.
  const entries = () => {
    const budget = page.budgets.find((found) => found.name === state.budget);
    const methods = budget.methods.filter((method) => method.image);
    return page.reference
      ? [{ name: REFERENCE, label: REFERENCE, color: "#ffffff", image: page.reference, errors: {}, values: [] }, ...methods]
      : methods;
  };
  const entry = (name) => entries().find((found) => found.name === name) || entries()[0];
  const firstName = () => {
    const found = entries();
    return (page.reference && found.length > 1 ? found[1] : found[0]).name;
  };
  const keyOf = (index) => {
    const number = page.reference ? index : index + 1;
    return number < 10 ? String(number) : "";
  };

  // Previews hold log(1 + steepness · x); the filter's table turns them into sRGB at an exposure.
  const setExposure = (stops) => {
    const scale = 2 ** stops;
    const top = Math.log1p(page.steepness * page.whitest);
    const values = Array.from({ length: 256 }, (_, code) => {
      const linear = clamp(Math.expm1((code / 255) * top) / page.steepness * scale, 0, 1);
      return (linear <= 0.0031308 ? 12.92 * linear : 1.055 * linear ** (1 / 2.4) - 0.055).toFixed(4);
    }).join(" ");
    for (const part of document.querySelector("#exposure feComponentTransfer").children) {
      part.setAttribute("tableValues", values);
    }
  };

  const stage = make("div", { className: "stage" });
  const plane = make("div", { className: "plane" });
  plane.style.width = `${page.width}px`;
  plane.style.height = `${page.height}px`;
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
    help: button("Keys ?", "Keyboard help (H)", () => change({ help: !state.help })),
  };
  const maps = page.errors.map(({ name, label }) => {
    const made = button(`${label} map`, "Show the error map (F)",
      () => change({ error: state.error === name ? "" : name }));
    made.dataset.error = name;
    return made;
  });
  const zoomText = make("output", { className: "zoom" });
  const zooms = make("div", { className: "controls" }, make("span", { textContent: "zoom" }),
    button("−", "Farther away (O)", () => zoomBy(-1)), zoomText,
    button("+", "Closer (I)", () => zoomBy(1)),
    button("1:1", "A pixel of the image is one of the screen", () => zoomTo(1)),
    button("Fit", "The whole image (C)", () => zoomTo(0)));
  const exposure = make("input", { type: "range", min: -STOPS, max: STOPS, step: 0.25, id: "stops" });
  exposure.addEventListener("input", () => change({ exposure: Number(exposure.value) }));
  const exposureText = make("output", { htmlFor: "stops" });
  const split = make("input", { type: "range", min: 0, max: 100, step: 0.5 });
  split.addEventListener("input", () => change({ split: Number(split.value) }));
  const other = make("select");
  other.addEventListener("change", () => change({ other: other.value }));
  const budgets = make("select", {}, ...page.budgets.map(({ name }) => make("option", { value: name, textContent: name })));
  budgets.addEventListener("change", () => change({ budget: budgets.value }));
  const splitRow = make("div", { className: "controls" },
    make("label", {}, "right", other), make("label", {}, "split", split));
  const bar = make("i");
  bar.style.background = `linear-gradient(90deg, ${page.colors.map((color, k) =>
    `${color} ${100 * k / page.colors.length}% ${100 * (k + 1) / page.colors.length}%`).join(", ")})`;
  const legendName = make("span");
  const legend = make("div", { className: "legend" }, legendName, make("div", {}, bar,
    make("div", { className: "scale" },
      ...[0, 0.25, 0.5, 0.75, 1].map((value) => make("span", { textContent: String(value) })))));
  const help = make("p", { className: "help" });
  help.innerHTML = "<kbd>1</kbd>…<kbd>9</kbd> sampler, <kbd>0</kbd> reference, <kbd>←</kbd> <kbd>→</kbd> "
    + "step through all, <kbd>R</kbd> held: reference, <kbd>F</kbd> error map, <kbd>S</kbd> slider, "
    + "<kbd>I</kbd> <kbd>O</kbd> or wheel: zoom, <kbd>C</kbd> whole image, drag: move, "
    + "<kbd>+</kbd> <kbd>−</kbd> exposure, <kbd>X</kbd> exposure 0, <kbd>P</kbd> <kbd>N</kbd> previous "
    + "and next case, <kbd>H</kbd> this help. With the slider, drag moves it and Shift + drag the image.";

  let images = new Map();
  const build = () => {
    if (!entries().some((found) => found.name === state.name)) state.name = firstName();
    if (!entries().some((found) => found.name === state.other)) state.other = entries()[0].name;
    images = new Map();
    plane.replaceChildren();
    const picture = (found, source, coded) => {
      const image = make("img", { src: source, alt: found.name, className: coded ? "coded" : "",
        draggable: false, decoding: "sync" });
      plane.append(image);
      return image;
    };
    for (const found of entries()) {
      const errors = Object.entries(found.errors).map(([name, source]) => [name, picture(found, source, false)]);
      images.set(found.name, { image: picture(found, found.image, true), errors: Object.fromEntries(errors) });
    }
    stage.replaceChildren(plane, divider, tags.left, tags.right, legend);
    methods.replaceChildren(...entries().map((found, index) => {
      const chip = make("i", { className: "chip" });
      chip.style.background = found.color;
      const made = button("", `Show ${found.label}`, () => change({ name: found.name }));
      made.append(make("kbd", { textContent: keyOf(index) }), chip, make("b", { textContent: found.label }),
        make("small", { textContent: found.values[0] ?? "" }));
      made.dataset.name = found.name;
      return make("li", {}, made);
    }));
    other.replaceChildren(...entries().map((found) => make("option", { value: found.name, textContent: found.label })));
  };

  const visible = (name) => {
    const shown = images.get(entry(name).name);
    return shown.errors[state.error] || shown.image;
  };
  const label = (tag, name) => {
    const found = entry(name);
    const numbers = found.values.length ? ` ${found.values.join(" · ")}` : "";
    const note = state.error && !found.errors[state.error] ? " (no error map)" : "";
    tag.replaceChildren(found.label + note, make("small", { textContent: numbers }));
  };

  // Screen pixels per image pixel of the whole image; a whole number where it is larger than one.
  const ratio = () => window.devicePixelRatio || 1;
  const fitting = () => {
    const most = ratio() * Math.min(stage.clientWidth / page.width, stage.clientHeight / page.height);
    return most >= 1 ? Math.floor(most) : most;
  };
  const zoom = () => state.zoom || fitting();
  // Where the plane's corner lies: centred where the image is smaller than the stage, else covering.
  const corner = (axis) => {
    const size = [page.width, page.height][axis] * zoom() / ratio();
    const room = [stage.clientWidth, stage.clientHeight][axis];
    const wanted = room / 2 - state.at[axis] * zoom() / ratio();
    const place = size <= room ? (room - size) / 2 : clamp(wanted, room - size, 0);
    return Math.round(place * ratio()) / ratio();
  };
  const place = () => {
    const scale = zoom() / ratio();
    plane.style.transform = `translate(${corner(0)}px, ${corner(1)}px) scale(${scale})`;
    plane.classList.toggle("reduced", zoom() < 1);
    stage.classList.toggle("closer", zoom() > fitting());
    zoomText.textContent = `${Math.round(100 * zoom())} %`;
    const left = visible(state.name);
    if (state.mode === "slide" && visible(state.other) !== left) {
      const shown = (stage.clientWidth * state.split / 100 - corner(0)) / scale;
      left.style.clipPath = `inset(0px ${(page.width - clamp(shown, 0, page.width)).toFixed(2)}px 0px 0px)`;
    }
  };
  // Zoom so that the image's point under (x, y) of the stage stays there.
  const zoomTo = (wanted, x = stage.clientWidth / 2, y = stage.clientHeight / 2) => {
    const before = zoom() / ratio();
    const under = [(x - corner(0)) / before, (y - corner(1)) / before];
    state.zoom = wanted;
    const after = zoom() / ratio();
    change({ at: [under[0] + (stage.clientWidth / 2 - x) / after, under[1] + (stage.clientHeight / 2 - y) / after] });
  };
  const zoomBy = (steps, x, y) => {
    const now = zoom();
    const next = steps > 0 ? ZOOMS.find((found) => found > now + 1e-6)
      : ZOOMS.filter((found) => found < now - 1e-6).pop();
    if (next) zoomTo(next, x, y);
  };

  const draw = () => {
    const sliding = state.mode === "slide";
    for (const image of plane.children) {
      image.classList.remove("shown");
      image.style.clipPath = "";
      image.style.zIndex = "";
    }
    const left = visible(state.name);
    left.classList.add("shown");
    if (sliding && visible(state.other) !== left) {
      visible(state.other).classList.add("shown");
      left.style.zIndex = 1;
    }
    stage.classList.toggle("sliding", sliding);
    divider.hidden = tags.right.hidden = splitRow.hidden = !sliding;
    divider.style.left = `${state.split}%`;
    label(tags.left, state.name);
    label(tags.right, state.other);
    for (const made of methods.querySelectorAll("button")) {
      made.setAttribute("aria-pressed", String(made.dataset.name === state.name));
    }
    for (const made of maps) made.setAttribute("aria-pressed", String(made.dataset.error === state.error));
    buttons.toggle.setAttribute("aria-pressed", String(!sliding));
    buttons.slide.setAttribute("aria-pressed", String(sliding));
    buttons.help.setAttribute("aria-pressed", String(state.help));
    help.hidden = !state.help;
    legend.hidden = !state.error;
    legendName.textContent = page.errors.find(({ name }) => name === state.error)?.label ?? "";
    exposure.value = state.exposure;
    exposureText.textContent = `${state.exposure > 0 ? "+" : ""}${state.exposure} stops`;
    split.value = state.split;
    other.value = state.other;
    budgets.value = state.budget;
    setExposure(state.exposure);
    place();
  };

  const write = () => {
    const words = new URLSearchParams({ show: state.name });
    if (state.mode === "slide") { words.set("right", state.other); words.set("split", state.split); }
    if (state.error) words.set("error", state.error);
    if (state.exposure) words.set("exposure", state.exposure);
    if (state.zoom) { words.set("zoom", state.zoom); words.set("at", state.at.map((value) => value.toFixed(1))); }
    if (state.budget !== page.budgets[0].name) words.set("budget", state.budget);
    try { history.replaceState(null, "", `#${words}`); } catch { /* some browsers refuse it on disk */ }
  };
  const read = () => {
    const words = new URLSearchParams(location.hash.slice(1));
    const number = (name, low, high, normal) => {
      const value = Number(words.get(name) ?? normal);
      return Number.isFinite(value) ? clamp(value, low, high) : normal;
    };
    if (page.budgets.some(({ name }) => name === words.get("budget"))) state.budget = words.get("budget");
    state.name = words.get("show") ?? state.name;
    state.mode = words.has("right") ? "slide" : "toggle";
    state.other = words.get("right") ?? state.other;
    state.split = number("split", 0, 100, 50);
    state.exposure = number("exposure", -STOPS, STOPS, 0);
    state.error = page.errors.some(({ name }) => name === words.get("error")) ? words.get("error") : "";
    state.zoom = words.has("zoom") ? number("zoom", ZOOMS[0], ZOOMS[ZOOMS.length - 1], 0) : 0;
    const at = (words.get("at") ?? "").split(",").map(Number);
    if (at.length === 2 && at.every(Number.isFinite)) state.at = at;
  };
  const change = (what) => {
    const rebuild = what.budget !== undefined && what.budget !== state.budget;
    Object.assign(state, what);
    state.at = [clamp(state.at[0], 0, page.width), clamp(state.at[1], 0, page.height)];
    if (rebuild) build();
    draw();
    write();
  };

  const step = (by) => {
    const names = entries().map(({ name }) => name);
    change({ name: names[(names.indexOf(state.name) + by + names.length) % names.length] });
  };
  const nextError = () => {
    const names = ["", ...page.errors.map(({ name }) => name)];
    change({ error: names[(names.indexOf(state.error) + 1) % names.length] });
  };
  let held = null;
  const follow = (id) => document.getElementById(id)?.click();
  const actions = {
    ArrowLeft: () => step(-1), ArrowUp: () => step(-1), ArrowRight: () => step(1), ArrowDown: () => step(1),
    f: nextError,
    s: () => change({ mode: state.mode === "slide" ? "toggle" : "slide" }),
    i: () => zoomBy(1), o: () => zoomBy(-1), c: () => zoomTo(0),
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
    } else if (key === "r" && page.reference) {
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

  // Pointers that are down, where they are now; what a drag does is decided where it begins.
  const pointers = new Map();
  let drag = null;
  const spot = (event) => {
    const box = stage.getBoundingClientRect();
    return [event.clientX - box.left, event.clientY - box.top];
  };
  const slideTo = ([x]) => change({ split: Math.round(clamp(x / stage.clientWidth, 0, 1) * 1000) / 10 });
  const apart = () => {
    const [a, b] = [...pointers.values()];
    return { distance: Math.hypot(a[0] - b[0], a[1] - b[1]), middle: [(a[0] + b[0]) / 2, (a[1] + b[1]) / 2] };
  };
  stage.addEventListener("pointerdown", (event) => {
    pointers.set(event.pointerId, spot(event));
    stage.setPointerCapture(event.pointerId);
    if (pointers.size === 2) {
      drag = { kind: "pinch", distance: apart().distance, zoom: zoom() };
    } else if (state.mode === "slide" && !event.shiftKey) {
      drag = { kind: "slide" };
      slideTo(spot(event));
    } else {
      drag = { kind: "move", from: spot(event), at: state.at, moved: false };
    }
  });
  stage.addEventListener("pointermove", (event) => {
    if (!pointers.has(event.pointerId)) return;
    const now = spot(event);
    pointers.set(event.pointerId, now);
    if (drag?.kind === "slide") slideTo(now);
    if (drag?.kind === "pinch" && pointers.size === 2) {
      const { distance, middle } = apart();
      zoomTo(clamp(drag.zoom * distance / drag.distance, ZOOMS[0], ZOOMS[ZOOMS.length - 1]), ...middle);
    }
    if (drag?.kind === "move") {
      const by = [now[0] - drag.from[0], now[1] - drag.from[1]];
      drag.moved = drag.moved || Math.hypot(...by) > STILL;
      const scale = zoom() / ratio();
      if (drag.moved) change({ at: [drag.at[0] - by[0] / scale, drag.at[1] - by[1] / scale] });
    }
  });
  const lift = (event) => {
    pointers.delete(event.pointerId);
    if (event.type === "pointerup" && drag?.kind === "move" && !drag.moved) step(event.shiftKey ? -1 : 1);
    drag = null;
  };
  stage.addEventListener("pointerup", lift);
  stage.addEventListener("pointercancel", lift);
  stage.addEventListener("wheel", (event) => {
    event.preventDefault();
    zoomBy(event.deltaY < 0 ? 1 : -1, ...spot(event));
  }, { passive: false });
  window.addEventListener("hashchange", () => { read(); build(); draw(); });

  stage.style.aspectRatio = `${page.width} / ${page.height}`;
  stage.style.maxWidth = `calc(78vh * ${page.width / page.height})`;
  const side = make("div", { className: "side" },
    make("div", { className: "controls" }, buttons.toggle, buttons.slide, ...maps, buttons.help), help);
  if (page.budgets.length > 1) side.append(make("div", { className: "controls" }, make("label", {}, "budget", budgets)));
  side.append(splitRow, zooms, make("div", { className: "controls" },
    make("label", { htmlFor: "stops" }, "exposure"), exposure, exposureText), methods);
  root.append(stage, side);
  read();
  build();
  draw();
  new ResizeObserver(place).observe(stage);
  root.dataset.ready = "true";
})();
