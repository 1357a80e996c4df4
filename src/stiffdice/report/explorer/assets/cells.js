// The stored cells of the sweeps, and the launches of their members, as src/stiffdice/report/explorer/map_data.py packs
// them. A cell is known by its number in its sweep.

const TYPED = { Float64Array, Float32Array, Int32Array, Uint16Array, Uint8Array };

async function unpackedBlock(text) {
  const packed = Uint8Array.from(atob(text), (sign) => sign.charCodeAt(0));
  const stream = new Blob([packed]).stream().pipeThrough(new DecompressionStream("gzip"));
  return new Response(stream).arrayBuffer();
}

class Sweep {
  constructor(about, block) {
    const array = (place) => new TYPED[place.type](block, place.at, place.count);
    Object.assign(this, about);
    this.names = about.criteria.map(({ name }) => name);
    this.steps = array(about.cells.steps);
    this.verdicts = array(about.cells.verdicts);
    this.worst = array(about.cells.worst);
    this.bits = array(about.cells.passes);
    this.width = Math.ceil(this.members / 8); // bytes of a row of bits
  }

  column(cell) {
    return this.columns.find(({ first, count }) => cell < first + count);
  }

  ofLaw(law) {
    return this.columns.filter((column) => column.law === law);
  }

  passes(criterion, cell, member) {
    const row = (this.names.indexOf(criterion) * this.steps.length + cell) * this.width;
    return ((this.bits[row + (member >> 3)] >> (member & 7)) & 1) === 1;
  }

  failing(criterion, cell) {
    return [...Array(this.members).keys()].filter((member) => !this.passes(criterion, cell, member));
  }

  share(criterion, cell) {
    return (this.members - this.failing(criterion, cell).length) / this.members;
  }

  worstOf(criterion, cell) {
    return this.worst[this.names.indexOf(criterion) * this.steps.length + cell];
  }

  omegaH(cell) {
    return this.column(cell).radians / this.steps[cell];
  }

  // How many members ended with which verdict: [[number of the verdict, count], ...].
  ended(cell) {
    const count = this.verdicts.length / this.steps.length;
    const row = [...this.verdicts.subarray(cell * count, (cell + 1) * count).entries()];
    return row.filter(([, members]) => members > 0);
  }

  // The cell of a column whose steps are nearest, as a ratio.
  nearest(column, steps) {
    let best = column.first;
    for (let cell = column.first; cell < column.first + column.count; cell += 1) {
      if (Math.abs(Math.log(this.steps[cell] / steps)) < Math.abs(Math.log(this.steps[best] / steps))) best = cell;
    }
    return best;
  }

  // The member that is shown first: one that fails and has an exact path, else one that fails, else the first.
  preferred(criterion, cell) {
    const failing = this.failing(criterion, cell), known = this.column(cell).paths.length;
    if (failing.length === 0) return 0;
    return known > 1 ? (failing.find((member) => member < known) ?? failing[0]) : failing[0];
  }

  // The criterion about which the members of most cells disagree.
  mostDisputed() {
    const disputed = (name) => {
      let count = 0;
      for (let cell = 0; cell < this.steps.length; cell += 1) {
        const share = this.share(name, cell);
        if (share > 0 && share < 1) count += 1;
      }
      return count;
    };
    const counts = this.names.map(disputed);
    return this.names[counts.indexOf(Math.max(...counts))];
  }

  // The number of the exact path of a member, undefined if none is published: all share one unless the cube turns.
  path(cell, member) {
    const { paths } = this.column(cell);
    return paths[this.turns ? member : 0];
  }

  get turns() {
    return this.launches.length > 1 || this.model === "tumbling";
  }

  /** Return a member as kernel.js runs it, {late [s], scene}, as `phased` of initial_conditions.py launches it. */
  member(cell, member) {
    const { stiffness, law, approach_damping } = this.column(cell), { duration, gravity } = this.scene;
    const late = (member / this.members) * (duration / this.steps[cell]), down = [0, 0, -gravity];
    const start = this.launches[this.turns ? member : 0], { velocity, node_offset: nodes } = start;
    const turn = start.angular_momentum.map((part) => (part / this.physics.inertia) * late);
    const turned = this.turns && turn.some((part) => part !== 0) ? rotated(nodes, turn) : nodes;
    const scene = {
      ...this.physics, ...start, model: this.model, stiffness, approach_damping, gated: law === "gated", duration,
      hop_height: this.hop_height, node_offset: turned.flat(),
      position: start.position.map((x, k) => x + (velocity[k] * late + 0.5 * down[k] * (late * late))),
      velocity: velocity.map((u, k) => u + down[k] * late),
    };
    return { late, scene };
  }
}

// scene/rotation.py: nodes turned by a rotation vector [rad] (Rodrigues' formula).
function rotated(nodes, rotation) {
  const angle = Math.hypot(...rotation), [x, y, z] = rotation.map((part) => part / angle);
  const cos = Math.cos(angle), sin = Math.sin(angle);
  return nodes.map(([a, b, c]) => {
    const along = a * x + b * y + c * z, parallel = [along * x, along * y, along * z];
    const across = [y * c - z * b, z * a - x * c, x * b - y * a];
    return [a, b, c].map((part, k) => parallel[k] + cos * (part - parallel[k]) + sin * across[k]);
  });
}

// An exact path: arrays one after another, as `exact_paths.py` packs them.
class ExactPath {
  constructor(place, block) {
    const values = new TYPED[place.type](block, place.at, place.count);
    let at = 0;
    const take = (count) => values.subarray(at, (at += count));
    const [bends, corners, nodes] = place.counts;
    this.until = place.until;
    this.bends = { time: take(bends), height: take(bends), rate: take(bends) };
    this.energy = { time: take(corners), energy: take(corners) };
    this.reference = nodes > 0 ? { time: take(nodes), place: take(3 * nodes), velocity: take(3 * nodes) } : null;
  }

  // Heights to draw, {time [s], height [m]}: points at most `apart` [s] apart.
  drawn(apart) {
    const { time, height, rate } = this.bends, found = { time: [time[0]], height: [height[0]] };
    for (let k = 0; k + 1 < time.length; k += 1) {
      const span = time[k + 1] - time[k], p = height[k], q = height[k + 1], u = rate[k] * span, v = rate[k + 1] * span;
      const points = Math.max(2, Math.ceil(span / apart));
      for (let i = 1; i <= points; i += 1) {
        const s = i / points;
        found.time.push(time[k] + s * span);
        found.height.push(p + s * (u + s * (3 * (q - p) - 2 * u - v + s * (2 * (p - q) + u + v))));
      }
    }
    return found;
  }
}
