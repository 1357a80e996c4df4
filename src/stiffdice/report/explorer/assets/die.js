// The face of a die: a throw to look at, and counts of many.

// Throws between two looks at the screen, and how long a replay goes on after the face is decided [s].
const BATCH = 10, AFTER = 0.3;
// 95 % of a normal distribution lie within so many standard deviations.
const NORMAL_95 = 1.96;

/** Return the run of a throw up to a little after it was decided, for a replay. */
function pathOf(die, launch, landed) {
  const scene = { ...die.scene, ...launch }, h = scene.duration / die.steps;
  const steps = Math.min(die.steps, landed.steps + Math.ceil(AFTER / h));
  return simulate({ ...scene, duration: steps * h }, steps, Math.max(1, Math.ceil(steps / 1000)));
}

/** Return the counts between which 95 % of the counts of a face of a fair die lie. */
function fairBand(throws) {
  const spread = NORMAL_95 * Math.sqrt((throws * 5) / 36);
  return [Math.max(0, throws / 6 - spread), throws / 6 + spread];
}

/** Return what counts say: a sentence. */
function toldOfCounts(counts, others) {
  const total = counts.reduce((sum, count) => sum + count, 0), value = chiSquare(counts);
  const odd = others > 0 ? ` ${others} more did not settle and are not counted.` : "";
  const tail = `${Number((100 * chiSquareTail(value)).toPrecision(2))} %`;
  return `${readable(total)} throws: chi-square ${value.toFixed(1)} with 5 degrees of freedom; ${tail} of fair dice have as much.${odd}`;
}

/** Return what is said of a throw. */
function toldOfThrow({ face, rest, time }) {
  if (rest === "settled") return `${face} is up. It was decided after ${time.toFixed(2)} s: the die has not the energy to tip over any more.`;
  return `${face} is nearest to up, but the throw did not settle (${rest.replace("_", " ")}).`;
}

/** Show the die in an element; die: as page.py writes it. */
function mountDie(element, die) {
  let random = null, counts = null, others = 0, busy = false;
  const parts = replayParts("die", "The die as it flies and comes to rest"), replay = mountReplay(parts);
  const verdict = html("p", { id: "die-verdict", class: "verdict", role: "status", "aria-live": "polite" }, "Not thrown yet.");
  const summary = html("p", { id: "die-summary", role: "status", "aria-live": "polite" });
  const bars = html("div", { class: "chart", id: "die-bars" }), table = html("div", { id: "die-table" });
  const seed = html("input", { type: "number", id: "seed", min: 0, max: 4294967295, step: 1, value: 1 });
  const still = matchMedia("(prefers-reduced-motion: reduce)");

  function reset() {
    random = randomNumbers(Number(seed.value));
    counts = [0, 0, 0, 0, 0, 0];
    others = 0;
    summary.textContent = "Nothing counted yet.";
    showCounts();
  }

  function throwOne() {
    const launch = randomLaunch(die, random), landed = landDie(die, launch);
    if (landed.rest === "settled") counts[landed.face - 1] += 1;
    else others += 1;
    return { launch, landed };
  }

  function showThrow({ launch, landed }) {
    verdict.textContent = toldOfThrow(landed);
    verdict.dataset.face = landed.face;
    replay.show(pathOf(die, launch, landed), !still.matches);
  }

  function showCounts() {
    const total = counts.reduce((sum, count) => sum + count, 0), [low, high] = fairBand(total);
    faceBars(bars, counts, low, high);
    const rows = counts.map((count, k) => [`${k + 1}`, `${count}`, total ? (count / total).toFixed(3) : "–"]);
    const band = total ? `; of a fair die 95 % of the counts lie from ${readable(Math.ceil(low))} to ${readable(Math.floor(high))}` : "";
    table.replaceChildren(tableOf(`Counts of the faces${band}`, ["face", "count", "share"], rows));
  }

  async function throwMany(count) {
    setBusy(true);
    let last = null;
    for (let done = 0; done < count; done += BATCH) {
      for (let k = 0; k < BATCH; k++) last = throwOne();
      showCounts();
      await new Promise((resolve) => setTimeout(resolve));
    }
    showThrow(last);
    summary.textContent = toldOfCounts(counts, others);
    setBusy(false);
  }

  function setBusy(yes) {
    busy = seed.disabled = yes;
    // Not `disabled`, which takes the keyboard's focus away.
    for (const made of buttons.children) made.setAttribute("aria-disabled", String(yes));
  }

  const button = (text, id, act) => {
    const made = html("button", { type: "button", id }, text);
    made.addEventListener("click", () => busy || act());
    return made;
  };
  const once = button("Throw", "die-throw", () => {
    showThrow(throwOne());
    summary.textContent = toldOfCounts(counts, others);
    showCounts();
  });
  const many = button("Throw 100", "die-many", () => throwMany(100)), again = button("Start again", "die-reset", reset);
  const buttons = html("div", { class: "buttons" }, once, many, again);
  seed.addEventListener("change", reset);
  const seeded = html("div", { class: "control seed" }, html("label", { for: "seed" }, "Seed of the throws"), seed);
  const title = caption("How often each face was up", "band: 95 % of a fair die's counts");
  const right = html("div", {}, title, bars, summary, details("Counts as a table", table));
  element.replaceChildren(buttons, seeded, verdict, html("div", { class: "views" }, parts.element, right));
  new ResizeObserver(showCounts).observe(bars);
  reset();
  parts.speed.value = "0.25";
  const launch = randomLaunch(die, randomNumbers(0));
  replay.show(pathOf(die, launch, landDie(die, launch)), false);
}
