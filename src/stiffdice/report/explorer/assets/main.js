// Put the parts of the page together.

let plotlyPromise = null;

/** Return a promise of plotly, which the first call unpacks from the page itself. */
function loadPlotly() {
  plotlyPromise ??= unpackPlotly();
  return plotlyPromise;
}

async function unpackPlotly() {
  const packed = Uint8Array.from(atob(document.getElementById("plotly").textContent.trim()), (c) => c.charCodeAt(0));
  const stream = new Blob([packed]).stream().pipeThrough(new DecompressionStream("gzip"));
  const script = document.createElement("script");
  script.textContent = await new Response(stream).text();
  document.head.append(script);
  return window.Plotly;
}

/** Return the data that the page was made with. */
function pageData() {
  return JSON.parse(document.getElementById("data").textContent);
}

document.addEventListener("DOMContentLoaded", () => {
  const data = pageData();
  document.getElementById("version").textContent = data.version;
  mountMap(document.getElementById("map"), data.map);
  mountThrow(document.getElementById("throw"), data.throw);
  mountDie(document.getElementById("die"), data.die);
});
