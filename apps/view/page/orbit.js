// Turning and approaching by mouse, touch and keys.

import { resetView, state, turn } from "./state.js";

const frame = document.getElementById("frame");
const degreesAcross = 120;  // for a drag over the whole picture

const pointers = new Map();
let spread = 0;

function distanceOfFingers() {
  const [a, b] = [...pointers.values()];
  return Math.hypot(a.x - b.x, a.y - b.y);
}

export function enableOrbit(isTaken, leaveWindow) {
  frame.addEventListener("pointerdown", (event) => {
    if (isTaken(event)) return;
    frame.setPointerCapture(event.pointerId);
    pointers.set(event.pointerId, { x: event.clientX, y: event.clientY });
    if (pointers.size === 2) spread = distanceOfFingers();
  });
  frame.addEventListener("pointermove", (event) => {
    const last = pointers.get(event.pointerId);
    if (!last) return;
    const [x, y] = [event.clientX, event.clientY];
    pointers.set(event.pointerId, { x, y });
    if (pointers.size === 2) {
      const now = distanceOfFingers();
      if (spread > 0) turn(0, 0, spread / now);
      spread = now;
      return;
    }
    const scale = degreesAcross / frame.clientWidth;
    turn(-(x - last.x) * scale, -(y - last.y) * scale);
  });
  for (const name of ["pointerup", "pointercancel"])
    frame.addEventListener(name, (event) => pointers.delete(event.pointerId));
  frame.addEventListener("wheel", (event) => {
    event.preventDefault();
    turn(0, 0, Math.exp(event.deltaY * 0.001));
  }, { passive: false });
  frame.addEventListener("dblclick", () => { leaveWindow(); resetView(); });
  frame.addEventListener("keydown", (event) => {
    if (event.ctrlKey || event.metaKey || event.altKey) return;
    const step = event.shiftKey ? 10 : 3;
    const moves = {
      ArrowLeft: [step, 0], ArrowRight: [-step, 0], ArrowUp: [0, step], ArrowDown: [0, -step] };
    if (moves[event.key]) turn(...moves[event.key]);
    else if (event.key === "+" || event.key === "=") turn(0, 0, 1 / 1.08);
    else if (event.key === "-") turn(0, 0, 1.08);
    else if (event.key === "0") { leaveWindow(); resetView(); }
    else return;
    event.preventDefault();
  });
}
