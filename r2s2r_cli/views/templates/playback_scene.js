"use strict";
// The world of one run: frames from their packed form, poses at any time, a camera, and one drawing of it.
// No page is touched here, so that it runs without a browser as well.

const SLACK_COLOR = "#9aa4b1", CONTACT_COLOR = "#e08a00", GRID_M = 0.1, PIECES = 8;
const TENSION_STOPS = [[41, 79, 122], [107, 92, 158], [204, 77, 107], [219, 33, 26]];

function bytesOf(text) {
  const raw = atob(text), bytes = new Uint8Array(raw.length);
  for (let i = 0; i < raw.length; i++) bytes[i] = raw.charCodeAt(i);
  return bytes.buffer;
}

function unpackRun(run) {
  return {
    ...run, t: new Float32Array(bytesOf(run.t)), p: new Int16Array(bytesOf(run.p)), q: new Int16Array(bytesOf(run.q)),
    tension: new Uint8Array(bytesOf(run.tension)), spare: new Uint8Array(bytesOf(run.spare)),
    contact: new Uint8Array(bytesOf(run.contact)), control: new Int8Array(bytesOf(run.control)),
  };
}

// Frame before a time, and how far the time lies between it and the next one, 0..1.
function placeOf(t, time) {
  let low = 0, high = t.length - 1;
  while (high - low > 1) {
    const middle = (low + high) >> 1;
    if (t[middle] <= time) low = middle; else high = middle;
  }
  const span = t[high] - t[low];
  return [low, high, span > 0 ? Math.min(1, Math.max(0, (time - t[low]) / span)) : 0];
}

function rotate(q, v) {
  const [x, y, z, w] = q;
  const a = 2 * (y * v[2] - z * v[1]), b = 2 * (z * v[0] - x * v[2]), c = 2 * (x * v[1] - y * v[0]);
  return [v[0] + w * a + y * c - z * b, v[1] + w * b + z * a - x * c, v[2] + w * c + x * b - y * a];
}

const add = (a, b) => [a[0] + b[0], a[1] + b[1], a[2] + b[2]];
const mix = (a, b, s) => [a[0] + s * (b[0] - a[0]), a[1] + s * (b[1] - a[1]), a[2] + s * (b[2] - a[2])];

// Rods, caps, cable ends, tensions at a time; positions and turns are interpolated between the stored frames.
function poseAt(robot, run, time) {
  const [i, j, s] = placeOf(run.t, time), rods = robot.rods.length, pose = {caps: [], middles: [], turns: []};
  let weight = 0;
  pose.com = [0, 0, 0];
  for (let rod = 0; rod < rods; rod++) {
    const at = (k) => [0, 1, 2].map((a) => run.p[3 * (rods * k + rod) + a] * run.scale);
    const turn = (k) => [0, 1, 2, 3].map((a) => run.q[4 * (rods * k + rod) + a]);
    const middle = mix(at(i), at(j), s), first = turn(i), second = turn(j);
    const sign = first.reduce((sum, x, a) => sum + x * second[a], 0) < 0 ? -1 : 1;
    const sum = first.map((x, a) => (1 - s) * x + s * sign * second[a]);
    const norm = Math.hypot(...sum) || 1, q = sum.map((x) => x / norm);
    const facts = robot.rods[rod];
    pose.middles.push(middle);
    pose.turns.push(q);
    for (const end of [-0.5, 0.5]) pose.caps.push(add(middle, rotate(q, [0, 0, end * facts.length])));
    const centre = add(middle, rotate(q, [0, 0, facts.com]));
    pose.com = pose.com.map((x, a) => x + facts.mass * centre[a]);
    weight += facts.mass;
  }
  pose.com = pose.com.map((x) => x / weight);
  const near = s < 0.5 ? i : j, cables = robot.cables.length, motors = robot.motors, bytes = Math.ceil(2 * rods / 8);
  pose.cables = robot.cables.map((cable, k) => {
    const ends = cable.sites.map((site, e) => {
      const rod = cable.caps[e] >> 1;
      return add(pose.middles[rod], rotate(pose.turns[rod], site));
    });
    const level = run.tension[cables * near + k];
    return {ends, level: level / 255, newton: level / 255 * run.top, slack: level === 0,
            spare: run.spare[cables * near + k] / 1000};
  });
  pose.contact = pose.caps.map((_, cap) => (run.contact[bytes * near + (cap >> 3)] >> (cap & 7)) & 1);
  pose.control = Array.from({length: motors}, (_, m) => run.control[motors * near + m] / 127);
  return pose;
}

