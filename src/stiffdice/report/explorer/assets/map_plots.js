// What the stability map draws and says: axes, edges, the numbers of a cell, a member's run beside the exact one.

const RUN_COLOR = "#0072B2";
const PLOT_FONT = { family: "inherit", size: 13 };

function isNarrow() {
  return window.innerWidth < 600;
}

function logAxis(title) {
  return { type: "log", title: { text: title }, showgrid: false, ticks: "outside", zeroline: false };
}

function mapLayout(map, columns) {
  const { axis, data, sweep } = map, centres = columns.map(({ stiffness }) => stiffness);
  const magic = axis === "omega_h" ? MAGIC.map((n) => [n, 2 * Math.sin(Math.PI / (2 * n))]) : [];
  const sides = bordersOf(centres), places = map.cells.flat().map((cell) => map.place(cell));
  const log = (values) => values.map(Math.log10);
  return {
    height: isNarrow() ? 420 : 520,
    margin: { l: 64, r: 44, t: 12, b: 96 },
    font: PLOT_FONT,
    hovermode: "closest",
    dragmode: isNarrow() ? false : "zoom",
    uirevision: `${sweep.name} ${axis}`,
    paper_bgcolor: "white",
    plot_bgcolor: "white",
    showlegend: false,
    xaxis: { ...logAxis("stiffness S [kg/s²]"), range: log([sides[0], sides[sides.length - 1]]), exponentformat: "power", dtick: 1 },
    yaxis: {
      ...logAxis(axis === "steps" ? `time steps in ${sweep.scene.duration} s [1]` : "ωh of a flat landing [1]"),
      range: log([Math.min(...places), Math.max(...places)]),
      ...(axis === "steps" ? { exponentformat: "power", dtick: 1 } : { dtick: "D2" }),
    },
    coloraxis: {
      cmin: 0,
      cmax: 1,
      colorscale: "Cividis",
      colorbar: {
        orientation: "h", y: -0.36, len: 0.9, thickness: 12, tickformat: ".0%",
        title: { text: "share of members that pass", side: "bottom" },
      },
    },
    annotations: magic.map(([n, omegaH]) => ({
      xref: "paper", x: 1, xanchor: "left", y: Math.log10(omegaH), text: `– n=${n}`, showarrow: false,
      font: { size: 11, color: data.looks.ink },
    })),
  };
}

function edgeTraces(map, columns) {
  const { axis, criterion, data } = map, { color } = map.about(criterion);
  const at = (column, steps) => (steps === null || axis === "steps" ? steps : column.radians / steps);
  const x = columns.map(({ stiffness }) => stiffness), look = { hoverinfo: "skip", x };
  const limit = columns.map((column) => at(column, column.limit));
  const marks = (edge, marker) => ({
    ...look, type: "scatter", mode: "markers", y: columns.map((column) => at(column, column[edge][criterion])), marker,
  });
  return [
    { ...look, type: "scatter", mode: "lines", y: limit, line: { color: "white", width: 3.5 } },
    { ...look, type: "scatter", mode: "lines", y: limit, line: { color: data.looks.theory, width: 1.5, dash: "dash" } },
    marks("last_fail", { size: 8, color, line: { color: "white", width: 1.5 }, symbol: "triangle-up" }),
    marks("first_pass", { size: 9, color: "white", line: { color, width: 2.5 }, symbol: "circle" }),
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

function fillTable(details, [caption, heads, rows]) {
  const table = document.createElement("table");
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
  details.querySelector("div").replaceChildren(table);
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
  part.verdict.textContent = verdictOf(map, member, run);
  drawRun(map, part.height, "height of the centre [m]", run.time, run.height, exact && exact.drawn(), "height", exact);
  drawRun(map, part.energy, "mechanical energy [J]", run.time, run.energy, exact && exact.energy, "energy", exact);
  part.caveat.textContent = caveatOf(map, member, exact);
}

function verdictOf(map, member, run) {
  const { sweep, cell } = map, words = sweep.criteria.map(({ name, limit }) => {
    const stored = sweep.passes(name, cell, member), now = run.passes[name];
    const held = now === null ? "too close to tell from the thinned path" : now ? "passes" : "fails";
    const other = now !== null && now !== stored ? ` (stored: ${stored ? "passes" : "fails"})` : "";
    return `${name} ${held}${other}, ${readableNumber(run.measures[name])} of at most ${limit}`;
  });
  const ended = run.ended.length > 0 ? ` It did not end well: ${run.ended.join(", ").replaceAll("_", " ")}.` : "";
  const until = run.stepsDone < sweep.steps[cell] ? `, stopped after ${wholeNumber(run.stepsDone)} steps` : "";
  return `Member ${member}, run here in ${Math.round(run.milliseconds)} ms${until}: ${words.join("; ")}.${ended}`;
}

function caveatOf(map, member, exact) {
  const { sweep, data, cell } = map, { place, energy } = data.drawn;
  const same = sweep.turns
    ? "This run is the stored one until chaos takes over: a last digit that differs grows, and late bounces may be others."
    : "This run takes the stored one's steps one by one; the stored one took known motion at once, equal to round-off.";
  if (exact === null) {
    const known = sweep.column(cell).paths.length;
    return `${same} No exact path of member ${member} is published: its launch is turned another way; members 0 to ${known - 1} have one.`;
  }
  const drawn = `The exact one is by the scheme event; it is stored as float32, thinned to within ${readableNumber(place)} radii and ${percent(energy * 10) === "1 %" ? "0.1 %" : percent(energy)} of the energy's range`;
  const known = exact.until < sweep.scene.duration ? `, and ends at ${readableNumber(exact.until, 3)} s: beyond, it is chaos, and not known` : "";
  return `${same} ${drawn}${known}.`;
}

function drawRun(map, element, title, time, values, known, key, exact) {
  const { sweep, data } = map, traces = [
    { type: "scatter", mode: "lines", name: "this run", x: time, y: values, line: { color: RUN_COLOR, width: 2 } },
  ];
  if (known !== null) {
    const look = { color: data.looks.ink, width: 1.3, dash: "dash" };
    traces.push({ type: "scatter", mode: "lines", name: "exact", x: known.time, y: known[key], line: look });
  }
  const shown = known === null ? values : known[key];
  let low = Infinity, high = -Infinity;
  for (const value of shown) {
    low = Math.min(low, value);
    high = Math.max(high, value);
  }
  const room = (high - low || 1) * 0.08, top = high + (high - low) * 0.6;
  let most = -Infinity;
  for (const value of values) most = Math.max(most, value);
  const until = exact !== null && exact.until < sweep.scene.duration ? [exact.until] : [];
  Plotly.react(element, traces, {
    height: 260,
    margin: { l: 64, r: 12, t: 28, b: 40 },
    font: PLOT_FONT,
    dragmode: isNarrow() ? false : "zoom",
    showlegend: true,
    legend: { orientation: "h", y: 1.14, x: 1, xanchor: "right" },
    paper_bgcolor: "white",
    plot_bgcolor: "white",
    xaxis: { title: { text: "time [s]", standoff: 4 }, range: [0, sweep.scene.duration], zeroline: false },
    yaxis: { title: { text: title }, range: [low - room, Math.min(Math.max(most, high) + room, top)], zeroline: false },
    shapes: until.map((x) => ({ type: "line", x0: x, x1: x, yref: "paper", y0: 0, y1: 1, line: { color: data.looks.quiet, dash: "dot" } })),
  }, { responsive: true, displayModeBar: false });
}
