// What the stability map draws and says: axes, edges, the numbers of a cell, a member's run beside the exact one.

const CLEAR = "rgba(0,0,0,0)";

/** Return a colour of style.css, light or dark. */
function themed(name) {
  return getComputedStyle(document.documentElement).getPropertyValue(name).trim();
}

/** Return what all plots share: the page's own font and colours. */
function plotLook() {
  return { font: { family: "system-ui, sans-serif", size: 13, color: themed("--ink") }, paper_bgcolor: CLEAR, plot_bgcolor: CLEAR };
}

function isNarrow() {
  return window.innerWidth < 600;
}

function logAxis(title) {
  return { type: "log", title: { text: title }, showgrid: false, ticks: "outside", zeroline: false };
}

/** Return round numbers between two of a logarithmic axis: 1, 2 and 5 times powers of ten, or finer ones. */
function logTicks(low, high) {
  const found = [];
  if (high / low > 4) {
    for (let power = Math.floor(Math.log10(low)); power <= Math.log10(high); power += 1) {
      found.push(...[1, 2, 5].map((digit) => Number(`${digit}e${power}`)));
    }
  } else {
    const rough = (high - low) / 6, power = 10 ** Math.floor(Math.log10(rough));
    const step = power * ([1, 2, 5].find((digit) => digit * power >= rough) ?? 10);
    for (let k = Math.ceil(low / step); k * step <= high; k += 1) found.push(Number((k * step).toPrecision(6)));
  }
  return found.filter((value) => value >= low && value <= high);
}

function mapLayout(map, tiles) {
  const { axis, sweep } = map;
  const magic = axis === "omega_h" ? MAGIC.map((n) => [n, 2 * Math.sin(Math.PI / (2 * n))]) : [];
  const log = (values) => values.map(Math.log10), sides = tiles.flatMap(({ x }) => x), [low, high] = rangeOf(tiles.flatMap(({ y }) => y));
  const tickvals = logTicks(low, high);
  return {
    height: isNarrow() ? 420 : 520,
    margin: { l: 58, r: 44, t: 12, b: 118 },
    ...plotLook(),
    hovermode: "closest",
    dragmode: isNarrow() ? false : "zoom",
    uirevision: `${sweep.name} ${axis}`,
    showlegend: false,
    xaxis: { ...logAxis("stiffness S [kg/s²]"), range: log(rangeOf(sides)), exponentformat: "power", dtick: 1 },
    yaxis: {
      ...logAxis(axis === "steps" ? `time steps in ${sweep.scene.duration} s [1]` : "ωh of a flat landing [1]"),
      range: log([low, high]),
      ...(axis === "steps" ? { exponentformat: "power", dtick: 1 } : { tickvals, ticktext: tickvals.map(String) }),
    },
    coloraxis: {
      cmin: 0,
      cmax: 1,
      colorscale: "Cividis",
      colorbar: {
        orientation: "h", yref: "container", y: 0, yanchor: "bottom", len: 0.9, thickness: 12, tickformat: ".0%",
        title: { text: "share of members that pass", side: "top" },
      },
    },
    annotations: magic.map(([n, omegaH]) => ({
      xref: "paper", x: 1, xanchor: "left", y: Math.log10(omegaH), text: `– n=${n}`, showarrow: false,
      font: { size: 11 },
    })),
  };
}

function edgeTraces(map, columns) {
  const { axis, criterion, data } = map, { color } = map.about(criterion);
  const at = (column, steps) => (steps === null || axis === "steps" ? steps : column.radians / steps);
  const x = columns.map(({ stiffness }) => stiffness), look = { hoverinfo: "skip", x };
  const limit = columns.map((column) => at(column, column.limit)), size = isNarrow() ? 9 : 13;
  const marks = (edge, marker) => ({
    ...look, type: "scatter", mode: "markers", y: columns.map((column) => at(column, column[edge][criterion])), marker,
  });
  return [
    { ...look, type: "scatter", mode: "lines", y: limit, line: { color: "white", width: 3.5 } },
    { ...look, type: "scatter", mode: "lines", y: limit, line: { color: data.looks.theory, width: 1.5, dash: "dash" } },
    marks("last_fail", { size: size - 2, color, line: { color: "white", width: 1.5 }, symbol: "triangle-up" }),
    marks("first_pass", { size, color: "white", line: { width: size / 2 }, symbol: "circle-open" }),
    marks("first_pass", { size, color, line: { width: size / 4 }, symbol: "circle-open" }),
  ];
}