function lengthOf(robot, pose, cable) {
  const [a, b] = robot.cables[cable].caps.map((cap) => pose.caps[cap]);
  return Math.hypot(a[0] - b[0], a[1] - b[1], a[2] - b[2]);
}

function tensionColor(share) {
  const at = Math.min(0.9999, Math.max(0, share)) * (TENSION_STOPS.length - 1), low = Math.floor(at);
  const rgb = mix(TENSION_STOPS[low], TENSION_STOPS[low + 1], at - low).map(Math.round);
  return `rgb(${rgb.join(",")})`;
}

// A camera that looks at `target` [m] from a distance; azimuth and elevation are those of the viewer.
function makeCamera(view, width, height) {
  const ca = Math.cos(view.azimuth), sa = Math.sin(view.azimuth), ce = Math.cos(view.elevation), se = Math.sin(view.elevation);
  const right = [-sa, ca, 0], up = [-ca * se, -sa * se, ce], towards = [ca * ce, sa * ce, se];
  const dot = (a, b) => a[0] * b[0] + a[1] * b[1] + a[2] * b[2], focal = 1.9 * Math.min(width, 1.3 * height);
  return (p) => {
    const d = [p[0] - view.target[0], p[1] - view.target[1], p[2] - view.target[2]], depth = dot(d, towards);
    const scale = focal / Math.max(0.05, view.distance - depth);
    return {x: width / 2 + scale * dot(d, right), y: 0.56 * height - scale * dot(d, up), depth, scale};
  };
}

function stroke(context, points, color, width, alpha = 1) {
  context.globalAlpha = alpha;
  context.strokeStyle = color;
  context.lineWidth = width;
  context.beginPath();
  points.forEach((p, i) => (i ? context.lineTo(p.x, p.y) : context.moveTo(p.x, p.y)));
  context.stroke();
  context.globalAlpha = 1;
}

// Points along a cable; a slack one hangs as a parabola that is `spare` longer than its span.
function cableLine(cable) {
  const [a, b] = cable.ends, span = Math.hypot(a[0] - b[0], a[1] - b[1], a[2] - b[2]);
  const sag = cable.slack ? Math.min(Math.sqrt(0.375 * span * cable.spare), 0.5 * span) : 0;
  return Array.from({length: PIECES + 1}, (_, i) => {
    const s = i / PIECES, p = mix(a, b, s);
    return [p[0], p[1], Math.max(0, p[2] - 4 * sag * s * (1 - s))];
  });
}

function drawGround(context, project, target, reach) {
  for (const axis of [0, 1]) {
    const first = Math.ceil((target[axis] - reach) / GRID_M), last = Math.floor((target[axis] + reach) / GRID_M);
    for (let k = first; k <= last; k++) {
      const line = [-reach, reach].map((side) => {
        const p = [0, 0, 0];
        p[axis] = k * GRID_M;
        p[1 - axis] = target[1 - axis] + side;
        return project(p);
      });
      const fade = 1 - Math.abs(k * GRID_M - target[axis]) / (reach + GRID_M);
      stroke(context, line, k % 10 ? "#cfc9bd" : "#a79f90", k % 10 ? 1 : 1.4, 0.15 + 0.85 * fade);
    }
  }
}

function ringOnGround(project, centre, radius) {
  return Array.from({length: 25}, (_, i) => {
    const angle = i * Math.PI / 12;
    return project([centre[0] + radius * Math.cos(angle), centre[1] + radius * Math.sin(angle), 0]);
  });
}

