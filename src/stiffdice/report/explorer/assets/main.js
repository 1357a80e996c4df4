// Put the parts of the page together.

/** Return plotly, unpacked from the page itself on the first call. */
let plotlyPromise = null;
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
  mountMap(document.getElementById("map"), data.map);
});
