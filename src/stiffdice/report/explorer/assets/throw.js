// The live kernel: controls that run a throw of the paper's cube at once, its replay, and height and energy beside it.

const MOST_STEPS = 200000;
// States kept of a run, at most.
const KEPT = 4000;
// What each control changes. low, high: what is allowed; scale: log or linear; step: of the slider where it is linear.
const CONTROLS = [
  { key: "stiffness", label: "Stiffness S of a node", unit: "kg/s²", low: 100, high: 1e8, scale: "log" },
  { key: "steps", label: "Time steps", unit: "to 10 s", low: 1000, high: MOST_STEPS, scale: "log", whole: true },
  { key: "damping", label: "Damping D of a node", unit: "kg/s", low: 0, high: 5, scale: "linear", step: 0.01 },
  { key: "friction", label: "Friction coefficient µ", unit: "no unit", low: 0, high: 1, scale: "linear", step: 0.005 },
  { key: "spin", label: "Spin", unit: "kg m²/s: (L, L/2, L/4)", low: 0, high: 0.75, scale: "linear", step: 0.01 },
];
// The paper's cure, 20,000 steps, is a lucky number: docs/explanation/stability.md.
const START = { stiffness: 1e6, steps: 10000, damping: 0.2, friction: 0.075, spin: 0, preset: "as_written", model: "sliding" };
const EXAMPLES = [10000, 20000, 23000];
// Beyond so many times the launch's value a chart ends.
const BEYOND = 20;

/** Return the scene of the controls' values; bases: by preset, of a tumbling cube. */
function sceneOf(bases, values) {
  const base = bases[values.preset], turning = values.model === "tumbling";
  const momentum = turning ? [values.spin, values.spin / 2, values.spin / 4] : [0, 0, 0];
  // The listings' first step moves the nodes without the spin; the text's does not.
  const rigid = values.preset === "as_written";
  return {
    ...base,
    model: values.model,
    stiffness: values.stiffness,
    damping: values.damping,
    friction: values.friction,
    angular_momentum: momentum,
    angular_velocity: rigid ? momentum.map((part) => part / base.inertia) : [0, 0, 0],
  };
}

/** Return the command that makes the same run. */
function commandOf(values) {
  const changes = ["stiffness", "damping", "friction"].map((key) => `--set ground.${key}=${values[key]}`);
  if (values.model === "tumbling") {
    changes.push(`--set 'launch.angular_momentum=[${values.spin}, ${values.spin / 2}, ${values.spin / 4}]'`);
  }
  const run = `stiffdice run config/scenes/figure-13.yaml --preset ${values.preset} --model ${values.model}`;
  return `${run} --scheme symplectic_euler --steps ${values.steps} ${changes.join(" ")} -o run.h5`;
}

/** Return the value of a slider's place from 0 to 1000 and back, three digits at most. */
function valueAt({ low, high, scale, whole }, place) {
  if (scale === "linear") return Number(place);
  const value = Number((low * (high / low) ** (place / 1000)).toPrecision(3));
  return whole ? Math.round(value) : value;
}

function placeOf({ low, high, scale }, value) {
  return scale === "linear" ? value : (1000 * Math.log(value / low)) / Math.log(high / low);
}

/** Return why a value is not allowed; nothing if it is. */
function objection({ label, unit, low, high, whole }, value) {
  if (Number.isFinite(value) && value >= low && value <= high && !(whole && !Number.isInteger(value))) return "";
  return `${label}: allowed is ${whole ? "a whole number" : "a number"} from ${readable(low)} to ${readable(high)} [${unit}]`;
}

/** Mount a slider with its number beside it; returns { element, show(value), enable(yes) }. changed(value): told. */
function mountControl(control, changed) {
  const { key, label, unit, low, high, scale, step } = control, hint = html("p", { class: "hint", id: `${key}-hint` });
  const ends = scale === "log" ? { min: 0, max: 1000, step: 1 } : { min: low, max: high, step };
  const slider = html("input", { type: "range", id: `${key}-slider`, "aria-label": label, ...ends });
  const number = html("input", { type: "number", id: key, min: low, max: high, step: "any", "aria-describedby": hint.id });
  const told = (value, by) => {
    const problem = objection(control, value);
    hint.textContent = problem;
    hint.hidden = !problem;
    number.toggleAttribute("aria-invalid", Boolean(problem));
    if (problem) return;
    show(value, by);
    changed(value);
  };
  function show(value, by = null) {
    if (by !== number) number.value = value;
    if (by !== slider) slider.value = placeOf(control, value);
    slider.setAttribute("aria-valuetext", `${readable(value)} ${unit}`);
  }
  function enable(yes) {
    slider.disabled = number.disabled = !yes;
  }
  hint.hidden = true;
  slider.addEventListener("input", () => told(valueAt(control, slider.value), slider));
  number.addEventListener("input", () => told(number.value === "" ? NaN : Number(number.value), number));
  const name = html("label", { for: key }, label, html("span", { class: "unit" }, ` [${unit}]`));
  return { element: html("div", { class: "control" }, name, number, slider, hint), show, enable };
}