function sphere(context, at, radius, color) {
  const r = Math.max(2, radius * at.scale);
  const shade = context.createRadialGradient(at.x - 0.35 * r, at.y - 0.4 * r, 0.1 * r, at.x, at.y, r);
  shade.addColorStop(0, "#ffffff");
  shade.addColorStop(0.35, color);
  shade.addColorStop(1, "#1c2430");
  context.fillStyle = shade;
  context.beginPath();
  context.arc(at.x, at.y, r, 0, 2 * Math.PI);
  context.fill();
  return r;
}

// Everything that can cover something else: small parts, the farthest first.
function parts(context, robot, pose, project, options) {
  const found = [];
  const put = (depth, draw) => found.push({depth, draw});
  robot.rods.forEach((rod, i) => {
    const [a, b] = [pose.caps[2 * i], pose.caps[2 * i + 1]];
    for (let k = 0; k < PIECES; k++) {
      const line = [project(mix(a, b, k / PIECES)), project(mix(a, b, (k + 1) / PIECES))];
      const width = Math.max(3, 2 * rod.radius * line[0].scale);
      put(line[0].depth, () => stroke(context, line, rod.color, width));
    }
    [a, b].forEach((cap, end) => {
      const at = project(cap);
      put(at.depth, () => {
        const r = sphere(context, at, rod.capRadius, rod.color);
        if (options.numbers && r > 6) {
          context.fillStyle = "#ffffff";
          context.font = `bold ${Math.round(Math.min(15, 1.1 * r))}px system-ui, sans-serif`;
          context.textAlign = "center";
          context.textBaseline = "middle";
          context.fillText(String(2 * i + end), at.x, at.y);
        }
      });
    });
  });
  for (const cable of pose.cables) {
    const points = cableLine(cable).map(project);
    for (let k = 0; k < PIECES; k++) {
      const line = [points[k], points[k + 1]];
      const color = cable.slack ? SLACK_COLOR : tensionColor(cable.level);
      put(line[0].depth, () => stroke(context, line, color, cable.slack ? 1.2 : 1.8 + 2.2 * cable.level, cable.slack ? 0.8 : 1));
    }
  }
  return found.sort((one, two) => one.depth - two.depth);
}

function drawScene(context, robot, run, time, view, width, height, options) {
  const pose = poseAt(robot, run, time), project = makeCamera(view, width, height);
  context.clearRect(0, 0, width, height);
  context.lineCap = context.lineJoin = "round";
  drawGround(context, project, [view.target[0], view.target[1]], 1.0);
  if (options.trail) drawTrail(context, robot, run, time, project);
  robot.rods.forEach((_, i) => {
    const line = [pose.caps[2 * i], pose.caps[2 * i + 1]].map((p) => project([p[0], p[1], 0]));
    stroke(context, line, "#5a5348", 7, 0.16);
  });
  pose.caps.forEach((cap, i) => {
    const radius = robot.rods[i >> 1].capRadius;
    if (options.contacts && pose.contact[i]) stroke(context, ringOnGround(project, cap, 1.7 * radius), CONTACT_COLOR, 2.2);
  });
  for (const part of parts(context, robot, pose, project, options)) part.draw();
  return pose;
}

// The way of the centre of mass over the ground up to now, and pale beyond.
function drawTrail(context, robot, run, time, project) {
  run.trail ??= Array.from({length: Math.min(600, run.t.length)}, (_, i, all) => {
    const at = run.t[0] + (run.t[run.t.length - 1] - run.t[0]) * i / Math.max(1, Math.min(600, run.t.length) - 1);
    return {at, p: poseAt(robot, run, at).com};
  });
  const ground = (point) => project([point.p[0], point.p[1], 0]);
  stroke(context, run.trail.map(ground), "#8d8371", 1, 0.45);
  const past = run.trail.filter((point) => point.at <= time).map(ground);
  if (past.length > 1) stroke(context, past, "#3f3a31", 2.2, 0.9);
}
