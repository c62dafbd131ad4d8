"use strict";
// The page around the scene: run, play, scrub, orbit, zoom, and what cables and motors do.

const SPEEDS = [0.1, 0.25, 0.5, 1, 2, 4, 8];

function startPlayback(document, window, data) {
  const find = (id) => document.getElementById(id), robot = data.robot;
  const scene = find("scene"), panel = find("panel"), bar = find("timeline"), play = find("play"), clock = find("clock");
  const runs = data.runs.map(unpackRun);
  const home = {azimuth: -1.12, elevation: 0.42, distance: 4.2 * robot.size, target: [0, 0, 0.25 * robot.size]};
  const state = {run: runs[0], time: 0, speed: 1, playing: false, view: viewFrom(home), before: 0};
  const options = () => ({trail: find("trail").checked, contacts: find("contacts").checked, numbers: find("numbers").checked});
  const end = () => state.run.t[state.run.t.length - 1];

  function draw() {
    if (find("follow").checked) {
      const com = poseAt(robot, state.run, state.time).com;
      state.view.target[0] = com[0];
      state.view.target[1] = com[1];
    }
    const [context, width, height] = fitCanvas(window, scene);
    const pose = drawScene(context, robot, state.run, state.time, state.view, width, height, options());
    drawPanel(...fitCanvas(window, panel), robot, state.run, pose, state.time);
    drawTimeline(...fitCanvas(window, bar), state.run, state.time);
    const first = poseAt(robot, state.run, state.run.t[0]).com;
    const gone = 1000 * Math.hypot(pose.com[0] - first[0], pose.com[1] - first[1]);
    clock.textContent = `${state.time.toFixed(2)} s of ${end().toFixed(2)} s    centre of mass ${gone.toFixed(0)} mm from the start`;
    play.textContent = state.playing ? "Pause" : "Play";
  }

  const choose = find("run");
  runs.forEach((run, i) => choose.add(new window.Option(run.title, String(i))));
  choose.hidden = runs.length < 2;
  choose.addEventListener("change", () => {
    state.run = runs[Number(choose.value)];
    state.view.target = [...home.target];
    seek(state.run.t[0]);
  });
  for (const id of ["trail", "contacts", "numbers", "follow"]) find(id).addEventListener("change", draw);
  const seek = startPlayer(document, window, state, {
    draw, begin: () => state.run.t[0], end, home, size: robot.size, speeds: SPEEDS, jump: 0.04,
  });
}

// One row a cable: tension above; for winched ones below it position, target with tolerance, and what the motor does.
function drawPanel(context, width, height, robot, run, pose, time) {
  const ink = "#1c2430", pale = "#8792a2", row = Math.min(46, (height - 22) / robot.cables.length), slim = Math.max(3, 0.2 * row);
  const left = 86, track = width - left - 54;
  context.clearRect(0, 0, width, height);
  context.font = "12px system-ui, sans-serif";
  context.textBaseline = "middle";
  context.fillStyle = pale;
  context.textAlign = "left";
  context.fillText("cable (caps)", 4, 9);
  context.fillText("tension; position and target", left, 9);
  const interval = run.intervals.find((one) => time <= one.end) || run.intervals[run.intervals.length - 1];
  robot.cables.forEach((cable, k) => {
    const y = 22 + k * row, now = pose.cables[k], winched = cable.motor >= 0;
    const high = y + (winched ? 0.28 : 0.5) * row - slim / 2, low = y + 0.68 * row - slim / 2;
    context.font = `${row < 18 ? 10 : 12}px system-ui, sans-serif`;
    context.textAlign = "left";
    context.fillStyle = winched ? ink : pale;
    context.fillText(`${k} (${cable.caps.join("-")})`, 4, y + row / 2);
    context.textAlign = "right";
    context.fillStyle = now.slack ? pale : ink;
    context.fillText(now.slack ? "slack" : `${now.newton.toFixed(1)} N`, width - 4, y + row / 2);
    context.fillStyle = "#e4e8ee";
    context.fillRect(left, high, track, slim);
    context.fillStyle = tensionColor(now.level);
    context.fillRect(left, high, track * now.level, slim);
    if (winched) drawPosition(context, left, track, low, slim, robot, interval, pose, k);
  });
}

// Positions -0.25 to 1.25 across the track, so that a little more than the range is seen.
function drawPosition(context, left, track, y, slim, robot, interval, pose, k) {
  const motor = robot.cables[k].motor, x = (position) => left + track * Math.min(1, Math.max(0, (position + 0.25) / 1.5));
  context.fillStyle = "#ece8df";
  context.fillRect(x(0), y, x(1) - x(0), slim);
  if (interval) {
    const target = interval.target[motor], from = x(target - robot.pid.tolerance);
    context.fillStyle = "#b9c9b0";
    context.fillRect(from, y, x(target + robot.pid.tolerance) - from, slim);
    context.fillStyle = "#1c2430";
    context.fillRect(x(target) - 1, y - 2, 2, slim + 4);
  }
  const at = x((lengthOf(robot, pose, k) - robot.pid.min) / robot.pid.range), drive = pose.control[motor];
  context.fillStyle = drive === 0 ? "#8792a2" : "#d4380d";
  context.beginPath();
  context.arc(at, y + slim / 2, Math.max(3, 0.7 * slim), 0, 2 * Math.PI);
  context.fill();
  if (drive !== 0) context.fillRect(Math.min(at, at - 22 * drive), y + slim / 2 - 1, Math.abs(22 * drive), 2);
}

// Target intervals as bands with their numbers, seconds below, the present time as a line.
function drawTimeline(context, width, height, run, time) {
  const last = run.t[run.t.length - 1] || 1, x = (t) => width * t / last;
  context.clearRect(0, 0, width, height);
  context.font = "11px system-ui, sans-serif";
  context.textAlign = "center";
  context.textBaseline = "middle";
  run.intervals.forEach((one, i) => {
    context.fillStyle = i % 2 ? "#cfd9e6" : "#e4eaf2";
    context.fillRect(x(one.start), 0, x(one.end) - x(one.start), height - 14);
    context.fillStyle = "#5a6675";
    if (x(one.end) - x(one.start) > 16) context.fillText(String(i + 1), (x(one.start) + x(one.end)) / 2, (height - 14) / 2);
  });
  const step = [0.1, 0.2, 0.5, 1, 2, 5, 10, 30, 60, 300].find((s) => x(s) > 50) || 600;
  context.fillStyle = "#5a6675";
  for (let t = 0; t <= last; t += step) context.fillText(`${Number(t.toFixed(1))} s`, Math.max(10, x(t)), height - 6);
  context.fillStyle = "#d4380d";
  context.fillRect(x(time) - 1, 0, 2, height - 12);
}