/** Return a select with its label; options: [value, text]. */
function choice(id, label, options, changed) {
  const select = html("select", { id }, ...options.map(([value, text]) => html("option", { value }, text)));
  select.addEventListener("change", () => changed(select.value));
  return { element: html("div", { class: "control" }, html("label", { for: id }, label), select), select };
}

/** Return the elements of a replay in a figure; name: what is shown, for those who do not see it. */
function replayParts(id, name) {
  const canvas = html("canvas", { class: "view", id: `${id}-view`, role: "img", "aria-label": name });
  const play = html("button", { type: "button", id: `${id}-play` }, "Play");
  const scrub = html("input", { type: "range", id: `${id}-scrub`, min: 0, max: 1, value: 0, "aria-label": "Time of the replay" });
  const clock = html("output", { id: `${id}-clock`, class: "clock" }, "0.00 s");
  const speeds = [["0.1", "× 0.1"], ["0.25", "× 0.25"], ["1", "× 1"], ["4", "× 4"]];
  const speed = html("select", { id: `${id}-speed`, "aria-label": "Speed of the replay" });
  speed.append(...speeds.map(([value, text]) => html("option", { value }, text)));
  speed.value = "1";
  const bar = html("div", { class: "player" }, play, scrub, clock, speed);
  return { element: html("div", { class: "replay" }, canvas, bar), canvas, play, scrub, clock, speed };
}

/** Return a typed array's largest finite number, and whether it goes beyond `most`. */
function extent(values, count, most) {
  let high = 0, low = 0;
  for (let k = 0; k < count; k++) {
    if (values[k] > high) high = values[k];
    if (values[k] < low) low = values[k];
  }
  return { high: Math.min(high, most), low: Math.max(low, -most), beyond: high > most || low < -most };
}

/** Return what a chart of height shows, and one of energy. */
function chartsOf(run) {
  const x = run.t.subarray(0, run.count), end = run.scene.duration, height = new Float64Array(run.count);
  for (let k = 0; k < run.count; k++) height[k] = run.position[3 * k + 2];
  const energy = run.mechanical.subarray(0, run.count), stored = run.potential.subarray(0, run.count);
  const start = run.mechanical[0], up = extent(height, run.count, BEYOND * 4.3);
  const all = extent(energy, run.count, BEYOND * start);
  const of = ({ beyond }) => (beyond ? "; values beyond the axis are drawn at its end" : "");
  return {
    height: {
      label: `Height of the centre over ${end} s, up to ${readable(Math.max(...height.filter(Number.isFinite)))} m${of(up)}`,
      unit: "height [m]", x, end, low: Math.min(0, up.low), high: Math.max(5, up.high * 1.05),
      lines: [{ style: "first", y: height }], marks: [{ y: run.scene.side / 2 }],
    },
    energy: {
      label: `Mechanical energy over ${end} s, from ${readable(start)} J to ${readable(energy[run.count - 1])} J${of(all)}`,
      unit: "energy [J]", x, end, low: Math.min(0, all.low), high: all.high * 1.1,
      lines: [{ style: "second", y: stored }, { style: "first", y: energy }], marks: [{ y: start }],
    },
  };
}

/** Return 21 states of a run as rows of a table. */
function rowsOf(run) {
  const rows = [];
  for (let k = 0; k <= 20; k++) {
    const row = Math.round((k / 20) * (run.count - 1)), place = [0, 1, 2].map((axis) => run.position[3 * row + axis]);
    rows.push([run.t[row], ...place, run.mechanical[row], run.kinetic[row], run.potential[row]].map(readable));
  }
  return rows;
}

/** Return what is said of a run: a line for the verdict, and [name, value] of its measures. */
function toldOf(run, milliseconds) {
  const { verdict, scene, steps } = run, omegaH = (contactFrequency(scene) * scene.duration) / steps;
  const measures = [
    ["ωh of a flat landing", `${readable(omegaH)} (linear limit without damping: 2)`],
    ["largest energy in the air, over the launch's", readable(verdict.energyRatio)],
    ["largest rebound, over the one before", verdict.apexRatio === null ? "not judged: spin may rightly raise it" : readable(verdict.apexRatio)],
    ["bounces", readable(verdict.bounces)],
    ["highest place of the centre", `${readable(highestOf(run))} m`],
    ["computed in", `${Math.max(1, Math.round(milliseconds))} ms`],
  ];
  const sentence = verdict.sentence[0].toUpperCase() + verdict.sentence.slice(1);
  return { line: `${sentence}. ${readable(steps)} steps, ωh = ${omegaH.toFixed(2)}.`, measures };
}

