"use strict";
// The page of marks without a browser: node marks_harness.js TASK SCRIPT ACTS prints the command after each act.
// ACTS: [["click", rod, u, v], ["drag", rod, u0, v0, u1, v1], ["undo"]]. The picture is shown at twice its size.
const fs = require("fs"), vm = require("vm");
const [task, script, acts] = process.argv.slice(2);

let chosen = "";
const elements = {};
function element(id) {
  elements[id] ??= {
    textContent: id === "task" ? fs.readFileSync(task, "utf8") : "", on: {}, width: 64, height: 48,
    getContext: () => ({drawImage() {}, strokeRect() {}}),
    getBoundingClientRect: () => ({left: 10, top: 20, width: 128, height: 96}),
    addEventListener(name, act) { this.on[name] = act; },
    setPointerCapture() {},
  };
  return elements[id];
}
const page = {
  document: {getElementById: element, querySelector: () => ({value: chosen})},
  Image: class { set src(_) { this.onload(); } },
};
vm.runInNewContext(fs.readFileSync(script, "utf8"), page);

const at = (u, v) => ({clientX: 10 + 2 * u + 1, clientY: 20 + 2 * v + 1, pointerId: 1});
for (const [act, rod, ...where] of JSON.parse(acts)) {
  if (act === "undo") elements.undo.on.click();
  else {
    chosen = rod;
    elements.picture.on.pointerdown(at(where[0], where[1]));
    elements.picture.on.pointermove(at(where.at(-2), where.at(-1)));
    elements.picture.on.pointerup(at(where.at(-2), where.at(-1)));
  }
  console.log(elements.command.textContent);
}
