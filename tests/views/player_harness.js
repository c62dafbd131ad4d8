"use strict";
// The player without a browser: node player_harness.js DATA SCRIPT... plays, turns, zooms, scrubs and rewinds it on a page
// whose canvases note what is drawn on them, and prints the clock after each act, every pose, and how much was drawn.
const fs = require("fs"), vm = require("vm");
const [data, ...code] = process.argv.slice(2).map((name) => fs.readFileSync(name, "utf8"));

const drawn = {};
function canvas(id) {
  drawn[id] = 0;
  const note = (kind) => (...values) => {
    for (const value of values) {
      if (typeof value === "number" && !Number.isFinite(value)) throw new Error(`${kind}(${values})`);
    }
    drawn[id]++;
    return {addColorStop() {}};
  };
  return new Proxy({}, {get: (_, name) => note(String(name)), set: () => true});
}

const elements = {};
function element(id) {
  elements[id] ??= {
    checked: true, value: "1", textContent: "", on: {}, options: [], clientWidth: 600, clientHeight: 400, canvas: canvas(id),
    getContext() { return this.canvas; },
    addEventListener(name, act) { this.on[name] = act; },
    add(option) { this.options.push(option); },
    setPointerCapture() {},
  };
  return elements[id];
}
const document = {getElementById: element, on: {}, addEventListener(name, act) { this.on[name] = act; }};
const window = {
  frames: [], devicePixelRatio: 2, performance: {now: () => 0}, addEventListener() {}, Option: function () {},
  requestAnimationFrame(act) { this.frames.push(act); },
};
const world = vm.createContext({document, window, atob, data: JSON.parse(data), Math, console});
vm.runInContext(code.join("\n") + "\nstartPlayback(document, window, data);", world);

const clocks = [];
const look = () => clocks.push(elements.clock.textContent);
look();
elements.play.on.click();
while (window.frames.length && clocks.length < 60) {
  window.frames.shift()(250 * clocks.length);
  look();
}
elements.scene.on.pointerdown({pointerId: 1, clientX: 0, clientY: 0});
elements.scene.on.pointermove({pointerId: 1, clientX: 40, clientY: 30, buttons: 1});
elements.scene.on.wheel({deltaY: 300, preventDefault() {}});
elements.timeline.on.pointerdown({pointerId: 1, offsetX: 300});
look();
document.on.keydown({key: "Home", target: {tagName: "BODY"}, preventDefault() {}});
look();
const poses = vm.runInContext(`data.runs.map((packed) => {
  const run = unpackRun(packed);
  return [...run.t].map((t) => poseAt(data.robot, run, t));
})`, world);
console.log(JSON.stringify({clocks, poses, drawn}));
