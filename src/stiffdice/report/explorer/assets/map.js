// The stability map: which members pass, by stiffness and steps; and of a cell that is chosen a member's run, made again
// here, beside the exact one. `mountMap(element, data)` fills an element; data: what map_data.py's `collect` returns.

const MAP_PAGE = `
  <form class="map-controls">
    <label>Sweep <select name="sweep"></select></label>
    <fieldset><legend>Contact law</legend><span data-part="laws"></span></fieldset>
    <fieldset><legend>A member passes if</legend><span data-part="criteria"></span></fieldset>
    <fieldset><legend>Vertical axis</legend>
      <label><input type="radio" name="axis" value="omega_h" checked> ωh, contact frequency × step size</label>
      <label><input type="radio" name="axis" value="steps"> time steps</label>
    </fieldset>
  </form>
  <p data-part="about" class="map-note"></p>
  <div data-part="map" class="map-plot" tabindex="0" role="application" aria-roledescription="map"
    aria-label="Stability map" aria-describedby="map-keys"></div>
  <p data-part="legend" class="map-note"></p>
  <p id="map-keys" class="map-note">Click a cell, or focus the map: ← → change the stiffness, ↑ ↓ go to the next cell
    (Page Up and Page Down ten), Enter runs it. Or choose here:</p>
  <form class="map-choice">
    <label>Stiffness S [kg/s²] <select name="stiffness"></select></label>
    <label>Time steps <input name="steps" type="number" min="1" step="1" required></label>
    <button type="submit">Nearest cell</button>
  </form>
  <p data-part="summary" class="map-summary" aria-live="polite"></p>
  <div data-part="run" hidden>
    <p class="map-member"><label>Member <select name="member"></select></label> <span data-part="member"></span></p>
    <p data-part="verdict" class="map-summary" aria-live="polite"></p>
    <table class="map-outcomes" data-part="outcomes"></table>
    <div data-part="height" class="map-plot"></div>
    <div data-part="energy" class="map-plot"></div>
    <p data-part="caveat" class="map-note"></p>
  </div>
  <details data-part="edges"><summary>Edges as a table</summary><div class="map-table"></div></details>
  <details data-part="cells"><summary>Cells of this stiffness as a table</summary><div class="map-table"></div></details>`;

const SUPERSCRIPTS = "⁰¹²³⁴⁵⁶⁷⁸⁹";
const MAGIC = [2, 3, 4, 5, 6]; // whose steps are marked: ωh = 2 sin(π/2n)
const FIRST_CELL = [1e6, 10000]; // shown at first: stiffness [kg/s²] and steps of the paper's figures 9 and 10

function superscript(number) {
  return String(number).replace(/./g, (sign) => (sign === "-" ? "⁻" : SUPERSCRIPTS[Number(sign)]));
}

// A number as a person writes it: 10⁶, 2.51×10⁴, 0.075.
function readableNumber(value, digits = 4) {
  if (value === null || Number.isNaN(value)) return "–";
  if (!Number.isFinite(value)) return value > 0 ? "∞" : "−∞";
  const rounded = Number(value.toPrecision(digits)), size = Math.abs(rounded);
  if (rounded === 0 || (size >= 1e-3 && size < 1e5)) return String(rounded);
  const [mantissa, exponent] = rounded.toExponential().split("e");
  const power = `10${superscript(Number(exponent))}`;
  return mantissa === "1" ? power : `${mantissa}×${power}`;
}

function wholeNumber(value) {
  return value === null ? "–" : Math.round(value).toLocaleString("en");
}

// Borders half-way between neighbours, in the logarithm: report/figures/style.py, `borders`.
function bordersOf(centres) {
  const logs = centres.map(Math.log), between = logs.slice(1).map((place, k) => (place + logs[k]) / 2);
  const last = logs.length - 1;
  const first = last > 0 ? 2 * logs[0] - between[0] : logs[0] - 0.5;
  const end = last > 0 ? 2 * logs[last] - between[last - 1] : logs[last] + 0.5;
  return [first, ...between, end].map(Math.exp);
}

class StabilityMap {
  constructor(element, data, block) {
    this.data = data;
    this.block = block;
    this.sweeps = data.maps.map((about) => new Sweep(about, block));
    this.element = element;
    element.innerHTML = MAP_PAGE;
    this.part = Object.fromEntries([...element.querySelectorAll("[data-part]")].map((node) => [node.dataset.part, node]));
    this.field = Object.fromEntries([...element.querySelectorAll("select, input[type=number]")].map((node) => [node.name, node]));
    this.axis = "omega_h";
    this.listen();
    this.options(this.field.sweep, this.sweeps.map((sweep, k) => [k, this.titleOf(sweep)]));
    this.takeSweep(0);
  }

  titleOf(sweep) {
    const stiffnesses = new Set(sweep.columns.map(({ stiffness }) => stiffness)).size;
    return `${sweep.model}, ${stiffnesses} stiffnesses (${sweep.name})`;
  }

  options(select, pairs) {
    select.replaceChildren(...pairs.map(([value, text]) => new Option(text, value)));
  }

