"use strict";
// What every page with a scene has: play, pace, scrub, orbit, zoom, keys. The page says what is drawn, and from when to when.

// A view of its own, to begin with.
function viewFrom(home) {
  return {...home, target: [...home.target]};
}

// The drawing context of a canvas as large as its place on this screen, and that size.
function fitCanvas(window, canvas) {
  const ratio = window.devicePixelRatio || 1, width = canvas.clientWidth, height = canvas.clientHeight;
  if (canvas.width !== Math.round(width * ratio) || canvas.height !== Math.round(height * ratio)) {
    canvas.width = Math.round(width * ratio);
    canvas.height = Math.round(height * ratio);
  }
  const context = canvas.getContext("2d");
  context.setTransform(ratio, 0, 0, ratio, 0, 0);
  return [context, width, height];
}

// state: time, speed, playing, before, view. page: draw, begin and end as functions, home (the view to go back to), size of
// the robot, speeds to choose from, jump of the arrow keys in seconds. Draws once; returns the function that goes to a time.
function startPlayer(document, window, state, page) {
  const find = (id) => document.getElementById(id), scene = find("scene"), bar = find("timeline"), play = find("play");

  function tick(now) {
    if (!state.playing) return;
    state.time = Math.min(page.end(), state.time + state.speed * (now - state.before) / 1000);
    state.before = now;
    if (state.time >= page.end()) state.playing = false;
    page.draw();
    window.requestAnimationFrame(tick);
  }

  function setPlaying(on) {
    state.playing = on;
    if (on && state.time >= page.end()) state.time = page.begin();
    state.before = window.performance.now();
    if (on) window.requestAnimationFrame(tick);
    page.draw();
  }

  function seek(time) {
    state.time = Math.min(page.end(), Math.max(page.begin(), time));
    page.draw();
  }

  const pace = find("speed");
  page.speeds.forEach((speed) => pace.add(new window.Option(`${speed} x`, String(speed), speed === 1, speed === 1)));
  pace.addEventListener("change", () => (state.speed = Number(pace.value)));
  play.addEventListener("click", () => setPlaying(!state.playing));
  find("reset").addEventListener("click", () => {
    state.view = viewFrom(page.home);
    page.draw();
  });

  // One pointer turns, with shift or the other button it moves the ground; two pointers and the wheel zoom.
  const pointers = new Map();
  const apart = () => {
    const [a, b] = [...pointers.values()];
    return Math.hypot(a.x - b.x, a.y - b.y);
  };
  const zoom = (factor) => (state.view.distance = Math.min(20 * page.size, Math.max(0.8 * page.size, state.view.distance * factor)));
  scene.addEventListener("pointerdown", (event) => {
    scene.setPointerCapture(event.pointerId);
    pointers.set(event.pointerId, {x: event.clientX, y: event.clientY});
  });
  for (const gone of ["pointerup", "pointercancel"]) scene.addEventListener(gone, (event) => pointers.delete(event.pointerId));
  scene.addEventListener("pointermove", (event) => {
    const old = pointers.get(event.pointerId);
    if (!old) return;
    const before = pointers.size === 2 ? apart() : 0, dx = event.clientX - old.x, dy = event.clientY - old.y;
    pointers.set(event.pointerId, {x: event.clientX, y: event.clientY});
    if (pointers.size === 2) zoom(before / Math.max(1, apart()));
    else if (event.shiftKey || event.buttons === 2) moveTarget(dx, dy);
    else {
      state.view.azimuth -= 0.008 * dx;
      state.view.elevation = Math.min(1.55, Math.max(0.02, state.view.elevation + 0.008 * dy));
    }
    page.draw();
  });
  function moveTarget(dx, dy) {
    find("follow").checked = false;
    const metres = state.view.distance / (1.9 * Math.min(scene.clientWidth, 1.3 * scene.clientHeight));
    const {azimuth, target} = state.view, c = Math.cos(azimuth), s = Math.sin(azimuth);
    target[0] += metres * (s * dx - c * dy);
    target[1] += metres * (-c * dx - s * dy);
  }
  scene.addEventListener("contextmenu", (event) => event.preventDefault());
  scene.addEventListener("wheel", (event) => {
    event.preventDefault();
    zoom(Math.exp(0.001 * event.deltaY));
    page.draw();
  }, {passive: false});

  const scrub = (event) => seek(page.begin() + (page.end() - page.begin()) * event.offsetX / bar.clientWidth);
  bar.addEventListener("pointerdown", (event) => {
    bar.setPointerCapture(event.pointerId);
    scrub(event);
  });
  bar.addEventListener("pointermove", (event) => event.buttons && scrub(event));
  document.addEventListener("keydown", (event) => {
    const on = event.target.tagName;
    if (on === "SELECT" || (event.key === " " && (on === "BUTTON" || on === "INPUT"))) return; // these take the key themselves
    const jump = {ArrowLeft: -page.jump, ArrowRight: page.jump, PageUp: -1, PageDown: 1}[event.key];
    if (event.key === " ") setPlaying(!state.playing);
    else if (event.key === "Home") seek(0);
    else if (event.key === "End") seek(page.end());
    else if (jump) seek(state.time + jump);
    else return;
    event.preventDefault();
  });
  window.addEventListener("resize", page.draw);
  page.draw();
  return seek;
}