function cursorTrace(map) {
  const at = map.cell === null ? [[null], [null]] : [[map.sweep.column(map.cell).stiffness], [map.place(map.cell)]];
  const marker = { size: 18, symbol: "square-open", color: "#ffffff", line: { width: 3, color: map.data.looks.ink } };
  return { type: "scatter", mode: "markers", hoverinfo: "skip", x: at[0], y: at[1], marker };
}

function summaryOf(map, cell) {
  const { sweep, criterion, data } = map, failing = sweep.failing(criterion, cell).length, { members } = sweep;
  const { measure, limit } = map.about(criterion);
  const ended = sweep.ended(cell).map(([verdict, count]) => `${count} ${data.verdicts[verdict].replaceAll("_", " ")}`);
  const bound = sweep.early_stop ? "; runs ended once every criterion was decided, so a larger one may not have been seen" : "";
  return (
    `S = ${readableNumber(sweep.column(cell).stiffness, 6)} kg/s², ${wholeNumber(sweep.steps[cell])} steps, ` +
    `ωh = ${readableNumber(sweep.omegaH(cell))}: ${members - failing} of ${members} members pass ${criterion} ` +
    `(${percent(1 - failing / members)}). The worst ${measure} is ${readableNumber(sweep.worstOf(criterion, cell))}, ` +
    `allowed is at most ${limit}${bound}. Verdicts by all criteria: ${ended.join(", ")}.`
  );
}

function edgeTable(map) {
  const rows = map.sweep.ofLaw(map.law).map((column) => [
    readableNumber(column.stiffness, 6),
    ...[column.limit, column.first_pass[map.criterion], column.last_fail[map.criterion]].map(wholeNumber),
  ]);
  const caption = `Steps at the edges of ${map.criterion}, ${map.data.laws[map.law]}`;
  return [caption, ["S [kg/s²]", "ωh = 2", "first pass", "last fail"], rows];
}

function cellTable(map) {
  const { sweep } = map, column = sweep.column(map.cell);
  const rows = Array.from({ length: column.count }, (_, k) => column.first + k).map((cell) => [
    wholeNumber(sweep.steps[cell]),
    readableNumber(sweep.omegaH(cell)),
    ...sweep.names.flatMap((name) => [
      `${sweep.members - sweep.failing(name, cell).length}`, readableNumber(sweep.worstOf(name, cell)),
    ]),
  ]);
  const heads = sweep.criteria.flatMap(({ name, measure }) => [`pass ${name}`, `worst ${measure}`]);
  const caption = `Cells at S = ${readableNumber(column.stiffness, 6)} kg/s², ${map.data.laws[map.law]}, of ${sweep.members} members`;
  return [caption, ["steps", "ωh", ...heads], rows];
}

function fillTable(details, content) {
  const table = document.createElement("table");
  fillRows(table, content);
  details.querySelector("div").replaceChildren(table);
}

function fillRows(table, [caption, heads, rows]) {
  table.replaceChildren();
  table.createCaption().textContent = caption;
  const head = table.createTHead().insertRow();
  for (const text of heads) {
    const cell = document.createElement("th");
    Object.assign(cell, { scope: "col", textContent: text });
    head.append(cell);
  }
  const body = table.createTBody();
  for (const row of rows) {
    const line = body.insertRow();
    for (const text of row) line.insertCell().textContent = text;
  }
}

// Make a member's run again, draw it beside the exact one, and say how it ends.
function showRun(map, member) {
  const { sweep, cell, data, part } = map, number = sweep.path(cell, member);
  const exact = number === undefined ? null : new ExactPath(data.paths[number], map.block);
  const run = rerun(data, sweep, cell, member, exact);
  const failing = sweep.failing(map.criterion, cell);
  part.member.textContent =
    failing.length === 0 ? `All ${sweep.members} pass ${map.criterion}.`
    : failing[0] === member ? `It is the first of the ${failing.length} that fail ${map.criterion}.`
    : `${failing.length} of ${sweep.members} fail ${map.criterion}.`;
  part.verdict.textContent = verdictWords(map, member, run);
  drawRun(map, part.height, "height of the centre [m]", run.time, run.height, exact && exact.drawn(sweep.scene.duration / 600), "height", exact);
  drawRun(map, part.energy, "mechanical energy [J]", run.time, run.energy, exact && exact.energy, "energy", exact);
  fillOutcomes(map, member, run);
  part.caveat.textContent = caveatOf(map, member, run, exact);
}

function verdictWords(map, member, run) {
  const { sweep, cell } = map, failed = sweep.names.filter((name) => run.passes[name] === false);
  const sentences = run.ended.map((name) => map.data.sentences[map.data.verdicts.indexOf(name)]);
  const ended = sentences.length > 0 ? ` It did not end well: ${sentences.join("; ")}.` : "";
  const early = run.stepsDone < sweep.steps[cell] ? ` It was judged until step ${wholeNumber(run.stepsDone)}, when all was decided, as the stored one.` : "";
  const outcome = failed.length === 0 ? "it passes" : `it fails ${failed.join(", ")}`;
  return `Member ${member}, ${wholeNumber(sweep.steps[cell])} steps run here in ${Math.round(run.milliseconds)} ms: ${outcome}.${ended}${early}`;
}

