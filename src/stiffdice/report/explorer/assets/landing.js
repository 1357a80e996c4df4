// Which face of a thrown die is up, decided by energy as in stiffdice/simulation/landing.py.
//
// A die, as page.py writes it: { scene, steps, height: [m] of the centre over each face, barrier: [J] around it, normals:
// of the faces 1 to 6 of the upright die, velocity_spread [m/s], spin_spread [rad/s] }.

// Steps between two looks at a throw's energy, and looks of a whole run at least.
const LOOK = 64, LOOKS = 256;
// A throw whose energy is so many times that of its launch has blown up.
const BLOWN = 10;
// A body that is not decided at the end, but moves with less than this part of what it lacks to tip, leans on an edge.
const STILL = 1e-3;

// Signs of the eight nodes along the edges of the upright cube, in the order of cube.m.
const SIGNS = [1, 1, 1, 1, -1, 1, -1, -1, 1, -1, 1, 1, 1, 1, -1, 1, -1, -1, -1, -1, -1, -1, 1, -1];

/** Return half an edge of the cube with these nodes, from 24 numbers that begin at `first`: three numbers [m]. */
function halfEdge(nodes, edge, first = 0) {
  const total = [0, 0, 0];
  for (let k = 0; k < 3 * NODES; k += 3) {
    for (let axis = 0; axis < 3; axis++) total[axis] += SIGNS[k + edge] * nodes[first + k + axis];
  }
  return total.map((part) => part / 8);
}

/** Return the index of the face below. */
function faceBelow(die, nodes) {
  const half = die.scene.side / 2, up = [0, 1, 2].map((edge) => halfEdge(nodes, edge)[2]);
  let best = -Infinity, found = 0;
  die.normals.forEach((normal, face) => {
    let down = 0;
    for (let axis = 0; axis < 3; axis++) down -= (normal[axis] * up[axis]) / half;
    if (down / die.height[face] > best) [best, found] = [down / die.height[face], face];
  });
  return found;
}

/** Return kinetic + m g z + the springs' energy [J], the velocity taken at the place, `lag` [s] later. */
function landingEnergy(die, state, lag) {
  const { scene } = die, moving = kineticAtPlace(scene, state, lag);
  return { moving, total: moving + (potentialEnergy(scene, state) + elasticEnergy(scene, state)) };
}

/**
 * Look at a throw: { face: 1 to 6, the one up or nearest to up; rest: settled, cocked, unsettled or blew_up; margin: how
 * far the energy is below the barrier, of the barrier over the face's rest }. start [J]: the energy of the launch.
 */
function decideFace(die, state, lag, start) {
  const { scene } = die, { moving, total } = landingEnergy(die, state, lag), below = faceBelow(die, state.nodes);
  const gap = die.barrier[below] - scene.mass * scene.gravity * die.height[below];
  const face = die.height.length - below, margin = (die.barrier[below] - total) / gap;
  if (gap > 0 && total < die.barrier[below]) return { face, rest: "settled", margin };
  if (!(total < start + (BLOWN - 1) * Math.abs(start))) return { face, rest: "blew_up", margin };
  const touches = heightOf(scene, state) <= lowestOf(scene, state);
  const rest = touches && moving < STILL * Math.abs(gap) ? "cocked" : "unsettled";
  return { face, rest, margin };
}

/**
 * Throw a die from a launch until its face is decided: { face, rest, margin, steps, time [s] }.
 *
 * launch: { position, velocity, angular_momentum, angular_velocity, node_offset }.
 */
function landDie(die, launch) {
  const scene = { ...die.scene, ...launch }, thrown = { ...die, scene };
  const h = scene.duration / die.steps, lag = 0.5 * h, state = launchOf(scene);
  const every = Math.max(1, Math.min(LOOK, Math.floor(die.steps / LOOKS)));
  const start = landingEnergy(thrown, state, lag).total;
  let steps = 0;
  for (;;) {
    const decided = decideFace(thrown, state, lag, start);
    const over = steps >= die.steps || decided.rest === "settled" || decided.rest === "blew_up";
    if (over) return { ...decided, steps, time: steps * h };
    for (let k = 0; k < every; k++) advance(scene, state, h);
    steps += every;
  }
}

/** Return a function that returns uniform numbers in [0, 1), the same for the same seed (mulberry32). */
function randomNumbers(seed) {
  let word = seed >>> 0;
  return () => {
    word = (word + 0x6d2b79f5) >>> 0;
    let mixed = Math.imul(word ^ (word >>> 15), word | 1);
    mixed ^= mixed + Math.imul(mixed ^ (mixed >>> 7), mixed | 61);
    return ((mixed ^ (mixed >>> 14)) >>> 0) / 4294967296;
  };
}

/** Return a number of the standard normal distribution (Box and Muller). */
function gaussian(random) {
  return Math.sqrt(-2 * Math.log(1 - random())) * Math.cos(2 * Math.PI * random());
}

/** Return the launch of a throw: any orientation as likely, velocity and spin Gaussian about the scene's. */
function randomLaunch(die, random) {
  const { scene } = die, quaternion = [0, 1, 2, 3].map(() => gaussian(random)), size = Math.hypot(...quaternion);
  const turn = rotationMatrix(quaternion.map((part) => part / size)), nodes = [];
  for (let k = 0; k < 3 * NODES; k += 3) {
    for (const row of turn) {
      nodes.push(row.reduce((sum, part, axis) => sum + (part * SIGNS[k + axis] * scene.side) / 2, 0));
    }
  }
  const spin = [0, 1, 2].map(() => die.spin_spread * gaussian(random));
  return {
    position: scene.position,
    velocity: scene.velocity.map((part) => part + die.velocity_spread * gaussian(random)),
    angular_momentum: spin.map((part) => part * scene.inertia),
    angular_velocity: spin,
    node_offset: nodes,
  };
}

/** Return the rows of the rotation matrix of a unit quaternion (w, x, y, z). */
function rotationMatrix([w, x, y, z]) {
  return [
    [1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
    [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
    [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)],
  ];
}

/** Return chi-square of counts of six faces against a fair die. */
function chiSquare(counts) {
  const expected = counts.reduce((sum, count) => sum + count, 0) / counts.length;
  return counts.reduce((sum, count) => sum + (count - expected) ** 2 / expected, 0);
}

/** Return the share of fair dice with at least such a chi-square, 5 degrees of freedom (Simpson's rule in its root). */
function chiSquareTail(value) {
  const end = Math.sqrt(value), parts = 400, width = end / parts;
  const density = (u) => (2 * u ** 4 * Math.exp((-u * u) / 2)) / (3 * Math.sqrt(2 * Math.PI));
  let sum = density(0) + density(end);
  for (let k = 1; k < parts; k++) sum += (k % 2 ? 4 : 2) * density(k * width);
  return Math.max(0, 1 - (sum * width) / 3);
}
