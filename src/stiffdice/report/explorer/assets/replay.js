// A thrown cube in three dimensions, on a canvas: parallel projection, the camera goes with the cube.

const YAW = -0.6, PITCH = 0.42; // of the view [rad]
const FARTHEST = 1e9; // [m] beyond which nothing is painted: a pixel is less than round-off
// Pips of the faces 1 to 6, in parts of half an edge along the two other edges.
const PIPS = [
  [[0, 0]],
  [[-1, -1], [1, 1]],
  [[-1, -1], [0, 0], [1, 1]],
  [[-1, -1], [-1, 1], [1, -1], [1, 1]],
  [[-1, -1], [-1, 1], [1, -1], [1, 1], [0, 0]],
  [[-1, -1], [-1, 0], [-1, 1], [1, -1], [1, 0], [1, 1]],
];
// The outward normal of each face: the edge it is along, and its sign.
const FACES = [[2, 1], [0, 1], [1, 1], [1, -1], [0, -1], [2, -1]];

const add = (a, b) => a.map((part, axis) => part + b[axis]);
const scaled = (a, factor) => a.map((part) => part * factor);

/** Return where a point lies in the view: [right, up, towards the viewer]. */
function inView([x, y, z]) {
  const right = Math.cos(YAW) * x + Math.sin(YAW) * y, away = -Math.sin(YAW) * x + Math.cos(YAW) * y;
  return [right, Math.cos(PITCH) * z + Math.sin(PITCH) * away, Math.sin(PITCH) * z - Math.cos(PITCH) * away];
}

/** Return a painter of one view: lines and filled polygons of points in metres. */
function painterOf(canvas, focus, metres) {
  const pixels = window.devicePixelRatio || 1, width = canvas.clientWidth, height = canvas.clientHeight;
  canvas.width = Math.round(width * pixels);
  canvas.height = Math.round(height * pixels);
  const context = canvas.getContext("2d"), scale = height / metres;
  context.setTransform(pixels, 0, 0, pixels, 0, 0);
  const [right, up] = inView(focus);
  const place = (point) => {
    const seen = inView(point);
    return [width / 2 + (seen[0] - right) * scale, height / 2 - (seen[1] - up) * scale];
  };
  const path = (points) => {
    context.beginPath();
    points.forEach((point, k) => context[k ? "lineTo" : "moveTo"](...place(point)));
  };
  return {
    width: width / scale,
    fill(points, colour, edge) {
      path(points);
      context.closePath();
      context.fillStyle = colour;
      context.fill();
      if (!edge) return;
      context.strokeStyle = edge;
      context.lineJoin = "round";
      context.stroke();
    },
    line(points, colour, thick = 1) {
      path(points);
      context.strokeStyle = colour;
      context.lineWidth = thick;
      context.stroke();
    },
  };
}

/** Return the corners of a face, in turn, from the centre and the half-edges. */
function cornersOf(centre, edges, [axis, sign]) {
  const middle = add(centre, scaled(edges[axis], sign)), [a, b] = [edges[(axis + 1) % 3], edges[(axis + 2) % 3]];
  return [[1, 1], [1, -1], [-1, -1], [-1, 1]].map(([i, j]) => add(middle, add(scaled(a, i), scaled(b, j))));
}

/** Paint a cube with pips, the faces that the viewer sees. */
function paintCube(painter, centre, edges, colours) {
  FACES.forEach((face, number) => {
    const [axis, sign] = face, half = Math.hypot(...edges[axis]), normal = scaled(edges[axis], sign / half);
    if (inView(normal)[2] <= 0) return;
    const light = 70 + 26 * (0.3 * normal[0] - 0.35 * normal[1] + 0.75 * normal[2]);
    painter.fill(cornersOf(centre, edges, face), `hsl(${colours.hue} 45% ${light}%)`, colours.edge);
    const middle = add(centre, scaled(edges[axis], sign)), [a, b] = [edges[(axis + 1) % 3], edges[(axis + 2) % 3]];
    for (const [i, j] of PIPS[number]) {
      const pip = add(middle, add(scaled(a, 0.5 * i), scaled(b, 0.5 * j))), round = [];
      for (let k = 0; k < 16; k++) {
        const angle = (k * Math.PI) / 8;
        round.push(add(pip, add(scaled(a, 0.15 * Math.cos(angle)), scaled(b, 0.15 * Math.sin(angle)))));
      }
      painter.fill(round, colours.pip);
    }
  });
}

