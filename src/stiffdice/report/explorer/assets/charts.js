// Small charts as SVG: lines over time with a cursor, and bars. Colours are in style.css.

const SVG = "http://www.w3.org/2000/svg";

/** Return an HTML element with attributes and children; a child is an element or text. */
function html(tag, attributes = {}, ...children) {
  const element = document.createElement(tag);
  for (const [name, value] of Object.entries(attributes)) element.setAttribute(name, value);
  element.append(...children);
  return element;
}

/** Return an SVG element with attributes and text. */
function svg(tag, attributes = {}, text = "") {
  const element = document.createElementNS(SVG, tag);
  for (const [name, value] of Object.entries(attributes)) element.setAttribute(name, value);
  if (text) element.textContent = text;
  return element;
}

/** Return a number as people read it: four digits, thousands apart, and powers of ten where it is large or small. */
function readable(value) {
  if (!Number.isFinite(value)) return "not a number";
  const size = Math.abs(value);
  if (value !== 0 && (size >= 1e7 || size < 1e-3)) {
    const [digits, power] = value.toExponential(2).split("e");
    const raised = String(Number(power)).replace(/./g, (c) => (c === "-" ? "⁻" : "⁰¹²³⁴⁵⁶⁷⁸⁹"[c]));
    return `${digits.replace("-", "−")} × 10${raised}`;
  }
  const digits = size >= 1000 ? 0 : Math.max(0, 3 - Math.floor(Math.log10(size || 1)));
  return (value + 0).toLocaleString("en-US", { maximumFractionDigits: digits }).replace("-", "−");
}

/** Return round numbers from low to high, about so many. */
function ticksOf(low, high, about) {
  const raw = (high - low) / about, power = 10 ** Math.floor(Math.log10(raw));
  const step = [1, 2, 2.5, 5, 10].map((part) => part * power).find((part) => part >= raw);
  const ticks = [];
  for (let k = Math.ceil(low / step - 1e-9); k * step <= high + 1e-9 * step; k++) ticks.push(k * step + 0);
  return ticks;
}

/**
 * Draw lines over time into an element, and again when its width changes. Returns { draw(content), cursor(t) }.
 *
 * content: { label: of the chart for those who do not see it; unit: of y; x: [s]; end: of the x axis; low, high: of the
 * y axis; lines: [{ name, style, y }]; marks: [{ name, y }], dashed lines across }.
 */
function lineChart(element) {
  let content = null, time = 0, cursorLine = null, place = null;
  const box = { left: 52, right: 8, top: 8, bottom: 34, height: 194 };

  function draw(given) {
    content = given ?? content;
    const width = element.clientWidth;
    if (!content || width === 0) return;
    const { low, high, end, unit } = content, inner = width - box.left - box.right;
    const tall = box.height - box.top - box.bottom;
    place = (t) => box.left + (t / end) * inner;
    const rise = (y) => box.top + (1 - (Math.min(Math.max(y, low), high) - low) / (high - low)) * tall;
    const root = svg("svg", { viewBox: `0 0 ${width} ${box.height}`, height: box.height, role: "img" });
    root.setAttribute("aria-label", content.label);
    for (const y of ticksOf(low, high, 4)) {
      root.append(svg("line", { class: "grid", x1: box.left, x2: width - box.right, y1: rise(y), y2: rise(y) }));
      root.append(svg("text", { class: "tick end", x: box.left - 6, y: rise(y) + 4 }, readable(y)));
    }
    for (const t of ticksOf(0, end, width > 400 ? 10 : 5)) {
      root.append(svg("text", { class: "tick middle", x: place(t), y: box.height - 18 }, readable(t)));
    }
    root.append(svg("text", { class: "tick end", x: width - box.right, y: box.height - 5 }, "time [s]"));
    root.append(svg("text", { class: "tick", x: 2, y: box.height - 5 }, unit));
    for (const { y } of content.marks) {
      root.append(svg("line", { class: "mark", x1: box.left, x2: width - box.right, y1: rise(y), y2: rise(y) }));
    }
    for (const { style, y } of content.lines) {
      const points = Array.from(y, (value, k) => `${place(content.x[k]).toFixed(1)},${rise(value).toFixed(1)}`);
      root.append(svg("polyline", { class: `line ${style}`, points: points.join(" ") }));
    }
    cursorLine = svg("line", { class: "cursor", y1: box.top, y2: box.height - box.bottom });
    root.append(cursorLine);
    element.replaceChildren(root);
    cursor(time);
  }

  function cursor(t) {
    time = t;
    if (!cursorLine) return;
    cursorLine.setAttribute("x1", place(t));
    cursorLine.setAttribute("x2", place(t));
  }

  new ResizeObserver(() => draw()).observe(element);
  return { draw, cursor };
}

/** Draw counts of the faces as bars, with the band in which 95 % of a fair die's counts lie, into an element. */
function faceBars(element, counts, low, high) {
  const width = element.clientWidth, height = 200, bottom = 24, left = 40;
  if (width === 0) return;
  const most = Math.max(...counts, high, 1) * 1.15, rise = (y) => 8 + (1 - y / most) * (height - bottom - 8);
  const root = svg("svg", { viewBox: `0 0 ${width} ${height}`, height, "aria-hidden": "true" });
  for (const y of ticksOf(0, most, 4).filter(Number.isInteger)) {
    root.append(svg("line", { class: "grid", x1: left, x2: width, y1: rise(y), y2: rise(y) }));
    root.append(svg("text", { class: "tick end", x: left - 6, y: rise(y) + 4 }, readable(y)));
  }
  if (high > 0) {
    root.append(svg("rect", { class: "band", x: left, width: width - left, y: rise(high), height: rise(low) - rise(high) }));
  }
  const slot = (width - left) / counts.length;
  counts.forEach((count, k) => {
    const x = left + (k + 0.5) * slot, top = rise(count);
    const bar = { class: "bar", x: x - slot * 0.3, width: slot * 0.6, y: top, height: height - bottom - top };
    root.append(svg("rect", bar));
    root.append(svg("text", { class: "tick middle", x, y: top - 4 }, String(count)));
    root.append(svg("text", { class: "tick middle face", x, y: height - 6 }, String(k + 1)));
  });
  element.replaceChildren(root);
}

/** Return a table with a caption; rows: of text, the first cell of each its heading. */
function tableOf(caption, heads, rows) {
  const head = html("tr", {}, ...heads.map((text) => html("th", { scope: "col" }, text)));
  const body = rows.map(([first, ...rest]) =>
    html("tr", {}, html("th", { scope: "row" }, first), ...rest.map((text) => html("td", {}, text))),
  );
  return html("table", {}, html("caption", {}, caption), html("thead", {}, head), html("tbody", {}, ...body));
}
