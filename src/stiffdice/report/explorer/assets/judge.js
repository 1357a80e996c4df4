// What a sweep's criteria say of a run of the paper's scheme that is shown to it step by step: those of verdict.js at the
// sweep's own tolerances, `restitution` and `trajectory` (src/stiffdice/simulation/criteria), and when the run ends early.

// The path that `trajectory` compares with: a cubic between nodes {time, place, velocity}, times ascending.
class Reference {
  constructor({ time, place, velocity }) {
    Object.assign(this, { time, place, velocity, at: 0 });
  }

  // Return how far a place is from the path at a time not before the one asked last [m].
  distance(time, position) {
    while (this.at < this.time.length - 2 && this.time[this.at + 1] <= time) this.at += 1;
    const k = this.at, span = this.time[k + 1] - this.time[k], s = (time - this.time[k]) / span;
    let total = 0;
    for (let axis = 0; axis < 3; axis += 1) {
      const p = this.place[3 * k + axis], q = this.place[3 * k + 3 + axis];
      const u = this.velocity[3 * k + axis] * span, v = this.velocity[3 * k + 3 + axis] * span;
      const there = p + s * (u + s * (3 * (q - p) - 2 * u - v + s * (2 * (p - q) + u + v)));
      total += (position[axis] - there) ** 2;
    }
    return Math.sqrt(total);
  }
}

// dynamics/flat_bounce.py: the speed [m/s] at which a flat cube leaves the ground that it met at `speedIn`.
function reboundSpeed(physics, pull, speedIn) {
  if (pull < 0) return NaN;
  if (speedIn <= 0 || physics.stiffness <= 0) return 0;
  const omega = (2 * Math.sqrt(physics.stiffness)) / Math.sqrt(physics.mass);
  const zeta = physics.damping / Math.sqrt(physics.stiffness) / Math.sqrt(physics.mass);
  if (zeta === 0) return speedIn;
  if (zeta > 1e150) return 0;
  const ratio = pull / omega / speedIn;
  const [unit, start, weight] = ratio < 1 ? [speedIn, 1, ratio] : [pull / omega, 1 / ratio, 1];
  const zetaIn = physics.approach_damping * zeta, brake = zeta * weight;
  const decayIn = 2 * zetaIn * legDuration(zetaIn, weight, start);
  const swing = (down, speed) => {
    const decay = decayIn + 2 * zeta * legDuration(zeta, down, speed);
    return start * (start - 2 * zetaIn * weight) * Math.exp(-decay) + weight * weight * Math.expm1(-decay);
  };
  if (swing(1, 4 * zeta) <= 8 * brake * brake) return 0;
  let u = Infinity, lower = start;
  while (lower < u) {
    u = lower;
    lower = brake + Math.sqrt(brake * brake + swing(weight, u));
  }
  const square = lower * (lower - 4 * brake);
  return square <= 0 ? 0 : Math.min(unit * Math.sqrt(square), speedIn);
}

function legDuration(zeta, pull, speed) {
  if (zeta < 1) {
    const rate = Math.sqrt((1 - zeta) * (1 + zeta));
    return Math.atan2(rate * speed, zeta * speed - pull) / rate;
  }
  const rate = Math.sqrt(zeta - 1) * Math.sqrt(zeta + 1), slack = speed / (zeta + rate) - pull;
  if (slack <= 0) return Infinity;
  return rate === 0 ? speed / slack : Math.log1p((2 * rate * speed) / slack) / (2 * rate);
}

// criteria: [{name, limit}] of the sweep. early: whether a run ends once all of them are decided. fewest: steps within
// the linear limits, of a contact and of the drag. reference: a Reference, or null where it is not known. horizon [s]:
// until when `trajectory` compares. late [s]: of the launch.
class Judge {
  constructor(scene, state, steps, { criteria, early, fewest, reference, horizon, late }) {
    Object.assign(this, { scene, criteria, early, fewest, reference, horizon, late });
    this.watch = startWatch(scene, state, steps);
    this.room = roomOf(scene, state);
    this.speedIn = NaN;
    this.measures = { restitution: 0, trajectory: reference ? 0 : NaN };
    this.decided = new Set();
    this.step = 0;
  }