/** Return how far a run shows itself: the highest finite place of its centre [m]. */
function highestOf(run) {
  let highest = 0;
  for (let k = 0; k < run.count; k++) {
    const z = run.position[3 * k + 2];
    if (z > highest && z < Infinity) highest = z;
  }
  return highest;
}

/**
 * Mount a replay on { canvas, play (a button), scrub (a range), clock (an output), speed (a select) }.
 *
 * Returns { show(run, playing): show a run from its launch, onTime: called with each time shown [s] }.
 */
function mountReplay({ canvas, play, scrub, clock, speed }) {
  let run = null, time = 0, before = null;
  const replay = { show, onTime: null };

  function show(given, playing) {
    run = given;
    time = 0;
    scrub.max = run.t[run.count - 1];
    scrub.step = "any";
    setPlaying(playing);
    paint();
  }

  function setPlaying(playing) {
    const goesOn = before !== null;
    before = playing ? performance.now() : null;
    play.textContent = playing ? "Pause" : "Play";
    if (playing && !goesOn) requestAnimationFrame(tick);
  }

  function tick(now) {
    if (before === null) return;
    const end = run.t[run.count - 1];
    time = Math.min(end, time + (Math.max(0, now - before) / 1000) * Number(speed.value));
    before = now;
    paint();
    if (time >= end) setPlaying(false);
    else requestAnimationFrame(tick);
  }

  function paint() {
    if (!run || canvas.clientWidth === 0) return;
    paintRun(canvas, run, time);
    scrub.value = time;
    const told = `${time.toFixed(2)} s`;
    scrub.setAttribute("aria-valuetext", told);
    clock.textContent = told;
    replay.onTime?.(time);
  }

  play.addEventListener("click", () => {
    if (before === null && time >= run.t[run.count - 1]) time = 0;
    setPlaying(before === null);
  });
  scrub.addEventListener("input", () => {
    setPlaying(false);
    time = Number(scrub.value);
    paint();
  });
  new ResizeObserver(paint).observe(canvas);
  matchMedia("(prefers-color-scheme: dark)").addEventListener("change", paint);
  return replay;
}

/** Return the last state kept at or before a time. */
function rowAt(run, time) {
  const row = Math.floor((time / run.t[run.count - 1]) * (run.count - 1) + 1e-9);
  return Math.min(run.count - 1, Math.max(0, row || 0));
}

/** Paint a run at a time [s]: the ground, the way so far, the shadow and the cube. */
function paintRun(canvas, run, time) {
  const row = rowAt(run, time), side = run.scene.side, style = getComputedStyle(canvas);
  const colour = (name) => style.getPropertyValue(name).trim();
  const centre = [0, 1, 2].map((axis) => run.position[3 * row + axis]);
  const edges = [0, 1, 2].map((edge) => halfEdge(run.nodes, edge, 3 * NODES * row));
  // The higher the cube, the farther the camera, so that the ground stays in sight.
  const metres = Math.min(Math.max(4.5 * side, 1.5 * (centre[2] + side)), 40 * side);
  const focus = [centre[0], centre[1], Math.max(0.38 * metres, centre[2] - 0.4 * metres) + Math.min(0, centre[2])];
  const painter = painterOf(canvas, focus, metres);
  if (!centre.every((part) => Math.abs(part) < FARTHEST)) return;
  paintGround(painter, centre, side, colour("--grid"));
  const way = [];
  for (let k = 0; k <= row; k += 1 + Math.floor(row / 800)) way.push([0, 1, 2].map((axis) => run.position[3 * k + axis]));
  painter.line([...way, centre], colour("--accent"), 1.5);
  for (const face of FACES) painter.fill(cornersOf(centre, edges, face).map(([x, y]) => [x, y, 0]), colour("--shadow"));
  paintCube(painter, centre, edges, { hue: colour("--cube-hue"), edge: colour("--cube-edge"), pip: colour("--pip") });
}

/** Paint lines on the ground, the farther apart the farther away the camera. */
function paintGround(painter, centre, side, colour) {
  const near = side > 0.5 ? 1 : 0.02, gap = painter.width > 20 * near ? 5 * near : near;
  const reach = Math.ceil((1.5 * painter.width) / gap) * gap;
  const [x, y] = [0, 1].map((axis) => Math.round(centre[axis] / gap) * gap);
  for (let offset = -reach; offset <= reach; offset += gap) {
    painter.line([[x + offset, y - reach, 0], [x + offset, y + reach, 0]], colour);
    painter.line([[x - reach, y + offset, 0], [x + reach, y + offset, 0]], colour);
  }
}
