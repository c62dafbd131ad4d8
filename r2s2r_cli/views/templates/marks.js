"use strict";
// Every click or box on the picture becomes an option of the command that is shown.
const task = JSON.parse(document.getElementById("task").textContent);
const picture = document.getElementById("picture"), context = picture.getContext("2d");
const DRAG_PX = 4;
const marks = [];
let start = null, now = null;
const image = new Image();
image.onload = draw;
image.src = "data:image/png;base64," + task.picture;

function pixel(event) {
  const box = picture.getBoundingClientRect();
  const along = (at, from, size, pixels) => Math.min(Math.max(Math.floor(((at - from) / size) * pixels), 0), pixels - 1);
  return [along(event.clientX, box.left, box.width, picture.width), along(event.clientY, box.top, box.height, picture.height)];
}

function rod() {
  return document.querySelector("input[name=rod]:checked").value;
}

function mark(from, to) {
  const [u, v] = [0, 1].map((i) => [Math.min(from[i], to[i]), Math.max(from[i], to[i])]);
  if (Math.max(u[1] - u[0], v[1] - v[0]) < DRAG_PX) return {rod: rod(), option: "--click", at: [to[0], to[1]]};
  return {rod: rod(), option: "--box", at: [u[0], v[0], u[1] + 1, v[1] + 1]};
}

function quoted(text) {
  return /^[\w.:,/-]+$/.test(text) ? text : "'" + text.replaceAll("'", "'\\''") + "'";
}

function outline({at}) {
  context.lineWidth = 1;
  context.strokeStyle = "#ffffff";
  if (at.length === 2) context.strokeRect(at[0] - 5.5, at[1] - 5.5, 12, 12);
  else context.strokeRect(at[0], at[1], at[2] - at[0], at[3] - at[1]);
}

function draw() {
  context.drawImage(image, 0, 0);
  marks.forEach(outline);
  if (start && now) outline(mark(start, now));
  const options = marks.map(({rod, option, at}) => `${option} ${quoted(rod + ":" + at.join(","))}`);
  document.getElementById("command").textContent = [task.command, ...options, ...(options.length ? ["--save"] : [])].join(" ");
}

picture.addEventListener("pointerdown", (event) => {
  picture.setPointerCapture(event.pointerId);
  start = now = pixel(event);
});
picture.addEventListener("pointermove", (event) => {
  now = pixel(event);
  document.getElementById("place").textContent = `u ${now[0]}, v ${now[1]}`;
  draw();
});
picture.addEventListener("pointerup", (event) => {
  if (start) marks.push(mark(start, pixel(event)));
  start = null;
  draw();
});
document.getElementById("undo").addEventListener("click", () => {
  marks.pop();
  draw();
});
