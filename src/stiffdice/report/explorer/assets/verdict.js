// How a run ended, as stiffdice/simulation/{monitor,outcome}.py and criteria/{finite,energy,apex,judge}.py say it, at
// their default tolerances. What is seen of a run while it goes on is a `watch`.

const ENERGY_TOLERANCE = 0.05, APEX_TOLERANCE = 0.02, BLOW_UP = 1e3;
const LAG = 0.5; // steps by which symplectic Euler's velocity is behind its place

// From mild to grave; a run has the gravest that applies.
const VERDICTS = {
  passed: "passed: every criterion that was looked at holds; accuracy is another question",
  unresolved: "unresolved: steps beyond the linear limit of a force it met, or of more than half a turn",
  apex_rose: "apex rose: a rebound went higher than the one before",
  energy_grew: "energy grew: the cube had more energy in the air than at the launch",
  sank: "sank or tunnelled: the whole cube was below the ground at the end, deeper than a bounce",
  stalled: "stalled: the steps are too short for double precision to move the cube",
  blew_up: "blew up: the airborne energy passed 1000 times the start's",
  left_numeric_range: "left the numeric range: a number grew past what double precision holds",
};

/** Begin to watch a run that stands at its launch. */
function startWatch(scene, state, steps) {
  const h = scene.duration / steps, pull = scene.gravity * scene.nz;
  let sag = 0;
  if (pull > 0) {
    const hardly = scene.mass * pull < 4 * scene.stiffness * scene.side;
    sag = hardly ? (scene.mass * pull) / 4 / scene.stiffness : scene.side;
  }
  const height = heightOf(scene, state), speed = speedOf(scene, state), clearance = height - lowestOf(scene, state);
  const watch = {
    h, steps, pull, sag, height, speed, clearance,
    speedBefore: speed + h * pull,
    flight: clearance > 0 ? 2 : 0,
    touched: clearance <= 0,
    grounded: clearance <= 0, // as long as it was never in the air
    outOfRange: false,
    bounces: 0,
    launch: { position: [...state.position], velocity: [...state.velocity], momentum: [...state.momentum] },
  };
  startEnergy(watch, scene, state);
  const slope = speed - LAG * h * pull;
  watch.apexRatio = 0;
  watch.hop = (slope * slope) / 2 + pull * clearance + elasticEnergy(scene, state) / scene.mass;
  return watch;
}

function startEnergy(watch, scene, state) {
  watch.startEnergy = watch.grounded ? mechanicalEnergy(watch, scene, state) : flyingEnergy(watch, scene, state);
  const weight = scene.mass * scene.gravity * Math.abs(scene.nz);
  const above = watch.height - scene.side / 2, high = weight * ((above > 0 ? above : 0) + watch.sag / 2);
  const scale = kineticEnergy(scene, state) + elasticEnergy(scene, state) + high;
  watch.energyScale = scale <= 0 ? 1 : scale;
  watch.energyRatio = Number.isFinite(watch.startEnergy) && Number.isFinite(watch.energyScale) ? 1 : NaN;
}

/** Look at the state after a step. */
function observeStep(watch, scene, state) {
  const height = heightOf(scene, state), speed = speedOf(scene, state);
  const clearance = clearanceOf(watch, scene, state, height, speed), before = watch.speed;
  let lifted = false, speedOut = 0;
  if (clearance > 0) {
    watch.flight += 1;
    lifted = watch.flight === 2;
    if (lifted) {
      watch.bounces += 1;
      speedOut = speedAtTheGround(watch, speed, before, clearance);
    }
  } else {
    watch.flight = 0;
    watch.touched = true;
  }
  watch.height = height;
  watch.clearance = clearance;
  watch.speedBefore = before;
  watch.speed = speed;
  watch.outOfRange = !(magnitudeOf(state) < Infinity);
  observeEnergy(watch, scene, state);
  if (lifted) observeApex(watch, scene, speedOut);
}

/** Return the lowest node's height above the ground [m]; a lower bound where it is far from touching. */
function clearanceOf(watch, scene, state, height, speed) {
  const far = height - scene.reach;
  if (far > 0 && far > 2 * watch.h * (Math.abs(speed) + watch.h * scene.gravity)) return far;
  return height - lowestOf(scene, state);
}

/** Return the speed [m/s] at zero clearance on the parabola through a step in the air and the one before. */
function speedAtTheGround(watch, speed, before, clearance) {
  const slope = speed + LAG * (speed - before);
  const square = slope * slope - (2 * clearance * (speed - before)) / watch.h;
  return Math.sqrt(square > 0 ? square : 0);
}

function magnitudeOf(state) {
  let total = 0;
  for (let axis = 0; axis < 3; axis++) {
    total += Math.abs(state.position[axis]) + Math.abs(state.velocity[axis]) + Math.abs(state.momentum[axis]);
    total += Math.abs(state.nodes[axis]);
  }
  return total;
}

function observeEnergy(watch, scene, state) {
  if (watch.flight > 0) {
    watch.grounded = false;
    countEnergy(watch, flyingEnergy(watch, scene, state));
  } else if (watch.grounded) {
    countEnergy(watch, mechanicalEnergy(watch, scene, state));
    countEnergy(watch, energyWithoutSprings(scene, state));
  }
}

