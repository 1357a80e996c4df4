// The paper's step in plain JavaScript: symplectic Euler in the listings' order, as in stiffdice/dynamics/models/
// {sliding,tumbling}.py and stiffdice/integrators/symplectic_euler.py. Every sum is taken in the order of that code:
// IEEE doubles then give the same bits. Sine and cosine are the browser's own.
//
// A scene is a plain object, as scene_data.plain() in Python writes it; SI units, the ground's constants per node:
//   model "sliding" or "tumbling"; mass, gravity, inertia, stiffness, damping, friction; gated (true or false);
//   nx, ny, nz (the ground's normal); cutoff [m/s], node_weight, weight [N], reach, radius, side [m], hop_height [m],
//   duration [s]; position, velocity, angular_momentum, angular_velocity: three numbers each, of the launch;
//   node_offset: 24 numbers, of eight nodes relative to the centre [m].

const NODES = 8;

/** Return the state at the launch of a scene, in arrays of its own. */
function launchOf(scene) {
  return {
    position: Float64Array.from(scene.position),
    velocity: Float64Array.from(scene.velocity),
    momentum: Float64Array.from(scene.angular_momentum),
    spin: Float64Array.from(scene.angular_velocity),
    nodes: Float64Array.from(scene.node_offset),
    wrench: new Float64Array(6), // force [N] and torque about the centre [N m] of the last evaluation
  };
}

/** Set state.wrench: equations 3 and 10 of the paper, node after node. */
function evaluateForce(scene, state) {
  const { mass, stiffness, damping, friction, gated, nx, ny, nz, cutoff, node_weight: nodeWeight } = scene;
  const turning = scene.model === "tumbling";
  const [px, py, pz] = state.position, [ux, uy, uz] = state.velocity, [wx, wy, wz] = state.spin;
  const nodes = state.nodes;
  let fx = 0, fy = 0, fz = 0, tx = 0, ty = 0, tz = 0;
  for (let k = 0; k < 3 * NODES; k += 3) {
    const x = nodes[k], y = nodes[k + 1], z = nodes[k + 2];
    const depth = -(nx * (px + x) + ny * (py + y) + nz * (pz + z));
    let vx = ux, vy = uy, vz = uz;
    if (turning) {
      vx = ux + (wy * z - wz * y);
      vy = uy + (wz * x - wx * z);
      vz = uz + (wx * y - wy * x);
    }
    const speed = nx * vx + ny * vy + nz * vz;
    const sx = vx + -speed * nx, sy = vy + -speed * ny, sz = vz + -speed * nz;
    const length = Math.sqrt(sx * sx + sy * sy + sz * sz) + cutoff;
    let push = 0;
    if (gated ? depth > 0 : depth > -Infinity) {
      push = stiffness * (depth > 0 ? depth : 0) - damping * speed;
      push = push > 0 ? push : 0;
    }
    const grip = -friction * push;
    const onX = push * nx + grip * (sx / length);
    const onY = push * ny + grip * (sy / length);
    const onZ = push * nz - nodeWeight + grip * (sz / length);
    fx += onX;
    fy += onY;
    fz += onZ;
    if (turning) {
      tx += y * onZ - z * onY;
      ty += z * onX - x * onZ;
      tz += x * onY - y * onX;
    }
  }
  const wrench = state.wrench;
  wrench[0] = fx;
  wrench[1] = fy;
  wrench[2] = fz;
  wrench[3] = tx;
  wrench[4] = ty;
  wrench[5] = tz;
}

/** Set the spin [rad/s] that the angular momentum gives a cube (paper, section 2.1). */
function updateSpin(scene, state) {
  for (let axis = 0; axis < 3; axis++) state.spin[axis] = state.momentum[axis] / scene.inertia;
}

/** Turn the nodes by the spin for h [s] (equation 9). */
function turnNodes(state, h) {
  const [wx, wy, wz] = state.spin, nodes = state.nodes;
  const rate = Math.sqrt(wx * wx + wy * wy + wz * wz);
  if (!(rate > 0)) return;
  const ax = wx / rate, ay = wy / rate, az = wz / rate, angle = rate * h;
  const c = Math.cos(angle), s = Math.sin(angle);
  const xx = ax * ax + c * (1 - ax * ax), xy = ax * ay - c * (ax * ay) - s * az, xz = ax * az - c * (ax * az) + s * ay;
  const yx = ay * ax - c * (ay * ax) + s * az, yy = ay * ay + c * (1 - ay * ay), yz = ay * az - c * (ay * az) - s * ax;
  const zx = az * ax - c * (az * ax) - s * ay, zy = az * ay - c * (az * ay) + s * ax, zz = az * az + c * (1 - az * az);
  for (let k = 0; k < 3 * NODES; k += 3) {
    const x = nodes[k], y = nodes[k + 1], z = nodes[k + 2];
    nodes[k] = xx * x + xy * y + xz * z;
    nodes[k + 1] = yx * x + yy * y + yz * z;
    nodes[k + 2] = zx * x + zy * y + zz * z;
  }
}