  radios(part, name, pairs, chosen) {
    part.replaceChildren(
      ...pairs.map(([value, text]) => {
        const label = document.createElement("label"), input = document.createElement("input");
        Object.assign(input, { type: "radio", name, value, checked: value === chosen });
        label.append(input, ` ${text}`);
        return label;
      }),
    );
  }

  listen() {
    const [controls, choice] = this.element.querySelectorAll("form");
    controls.addEventListener("change", ({ target }) => {
      if (target.name === "sweep") this.takeSweep(Number(target.value));
      else {
        this[target.name] = target.value;
        this.refresh();
      }
    });
    controls.addEventListener("submit", (event) => event.preventDefault());
    choice.addEventListener("submit", (event) => {
      event.preventDefault();
      const column = this.sweep.ofLaw(this.law)[Number(this.field.stiffness.value)];
      this.choose(this.sweep.nearest(column, Number(this.field.steps.value)), true);
    });
    this.field.member.addEventListener("change", ({ target }) => this.show(Number(target.value)));
    this.part.map.addEventListener("keydown", (event) => this.press(event));
    window.matchMedia("(prefers-color-scheme: dark)").addEventListener("change", () => this.refresh());
    for (const name of ["edges", "cells"]) this.part[name].addEventListener("toggle", () => this.tables());
  }

  takeSweep(number) {
    const sweep = this.sweeps[number], laws = [...new Set(sweep.columns.map(({ law }) => law))];
    const criteria = sweep.criteria.map(({ name, words }) => [name, `${name}: ${words}`]);
    this.sweep = sweep;
    if (!laws.includes(this.law)) this.law = laws[0];
    if (!sweep.names.includes(this.criterion)) this.criterion = sweep.mostDisputed();
    this.radios(this.part.laws, "law", laws.map((law) => [law, this.data.laws[law]]), this.law);
    this.radios(this.part.criteria, "criterion", criteria, this.criterion);
    this.part.about.textContent =
      `results/${sweep.name.replace("/", "/sweeps/")}: ${sweep.steps.length.toLocaleString("en")} cells of ${sweep.members} members each: launches spread over the ` +
      `phase of the first touch-down${sweep.turns ? ", the orientation and the axis of the spin" : ""}. ` +
      `${sweep.scene.duration} s, symplectic Euler, ${sweep.ground}.`;
    this.cell = null;
    this.refresh();
    const [stiffness, steps] = FIRST_CELL, off = (column) => Math.abs(Math.log(column.stiffness / stiffness));
    const column = sweep.ofLaw(this.law).reduce((best, other) => (off(other) < off(best) ? other : best));
    this.choose(sweep.nearest(column, steps), true);
  }

  // Draw anew after a choice; the chosen stiffness and steps are kept where the other law has them, too.
  refresh() {
    const columns = this.sweep.ofLaw(this.law), old = this.cell === null ? null : this.sweep.column(this.cell);
    this.options(this.field.stiffness, columns.map(({ stiffness }, k) => [k, readableNumber(stiffness, 6)]));
    this.draw();
    if (old === null) {
      this.part.summary.textContent = "No cell is chosen.";
      this.part.run.hidden = true;
      this.tables();
      return;
    }
    const same = columns.find(({ stiffness }) => stiffness === old.stiffness) ?? columns[0];
    this.choose(this.sweep.nearest(same, this.sweep.steps[this.cell]), !this.part.run.hidden);
  }

  place(cell) {
    return this.axis === "steps" ? this.sweep.steps[cell] : this.sweep.omegaH(cell);
  }

  cellsOf({ first, count }) {
    const cells = Array.from({ length: count }, (_, k) => first + k);
    return this.axis === "steps" ? cells : cells.reverse(); // ascending along the axis
  }

  draw() {
    const columns = this.sweep.ofLaw(this.law), sides = bordersOf(columns.map(({ stiffness }) => stiffness));
    this.cells = columns.map((column) => this.cellsOf(column));
    const traces = columns.map((column, k) => ({
      type: "heatmap",
      x: [sides[k], sides[k + 1]],
      y: bordersOf(this.cells[k].map((cell) => this.place(cell))),
      z: this.cells[k].map((cell) => [this.sweep.share(this.criterion, cell)]),
      text: this.cells[k].map((cell) => [this.hover(cell)]),
      hovertemplate: "%{text}<extra></extra>",
      coloraxis: "coloraxis",
    }));
    const layout = mapLayout(this, traces);
    const unused = ["toImage", "select2d", "lasso2d"];
    const options = { responsive: true, displaylogo: false, doubleClick: "reset", modeBarButtonsToRemove: unused };
    Plotly.react(this.part.map, [...traces, ...edgeTraces(this, columns), cursorTrace(this)], layout, options);
    this.tick(); // a zoom outlasts a change of law or criterion
    if (!this.clicks) {
      this.clicks = true;
      this.part.map.on("plotly_click", ({ points }) => {
        const [point] = points;
        const cell = this.cells[point.curveNumber]?.[point.pointNumber[0]];
        if (cell !== undefined) this.choose(cell, true);
      });
      this.part.map.on("plotly_relayout", (change) => {
        if ("yaxis.range[0]" in change || "yaxis.autorange" in change || "yaxis.range" in change) this.tick();
      });
    }
    const magic = this.axis === "omega_h" ? " At the right: magic steps ωh = 2 sin(π/2n), at which an undamped bounce keeps its energy." : "";
    this.part.legend.textContent =
      `○ first pass: the fewest steps at which all ${this.sweep.members} members pass. ▲ last fail: the most at which one ` +
      `still fails. Dashed: ωh = 2, the linear limit of stability.${magic}`;
  }