function countEnergy(watch, now) {
  const ratio = 1 + (now - watch.startEnergy) / watch.energyScale;
  if (ratio > watch.energyRatio) watch.energyRatio = ratio;
}

function observeApex(watch, scene, speedOut) {
  const now = (speedOut * speedOut) / 2, settled = 10 * watch.pull * watch.sag;
  const before = Math.max(watch.hop, settled, watch.pull * scene.hop_height);
  if (before > 0 && now / before > watch.apexRatio) watch.apexRatio = now / before;
  watch.hop = now;
}

/** Return kinetic energy + m g z [J], the velocity taken at the place. */
function flyingEnergy(watch, scene, state) {
  const behind = LAG * watch.h * scene.gravity;
  const moving = scene.mass * behind * (behind / 2 - state.velocity[2]);
  return kineticEnergy(scene, state) + moving + potentialEnergy(scene, state);
}

/** Return kinetic energy + m g z + the springs' [J], the velocity taken at the place. */
function mechanicalEnergy(watch, scene, state) {
  const moving = kineticAtPlace(scene, state, LAG * watch.h);
  return moving + (potentialEnergy(scene, state) + elasticEnergy(scene, state));
}

/** Return the energy of the motion along the ground and of the spin, and m g z [J]. */
function energyWithoutSprings(scene, state) {
  const along = kineticEnergy(scene, state) - 0.5 * scene.mass * speedOf(scene, state) ** 2;
  return along + potentialEnergy(scene, state);
}

/** Return { name, sentence, energyRatio, apexRatio, bounces } of a run that is over; apexRatio is null if it turns. */
function verdictOf(watch, scene, state) {
  if (watch.clearance <= 0) countEnergy(watch, energyWithoutSprings(scene, state));
  const turning = scene.model === "tumbling", ratio = watch.energyRatio;
  const applies = {
    passed: true,
    unresolved: watch.steps < fewestSteps(watch, scene, state),
    apex_rose: !turning && !(watch.apexRatio <= 1 + APEX_TOLERANCE),
    energy_grew: !(ratio <= 1 + ENERGY_TOLERANCE),
    sank: hasSunk(watch, scene, state),
    stalled: hasStalled(watch),
    blew_up: ratio > BLOW_UP,
    left_numeric_range: watch.outOfRange || Number.isNaN(ratio),
  };
  const name = Object.keys(VERDICTS).filter((verdict) => applies[verdict]).pop();
  const apexRatio = turning ? null : watch.apexRatio;
  return { name, sentence: VERDICTS[name], energyRatio: ratio, apexRatio, bounces: watch.bounces };
}

/** Return the fewest steps [1] within the linear limits of the contacts met and within half a turn a step. */
function fewestSteps(watch, scene, state) {
  const lever = ((scene.side * scene.side) / 4) * (scene.mass / scene.inertia), turning = scene.model === "tumbling";
  const omega = contactFrequency(scene, turning ? Math.max(4, 4 * lever) : 4);
  let fewest = 0;
  if (watch.touched && omega > 0) {
    const zeta = ((scene.damping / scene.stiffness) * omega) / 2;
    fewest = (omega * scene.duration) / (2 / (Math.hypot(1, zeta) + zeta));
  }
  if (!scene.gated) {
    const nodes = turning ? Math.max(8, 8 * lever) : 8;
    fewest = Math.max(fewest, ((nodes * scene.damping) / scene.mass) * (scene.duration / 2));
  }
  if (turning) {
    for (const momentum of [watch.launch.momentum, state.momentum]) {
      const turns = (scene.duration * (Math.hypot(...momentum) / scene.inertia)) / Math.PI;
      if (turns > fewest) fewest = turns;
    }
  }
  return fewest;
}

/** Return ω = √(k S/m) [rad/s] of a contact on k nodes. */
function contactFrequency(scene, nodes = 4) {
  return (Math.sqrt(nodes) * Math.sqrt(scene.stiffness)) / Math.sqrt(scene.mass);
}

/** Return whether every node ended below the ground, and not just in the middle of a bounce. */
function hasSunk(watch, scene, state) {
  let highest = -Infinity, lowest = Infinity;
  for (let k = 0; k < 3 * NODES; k += 3) {
    const [x, y, z] = [0, 1, 2].map((axis) => state.position[axis] + state.nodes[k + axis]);
    const height = x * scene.nx + y * scene.ny + z * scene.nz;
    highest = Math.max(highest, height);
    lowest = Math.min(lowest, height);
  }
  const fall = Math.sqrt(watch.energyScale / (2 * scene.stiffness));
  const bounces = watch.sag < scene.side && -lowest <= 2 * watch.sag + fall;
  return highest < 0 && !bounces;
}

/** Return whether a step at the speed of the launch is lost in round-off of the place. */
function hasStalled({ h, launch }) {
  return launch.velocity.some((speed, axis) => speed !== 0 && launch.position[axis] + h * speed === launch.position[axis]);
}