/** Advance a state by one step of h [s]: the velocity with the old place, then the place with the new velocity. */
function advance(scene, state, h) {
  evaluateForce(scene, state);
  const { position, velocity, momentum, wrench } = state, mass = scene.mass;
  for (let axis = 0; axis < 3; axis++) velocity[axis] += (h * wrench[axis]) / mass;
  for (let axis = 0; axis < 3; axis++) position[axis] += h * velocity[axis];
  if (scene.model !== "tumbling") return;
  for (let axis = 0; axis < 3; axis++) momentum[axis] += h * wrench[3 + axis];
  updateSpin(scene, state);
  turnNodes(state, h);
}

/** Return the centre's height above the ground plane [m]. */
function heightOf(scene, state) {
  return scene.nx * state.position[0] + scene.ny * state.position[1] + scene.nz * state.position[2];
}

/** Return the centre's speed away from the ground plane [m/s]. */
function speedOf(scene, state) {
  return scene.nx * state.velocity[0] + scene.ny * state.velocity[1] + scene.nz * state.velocity[2];
}

/** Return how far below the centre the lowest node is [m]. */
function lowestOf(scene, state) {
  let lowest = scene.reach;
  for (let k = 0; k < 3 * NODES; k += 3) {
    const up = scene.nx * state.nodes[k] + scene.ny * state.nodes[k + 1] + scene.nz * state.nodes[k + 2];
    lowest = up < lowest ? up : lowest;
  }
  return -lowest;
}

/** Return m u²/2 + L²/(2 I) [J]. */
function movingEnergy(scene, ux, uy, uz, lx, ly, lz) {
  return 0.5 * scene.mass * (ux * ux + uy * uy + uz * uz) + (0.5 * (lx * lx + ly * ly + lz * lz)) / scene.inertia;
}

/** Return the kinetic energy of translation and rotation [J]. */
function kineticEnergy(scene, { velocity: u, momentum: l }) {
  return movingEnergy(scene, u[0], u[1], u[2], l[0], l[1], l[2]);
}

/** Return the kinetic energy [J] at the time of the place, which the velocity lags behind by `lag` [s]. */
function kineticAtPlace(scene, state, lag) {
  evaluateForce(scene, state);
  const { velocity: u, momentum: l, wrench: w } = state, share = lag / scene.mass;
  const [x, y, z] = [u[0] + share * w[0], u[1] + share * w[1], u[2] + share * w[2]];
  if (scene.model !== "tumbling") return movingEnergy(scene, x, y, z, l[0], l[1], l[2]);
  return movingEnergy(scene, x, y, z, l[0] + lag * w[3], l[1] + lag * w[4], l[2] + lag * w[5]);
}

/** Return m g z of the centre [J]. */
function potentialEnergy(scene, state) {
  return scene.mass * scene.gravity * state.position[2];
}

/** Return the energy in the ground's springs [J], S d²/2 for each node at a depth d. */
function elasticEnergy(scene, state) {
  const height = heightOf(scene, state), nodes = state.nodes;
  let energy = 0;
  for (let k = 0; k < 3 * NODES; k += 3) {
    const depth = -(height + scene.nx * nodes[k] + scene.ny * nodes[k + 1] + scene.nz * nodes[k + 2]);
    if (depth > 0) energy += 0.5 * scene.stiffness * (depth * depth);
  }
  return energy;
}

/** Return arrays for so many states; the last four fields are energies [J], `mechanical` with both at one time. */
function roomFor(count) {
  const room = { step: new Int32Array(count), t: new Float64Array(count) };
  for (const name of ["position", "velocity", "momentum", "spin"]) room[name] = new Float64Array(3 * count);
  room.nodes = new Float64Array(3 * NODES * count);
  for (const name of ["kinetic", "potential", "elastic", "mechanical"]) room[name] = new Float64Array(count);
  return room;
}

/** Put a state into row `row` of what roomFor() made. */
function record(scene, steps, room, row, step, state) {
  room.step[row] = step;
  room.t[row] = (step / steps) * scene.duration;
  for (const name of ["position", "velocity", "momentum", "spin", "nodes"]) {
    room[name].set(state[name], row * state[name].length);
  }
  room.kinetic[row] = kineticEnergy(scene, state);
  room.potential[row] = potentialEnergy(scene, state);
  room.elastic[row] = elasticEnergy(scene, state);
  const moving = kineticAtPlace(scene, state, (0.5 * scene.duration) / steps);
  room.mechanical[row] = moving + room.potential[row] + room.elastic[row];
}

/**
 * Run a scene for so many steps to its duration, and keep every `stride`-th state from the launch on.
 *
 * Returns { scene, steps, done, stride, count, step, t, position, velocity, momentum, spin, nodes, kinetic, potential,
 * elastic, mechanical, verdict }: `count` states, in typed arrays with 3 (24 for nodes) numbers a state; `done` are
 * fewer steps than asked where a number left the range of doubles. verdict: as verdict.js says.
 */
function simulate(scene, steps, stride) {
  const h = scene.duration / steps, state = launchOf(scene);
  const room = roomFor(Math.floor(steps / stride) + 1);
  const watch = startWatch(scene, state, steps);
  record(scene, steps, room, 0, 0, state);
  let done = 0;
  while (done < steps) {
    advance(scene, state, h);
    observeStep(watch, scene, state);
    if (watch.outOfRange) break;
    done += 1;
    if (done % stride === 0) record(scene, steps, room, done / stride, done, state);
  }
  const count = Math.floor(done / stride) + 1;
  return { scene, steps, done, stride, count, ...room, verdict: verdictOf(watch, scene, state) };
}
