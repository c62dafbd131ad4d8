"use strict";
// Real and simulated robots together: what each does at a time, one drawing of all, and the page around it.

const SPEEDS = [0.25, 0.5, 1, 2, 4];

function unpackActor(actor) {
  const begin = [0];
  actor.duration.forEach((d) => begin.push(begin[begin.length - 1] + d));
  return {...actor, begin, p: new Int16Array(bytesOf(actor.p)), com: new Int16Array(bytesOf(actor.com))};
}

// Index among the frames of an actor, with a fraction: frame k * points + j is the share (j + 1) / points of interval k.
// place: interval and share of it. Before the first frame it stays there.
function frameOf(actor, interval, share) {
  return Math.max(0, interval * actor.points + share * actor.points - 1);
}

// Interval and share at a time of an actor's own clock.
function placeAt(actor, time) {
  const last = actor.duration.length - 1;
  for (let k = 0; k <= last; k++) {
    if (time < actor.begin[k + 1] || k === last) {
      return [k, Math.min(1, Math.max(0, (time - actor.begin[k]) / (actor.duration[k] || 1)))];
    }
  }
  return [0, 0];
}

// Caps and centre of mass at a time of the real robot's clock; in step: at its interval and share.
function actorAt(actor, real, time, inStep) {
  const [k, share] = placeAt(inStep ? real : actor, time), frames = actor.p.length / (3 * actor.caps);
  const at = Math.min(frames - 1, frameOf(actor, k, share)), low = Math.floor(at), high = Math.min(frames - 1, low + 1), s = at - low;
  const value = (list, width, index, axis) =>
    actor.scale * ((1 - s) * list[width * low + index + axis] + s * list[width * high + index + axis]);
  const caps = Array.from({length: actor.caps}, (_, c) => [0, 1, 2].map((a) => value(actor.p, 3 * actor.caps, 3 * c, a)));
  return {caps, com: [value(actor.com, 2, 0, 0), value(actor.com, 2, 0, 1), 0], frame: at};
}

// The parts of one robot with their depth; a simulated one is thin and of one colour.
function bodyParts(context, robot, pose, actor, project, plain) {
  const found = [], put = (depth, draw) => found.push({depth, draw});
  for (const [a, b] of robot.cables) {
    const ends = [pose.caps[a], pose.caps[b]];
    for (let k = 0; k < PIECES; k++) {
      const line = [project(mix(...ends, k / PIECES)), project(mix(...ends, (k + 1) / PIECES))];
      put(line[0].depth, () => stroke(context, line, plain ? actor.color : "#6f7a89", 1.1, plain ? 0.45 : 0.9));
    }
  }
  robot.rods.forEach((rod, i) => {
    const ends = [pose.caps[2 * i], pose.caps[2 * i + 1]], color = plain ? actor.color : rod.color;
    for (let k = 0; k < PIECES; k++) {
      const line = [project(mix(...ends, k / PIECES)), project(mix(...ends, (k + 1) / PIECES))];
      put(line[0].depth, () => stroke(context, line, color, (plain ? 1.1 : 2) * Math.max(1.5, rod.radius * line[0].scale)));
    }
    ends.forEach((cap) => {
      const at = project(cap);
      put(at.depth, () => {
        if (!plain) return sphere(context, at, rod.capRadius, color);
        context.strokeStyle = color;
        context.lineWidth = 2;
        context.beginPath();
        context.arc(at.x, at.y, Math.max(2, rod.capRadius * at.scale), 0, 2 * Math.PI);
        return context.stroke();
      });
    });
  });
  return found;
}

function drawAll(context, robot, run, shown, time, inStep, trails, view, width, height) {
  const project = makeCamera(view, width, height), real = run.actors[0];
  context.clearRect(0, 0, width, height);
  context.lineCap = context.lineJoin = "round";
  drawGround(context, project, [view.target[0], view.target[1]], 1.0);
  const poses = run.actors.map((actor) => actorAt(actor, real, time, inStep)), found = [];
  run.actors.forEach((actor, k) => {
    if (!shown[k]) return;
    robot.rods.forEach((_, i) => {
      const line = [poses[k].caps[2 * i], poses[k].caps[2 * i + 1]].map((p) => project([p[0], p[1], 0]));
      stroke(context, line, "#5a5348", k ? 3 : 7, k ? 0.08 : 0.16);
    });
    if (trails) drawPath(context, actor, poses[k], project);
    found.push(...bodyParts(context, robot, poses[k], actor, project, k > 0));
  });
  found.sort((one, two) => one.depth - two.depth).forEach((part) => part.draw());
  return poses;
}

// The way of the centre of mass over the ground, pale beyond now.
function drawPath(context, actor, pose, project) {
  const points = Array.from({length: actor.com.length / 2}, (_, i) =>
    project([actor.scale * actor.com[2 * i], actor.scale * actor.com[2 * i + 1], 0]));
  stroke(context, points, actor.color, 1.2, 0.3);
  const past = [...points.slice(0, Math.floor(pose.frame) + 1), project(pose.com)];
  if (past.length > 1) stroke(context, past, actor.color, 2.4, 0.9);
}

