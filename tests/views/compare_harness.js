"use strict";
// The player of a comparison without a browser: node compare_harness.js DATA SCRIPT... plays it to its end, hides the
// first simulator, and prints the clock after each act, where every robot was at some times, and how much was drawn.
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

const elements = {}, made = [];
function element(id) {
  const fresh = {
    checked: true, value: "1", textContent: "", on: {}, style: {}, children: [], clientWidth: 600, clientHeight: 400,
    canvas: id && canvas(id),
    getContext() { return this.canvas; },
    addEventListener(name, act) { this.on[name] = act; },
    add() {}, setPointerCapture() {},
    append(...more) { this.children.push(...more); },
  };
  if (!id) {
    made.push(fresh);
    return fresh;
  }
  return (elements[id] ??= fresh);
}
const document = {getElementById: element, createElement: () => element(""), addEventListener() {}};
const window = {
  frames: [], devicePixelRatio: 1, performance: {now: () => 0}, addEventListener() {}, Option: function () {},
  requestAnimationFrame(act) { this.frames.push(act); },
};
const world = vm.createContext({document, window, atob, data: JSON.parse(data), Math, console});
vm.runInContext(code.join("\n") + "\nstartComparison(document, window, data);", world);

const clocks = [], look = () => clocks.push(elements.clock.textContent);
look();
elements.play.on.click();
while (window.frames.length && clocks.length < 60) {
  window.frames.shift()(250 * clocks.length);
  look();
}
const before = drawn.scene;
elements.play.textContent = "";
elements.reset.on.click();
const all = drawn.scene - before;
const box = made.filter((one) => one.type === "checkbox")[1];
box.checked = false;
box.on.change();
const fewer = drawn.scene - before - all;
const poses = vm.runInContext(`(() => {
  const caps = 2 * data.robot.rods.length, actors = data.runs[0].actors.map((one) => ({...unpackActor(one), caps}));
  const at = (step) => [0, 0.25, 0.5, 1].map((share) => {
    const time = share * actors[0].begin.at(-1);
    return actors.map((one) => actorAt(one, actors[0], time, step).caps);
  });
  return {step: at(true), own: at(false)};
})()`, world);
console.log(JSON.stringify({clocks, poses, all, fewer, drawn}));