  /** Label what is seen of the axis of ωh after a zoom. */
  tick() {
    if (this.axis !== "omega_h") return;
    const [low, high] = this.part.map.layout.yaxis.range.map((power) => 10 ** power), values = logTicks(low, high);
    Plotly.relayout(this.part.map, { "yaxis.tickvals": values, "yaxis.ticktext": values.map(String) });
  }

  about(criterion) {
    return this.sweep.criteria.find(({ name }) => name === criterion);
  }

  hover(cell) {
    const { sweep, criterion } = this, { members } = sweep, passing = members - sweep.failing(criterion, cell).length;
    return (
      `S = ${readableNumber(sweep.column(cell).stiffness)} kg/s²<br>${wholeNumber(sweep.steps[cell])} steps, ` +
      `ωh = ${readableNumber(sweep.omegaH(cell))}<br>${passing} of ${members} pass (${percent(passing / members)})<br>` +
      `worst ${this.about(criterion).measure}: ${readableNumber(sweep.worstOf(criterion, cell))}`
    );
  }

  press(event) {
    const columns = this.sweep.ofLaw(this.law), jumps = { ArrowUp: 1, ArrowDown: -1, PageUp: 10, PageDown: -10 };
    const sideways = { ArrowLeft: -1, ArrowRight: 1 };
    if (event.altKey || event.ctrlKey || event.metaKey) return;
    if (!(event.key in jumps || event.key in sideways || event.key === "Enter" || event.key === " ")) return;
    event.preventDefault();
    if (this.cell === null) {
      const column = columns[columns.length >> 1];
      this.choose(this.sweep.nearest(column, column.limit ?? 1), false);
    } else if (event.key in jumps) {
      const at = columns.indexOf(this.sweep.column(this.cell)), cells = this.cells[at];
      const next = cells.indexOf(this.cell) + jumps[event.key];
      this.choose(cells[Math.min(Math.max(next, 0), cells.length - 1)], false);
    } else if (event.key in sideways) {
      const at = columns.indexOf(this.sweep.column(this.cell)) + sideways[event.key];
      const column = columns[Math.min(Math.max(at, 0), columns.length - 1)];
      const wanted = this.axis === "steps" ? this.sweep.steps[this.cell] : column.radians / this.sweep.omegaH(this.cell);
      this.choose(this.sweep.nearest(column, wanted), false);
    }
    if (event.key === "Enter" || event.key === " ") this.choose(this.cell, true);
  }

  // Mark a cell and say its numbers; run: compute a member of it, too.
  choose(cell, run) {
    const { sweep, criterion } = this, column = sweep.column(cell);
    this.cell = cell;
    Plotly.restyle(this.part.map, { x: [[column.stiffness]], y: [[this.place(cell)]] }, [this.part.map.data.length - 1]);
    this.field.stiffness.value = String(sweep.ofLaw(this.law).indexOf(column));
    this.field.steps.value = String(sweep.steps[cell]);
    this.part.summary.textContent = summaryOf(this, cell);
    this.tables();
    this.part.run.hidden = !run || !sweep.runs_again;
    if (this.part.run.hidden) return;
    const failing = new Set(sweep.failing(criterion, cell));
    this.options(
      this.field.member,
      [...Array(sweep.members).keys()].map((k) => [k, `${k}: ${failing.has(k) ? "fails" : "passes"} ${criterion}`]),
    );
    const member = sweep.preferred(criterion, cell);
    this.field.member.value = String(member);
    this.show(member);
  }

  tables() {
    if (this.part.edges.open) fillTable(this.part.edges, edgeTable(this));
    this.part.cells.hidden = this.cell === null;
    if (this.part.cells.open && this.cell !== null) fillTable(this.part.cells, cellTable(this));
  }

  // Make a member's run again and draw it beside the exact one.
  show(member) {
    showRun(this, member);
  }
}

function percent(share) {
  return `${Math.round(100 * share)} %`;
}

/** Show the map of stored sweeps in an element; data: as map_data.collect() in Python returns it. */
async function mountMap(element, data) {
  if (data.maps.length === 0) {
    element.textContent = `No sweep is stored that gives a map: ${data.made_by} make some; then publish this page again.`;
    return null;
  }
  element.textContent = "Unpacking the stored sweeps …";
  const [block] = await Promise.all([unpackedBlock(data.block), loadPlotly()]);
  return new StabilityMap(element, data, block);
}