function startComparison(document, window, data) {
  const find = (id) => document.getElementById(id), robot = data.robot, caps = 2 * robot.rods.length;
  const scene = find("scene"), bar = find("timeline"), play = find("play"), clock = find("clock");
  const runs = data.runs.map((run) => ({...run, actors: run.actors.map((one) => ({...unpackActor(one), caps}))}));
  const home = {azimuth: -1.12, elevation: 0.5, distance: 4.6 * robot.size, target: [0, 0, 0.2 * robot.size]};
  const names = [...new Set(runs.flatMap((run) => run.actors.map((one) => one.name)))], hidden = new Set();
  const state = {run: runs[0], time: 0, speed: 1, playing: false, view: viewFrom(home), before: 0};
  const inStep = () => find("step").checked;
  const end = () => Math.max(...state.run.actors.map((one) => (inStep() ? state.run.actors[0] : one).begin.at(-1)));

  function draw() {
    const real = state.run.actors[0], now = actorAt(real, real, state.time, true);
    if (find("follow").checked) state.view.target = [now.com[0], now.com[1], state.view.target[2]];
    const [context, width, height] = fitCanvas(window, scene), shown = state.run.actors.map((one) => !hidden.has(one.name));
    const poses = drawAll(context, robot, state.run, shown, state.time, inStep(), find("trail").checked, state.view, width, height);
    drawErrors(...fitCanvas(window, bar), state.run, shown, state.time, end());
    const off = state.run.actors.slice(1).map((one, k) => {
      const d = Math.hypot(poses[k + 1].com[0] - poses[0].com[0], poses[k + 1].com[1] - poses[0].com[1]);
      return `${one.name} ${(1000 * d).toFixed(0)} mm`;
    });
    clock.textContent = `${state.time.toFixed(2)} s, interval ${placeAt(real, state.time)[0] + 1} of ${real.duration.length}    `
      + `centre of mass off by: ${off.join(", ")}`;
    play.textContent = state.playing ? "Pause" : "Play";
  }

  const choose = find("run");
  runs.forEach((run, i) => choose.add(new window.Option(run.name, String(i))));
  choose.hidden = runs.length < 2;
  choose.addEventListener("change", () => {
    state.run = runs[Number(choose.value)];
    seek(0);
  });
  names.forEach((name) => {
    const label = document.createElement("label"), box = document.createElement("input"), word = document.createElement("span");
    box.type = "checkbox";
    box.checked = true;
    word.textContent = ` ${name} `;
    word.style.color = runs.flatMap((run) => run.actors).find((one) => one.name === name).color;
    box.addEventListener("change", () => {
      if (box.checked) hidden.delete(name); else hidden.add(name);
      draw();
    });
    label.append(box, word);
    find("actors").append(label);
  });
  for (const id of ["trail", "step", "follow"]) find(id).addEventListener("change", () => seek(state.time));
  const seek = startPlayer(document, window, state, {
    draw, begin: () => 0, end, home, size: robot.size, speeds: SPEEDS, jump: 0.05,
  });
}

// The real robot's intervals as bands, above them by simulator how far the caps are off at their ends, now as a line.
function drawErrors(context, width, height, run, shown, time, last) {
  const real = run.actors[0], x = (t) => width * t / (last || 1), base = height - 30;
  const top = Math.max(1, ...run.errors.flatMap((one) => one.mm));
  context.clearRect(0, 0, width, height);
  context.font = "11px system-ui, sans-serif";
  context.textAlign = "center";
  context.textBaseline = "middle";
  real.duration.forEach((d, i) => {
    const from = x(real.begin[i]), to = x(real.begin[i + 1]), many = Math.max(1, run.errors.length);
    context.fillStyle = i % 2 ? "#cfd9e6" : "#e4eaf2";
    context.fillRect(from, base, to - from, 16);
    context.fillStyle = "#5a6675";
    if (to - from > 16) context.fillText(String(i + 1), (from + to) / 2, base + 8);
    run.errors.forEach((one, k) => {
      const actor = run.actors.findIndex((other) => other.name === one.name);
      if (one.mm[i] === undefined || actor < 0 || !shown[actor]) return;
      const wide = Math.max(2, Math.min(10, (to - from) / (many + 1))), high = (base - 2) * one.mm[i] / top;
      context.fillStyle = run.actors[actor].color;
      context.fillRect(to - wide * (many - k), base - high, wide - 1, high);
    });
  });
  context.fillStyle = "#5a6675";
  context.textAlign = "left";
  context.fillText(`${top.toFixed(0)} mm`, 2, 7);
  context.textAlign = "center";
  const step = [0.5, 1, 2, 5, 10, 30, 60, 300].find((s) => x(s) > 50) || 600;
  for (let t = 0; t <= last; t += step) context.fillText(`${t} s`, Math.max(10, x(t)), height - 6);
  context.fillStyle = "#d4380d";
  context.fillRect(x(time) - 1, 0, 2, height - 12);
}