/** Show the live kernel in an element; bases: scenes by preset, as page.py writes them. */
function mountThrow(element, bases) {
  const values = { ...START }, controls = {};
  let due = false, showing = false;
  const verdict = html("p", { id: "throw-verdict", class: "verdict", role: "status", "aria-live": "polite" });
  const measures = html("dl", { id: "throw-measures" }), command = html("code", { id: "throw-command" });
  const parts = replayParts("throw", "The cube as it flies and bounces"), replay = mountReplay(parts);
  const heightBox = html("div", { class: "chart", id: "throw-height" }), energyBox = html("div", { class: "chart", id: "throw-energy" });
  const height = lineChart(heightBox), energy = lineChart(energyBox), numbers = html("div", { class: "scroll", tabindex: "0", role: "region", "aria-label": "Numbers of the run" });
  const still = matchMedia("(prefers-reduced-motion: reduce)");
  replay.onTime = (t) => [height, energy].forEach((chart) => chart.cursor(t));

  function change(key, value) {
    values[key] = value;
    if (!due) requestAnimationFrame(rerun);
    due = true;
  }

  function rerun() {
    due = false;
    controls.spin.enable(values.model === "tumbling");
    const begun = performance.now();
    const run = simulate(sceneOf(bases, values), values.steps, Math.ceil(values.steps / KEPT));
    const { line, measures: list } = toldOf(run, performance.now() - begun), charts = chartsOf(run);
    verdict.textContent = line;
    verdict.dataset.verdict = run.verdict.name;
    measures.replaceChildren(...list.flatMap(([name, value]) => [html("dt", {}, name), html("dd", {}, value)]));
    command.textContent = commandOf(values);
    height.draw(charts.height);
    energy.draw(charts.energy);
    const heads = ["t [s]", "x [m]", "y [m]", "z [m]", "mechanical energy [J]", "kinetic [J]", "m g z [J]"];
    numbers.replaceChildren(tableOf("Place of the centre and energies", heads, rowsOf(run)));
    replay.show(run, showing && !still.matches);
    showing = true;
    for (const button of examples.children) button.setAttribute("aria-pressed", String(isExample(Number(button.value))));
  }

  const isExample = (steps) => Object.keys(START).every((key) => values[key] === (key === "steps" ? steps : START[key]));
  const examples = html("div", { class: "buttons", role: "group", "aria-label": "Examples at S = 10⁶ kg/s², as written" });
  for (const steps of EXAMPLES) {
    const omegaH = (20000 / steps).toFixed(2), button = html("button", { type: "button", value: steps }, `${readable(steps)} steps`);
    button.append(html("small", {}, `ωh = ${omegaH}`));
    button.addEventListener("click", () => {
      Object.assign(values, START, { steps });
      showValues();
      change("steps", steps);
    });
    examples.append(button);
  }

  for (const control of CONTROLS) controls[control.key] = mountControl(control, (value) => change(control.key, value));
  const laws = [["as_written", "as written: gated"], ["as_listed", "as listed: ungated"]];
  const preset = choice("preset", "Contact law", laws, (value) => change("preset", value));
  const models = [["sliding", "sliding: no rotation"], ["tumbling", "tumbling"]];
  const model = choice("model", "Motion", models, (value) => change("model", value));
  function showValues() {
    for (const { key } of CONTROLS) controls[key].show(values[key]);
    preset.select.value = values.preset;
    model.select.value = values.model;
  }
  showValues();

  const inputs = html("fieldset", { class: "controls" }, html("legend", {}, "Ground, steps and launch"));
  inputs.append(...CONTROLS.map(({ key }) => controls[key].element), preset.element, model.element);
  const views = html("div", { class: "views" }, parts.element, html("div", {}, caption("Height of the centre", "dashed: at rest"), heightBox, caption("Mechanical energy", "and, faint, its part m g z; dashed: at the launch"), energyBox));
  const more = [details("The same run on the command line", html("pre", { class: "scroll", tabindex: "0" }, command)), details("Numbers behind the charts", numbers)];
  element.replaceChildren(examples, inputs, verdict, views, measures, ...more);
  rerun();
}

/** Return a heading of a chart, with what is to be known beside it. */
function caption(title, beside) {
  return html("p", { class: "chart-title" }, html("strong", {}, title), html("span", { class: "unit" }, ` ${beside}`));
}

/** Return content that opens on demand. */
function details(title, content) {
  return html("details", {}, html("summary", {}, title), content);
}