function fillOutcomes(map, member, run) {
  const { sweep, cell } = map, word = (passes) => (passes === null ? "too close to tell" : passes ? "passes" : "fails");
  const rows = sweep.criteria.map(({ name, limit }) => [
    name, readableNumber(run.measures[name]), `≤ ${limit}`, word(run.passes[name]), word(sweep.passes(name, cell, member)),
  ]);
  const heads = ["criterion", "measure", "allowed", "this run", "stored run"];
  fillRows(map.part.outcomes, [`Member ${member} by every criterion`, heads, rows]);
}

function caveatOf(map, member, run, exact) {
  const { sweep, data, cell } = map;
  const told = [sweep.turns
    ? "A tumbling cube: this run is the stored one until chaos takes over. A last digit that differs (sine and cosine are the browser's) grows, and late bounces may be others."
    : "This run takes every step, as the listings do, to the last bit. The stored one took known motion, such as flights, at once, which agrees to round-off."];
  if (sweep.names.some((name) => run.passes[name] !== null && run.passes[name] !== sweep.passes(name, cell, member))) {
    told.push("Here the two part: a last digit has moved the phase of a later touch-down, and with it the verdict.");
  }
  if (exact === null) {
    const last = sweep.column(cell).paths.length - 1;
    told.push(`No exact path of member ${member} is published, as it is turned in its own way; members 0 to ${last} have one.`);
  } else {
    told.push(`The exact path is by the scheme event, stored as float32 and thinned: places within ${readableNumber(data.drawn.place)} radii, energies within ${100 * data.drawn.energy} % of their range.`);
    if (exact.until < sweep.scene.duration) told.push(`It ends at ${readableNumber(exact.until, 3)} s (dotted): beyond, two tolerances part, and it is not known.`);
  }
  return told.join(" ");
}

/** Return the least and the largest of numbers that are finite. */
function rangeOf(values) {
  let low = Infinity, high = -Infinity;
  for (const value of values) {
    if (!Number.isFinite(value)) continue;
    low = Math.min(low, value);
    high = Math.max(high, value);
  }
  return [low, high];
}

function drawRun(map, element, title, time, values, known, key, exact) {
  const { sweep } = map, traces = [
    { type: "scatter", mode: "lines", name: "this run", x: time, y: values, line: { color: themed("--accent"), width: 2 } },
  ];
  if (known !== null) {
    const look = { color: themed("--ink"), width: 1.3, dash: "dash" };
    traces.push({ type: "scatter", mode: "lines", name: "exact", x: known.time, y: known[key], line: look });
  }
  const [low, high] = rangeOf(known === null ? values : known[key]), [least, most] = rangeOf(values);
  const size = high - low || 1, top = Math.min(Math.max(most, high), high + 2 * size);
  const bottom = Math.max(Math.min(least, low), low - size);
  const beyond = most > top ? [`↑ this run goes up to ${readableNumber(most, 3)}`] : [];
  if (least < bottom) beyond.push(`↓ down to ${readableNumber(least, 3)}`);
  const until = exact !== null && exact.until < sweep.scene.duration ? [exact.until] : [];
  Plotly.react(element, traces, {
    height: 260,
    margin: { l: 64, r: 12, t: 28, b: 40 },
    ...plotLook(),
    dragmode: isNarrow() ? false : "zoom",
    showlegend: true,
    legend: { orientation: "h", y: 1.14, x: 1, xanchor: "right" },
    xaxis: { gridcolor: themed("--grid"), title: { text: "time [s]", standoff: 4 }, range: [0, sweep.scene.duration], zeroline: false },
    yaxis: { gridcolor: themed("--grid"), title: { text: title }, range: [bottom - 0.06 * (top - bottom), top + 0.04 * (top - bottom)], zeroline: false },
    annotations: beyond.map((text, k) => ({
      text, xref: "paper", yref: "paper", x: 0, y: 1 - 0.1 * k, xanchor: "left", yanchor: k === 0 ? "bottom" : "top",
      showarrow: false, font: { size: 12, color: themed("--accent") },
    })),
    shapes: until.map((x) => ({ type: "line", x0: x, x1: x, yref: "paper", y0: 0, y1: 1, line: { color: themed("--faint"), dash: "dot" } })),
  }, { responsive: true, displayModeBar: false });
}