  /** Look at the state after a step; return whether the run goes on. */
  observe(state) {
    const { watch } = this, { flight, bounces, speed, speedBefore, clearance } = watch;
    observeStep(watch, this.scene, state);
    this.step += 1;
    if (watch.outOfRange) return false;
    if (watch.flight === 0 && flight > 1) this.speedIn = speedAtTheGround(watch, speed, speedBefore, clearance);
    if (watch.bounces > bounces) this.compareBounce();
    const ended = this.comparePath(this.late + this.step * watch.h, state);
    if (!this.early) return true;
    for (const { name, limit } of this.criteria) {
      if (this.measure(name) > limit || (name === "trajectory" && ended)) this.decided.add(name);
    }
    return this.decided.size < this.criteria.length;
  }

  measure(name) {
    const { watch } = this;
    const ours = { finite: watch.outOfRange ? 1 : 0, energy: watch.energyRatio, apex: watch.apexRatio };
    return name in ours ? ours[name] : this.measures[name];
  }

  /** criteria/restitution.py, of a flight that has just begun: not-a-number after a landing that is not flat. */
  compareBounce() {
    const { scene, watch, measures, speedIn } = this, blow = (speedIn * speedIn) / 2;
    if (!(blow > 0 && blow >= 10 * watch.pull * watch.sag && watch.pull >= 0 && scene.stiffness > 0)) return;
    const depth = 2 * watch.sag + speedIn * Math.sqrt(scene.mass / 4 / scene.stiffness);
    if (depth < this.room && !Number.isNaN(measures.restitution)) {
      const speedOut = speedAtTheGround(watch, watch.speed, watch.speedBefore, watch.clearance);
      const off = Math.abs(speedOut - reboundSpeed(scene, watch.pull, speedIn)) / speedIn;
      measures.restitution = Math.max(measures.restitution, off);
    } else measures.restitution = NaN;
  }

  /** criteria/trajectory.py; return whether the horizon is passed. */
  comparePath(time, state) {
    if (time > this.horizon) return true;
    if (!this.reference) return false;
    const off = this.reference.distance(time, state.position) / this.scene.radius;
    this.measures.trajectory = Math.max(this.measures.trajectory, off);
    return false;
  }

  /** Return the names of the verdicts that say how the run ended, whatever it was asked (criteria/judge.py). */
  endings(state) {
    const { scene, watch } = this, applies = [];
    if (watch.steps < Math.max(watch.touched ? this.fewest[0] : 0, this.fewest[1])) applies.push("unresolved");
    else if (scene.model === "tumbling" && watch.steps < fewestSteps(watch, scene, state)) applies.push("unresolved");
    if (hasSunk(watch, scene, state)) applies.push("sank");
    if (hasStalled(watch)) applies.push("stalled");
    if (watch.energyRatio > BLOW_UP) applies.push("blew_up");
    if (watch.outOfRange || Number.isNaN(watch.energyRatio)) applies.push("left_numeric_range");
    return applies;
  }

  /** Return {measures, passes: both by criterion, ended: names of verdicts} of a run that is over. */
  finish(state) {
    if (this.watch.clearance <= 0) countEnergy(this.watch, energyWithoutSprings(this.scene, state));
    const ended = this.endings(state), measures = {}, passes = {};
    for (const { name, limit } of this.criteria) {
      measures[name] = this.measure(name);
      passes[name] = ended.length === 0 && measures[name] <= limit;
    }
    return { measures, passes, ended };
  }
}

/** Return how much higher than the four lowest nodes the others are [m]; 0 if those are not at one height. */
function roomOf(scene, { nodes }) {
  const up = Array.from({ length: NODES }, (_, k) =>
    scene.nx * nodes[3 * k] + scene.ny * nodes[3 * k + 1] + scene.nz * nodes[3 * k + 2]);
  const lowest = Math.min(...up), others = up.filter((height) => height - lowest > 1e-9 * scene.reach);
  return others.length === 4 ? Math.min(...others) - lowest : 0;
}
