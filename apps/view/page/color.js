// Recolouring: pick a colour, then a place on the face.

import { ask } from "./api.js";
import { watchJob } from "./job.js";
import { say } from "./message.js";
import { state } from "./state.js";

const frame = document.getElementById("frame");
const button = document.getElementById("pick");
let picking = false;

export function isPicking() {
  return picking;
}

export function setPicking(on) {
  picking = on;
  button.setAttribute("aria-pressed", String(on));
  frame.classList.toggle("picking", on);
  if (on) frame.focus();
}

async function recolor(x, y) {
  setPicking(false);
  const digits = document.getElementById("color").value;
  const color = [1, 3, 5].map((at) => parseInt(digits.slice(at, at + 2), 16) / 255);
  try {
    await ask("color", { face: state.face, sliders: state.sliders,
      camera: state.eye ?? state.camera, x, y, color });
  } catch (error) {
    return say(error.message);
  }
  await watchJob(false);
}

export function enableColor() {
  button.onclick = () => setPicking(!picking);
  frame.addEventListener("click", (event) => {
    if (!picking) return;
    const box = frame.getBoundingClientRect();
    recolor((event.clientX - box.left) / box.width, (event.clientY - box.top) / box.height);
  });
  frame.addEventListener("keydown", (event) => {
    if (picking && event.key === "Enter") recolor(0.5, 0.5);
  });
}
