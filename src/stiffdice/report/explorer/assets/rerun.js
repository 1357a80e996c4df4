// A member of a cell run again, step by step by kernel.js, watched by judge.js, and kept for drawing.

const DRAWN = 3000; // about so many states are kept

/**
 * Return { time [s], height [m], energy [J], passes, measures, ended, stepsDone, milliseconds } of a member.
 *
 * exact: an ExactPath, or null. passes: by criterion, null where the path that `trajectory` compares with is not known,
 * or too coarsely to tell. The run is drawn to its end; it is judged until it ends early, as the stored one.
 */
function rerun(data, sweep, cell, member, exact) {
  const began = performance.now(), { late, scene } = sweep.member(cell, member), steps = sweep.steps[cell];
  const state = launchOf(scene), h = scene.duration / steps, stride = Math.max(1, Math.floor(steps / DRAWN));
  const known = exact && exact.reference ? new Reference(exact.reference) : null;
  const how = {
    criteria: sweep.criteria, early: sweep.early_stop, fewest: sweep.column(cell).fewest, reference: known, late,
    horizon: sweep.horizon ?? Infinity,
  };
  const judge = new Judge(scene, state, steps, how), run = { time: [], height: [], energy: [] };
  const keep = (step) => {
    run.time.push(late + step * h);
    run.height.push(heightOf(scene, state));
    run.energy.push(mechanicalEnergy(judge.watch, scene, state));
  };
  keep(0);
  let found = null, inRange = true;
  for (let step = 1; step <= steps && inRange; step += 1) {
    advance(scene, state, h);
    if (found === null && !judge.observe(state)) found = judge.finish(state);
    inRange = !judge.watch.outOfRange && heightOf(scene, state) < Infinity;
    if (inRange && step % stride === 0) keep(step);
  }
  found ??= judge.finish(state);
  if ("trajectory" in found.passes) {
    const { limit } = sweep.criteria.find(({ name }) => name === "trajectory");
    const close = Math.abs(found.measures.trajectory - limit) <= 4 * data.drawn.place;
    if (known === null || (close && found.ended.length === 0)) found.passes.trajectory = null;
  }
  return { ...run, ...found, stepsDone: judge.step, milliseconds: performance.now() - began };
}
