// A camera path: views that are remembered, played, and saved as a film.

import { ask } from "./api.js";
import { watchJob } from "./job.js";
import { say } from "./message.js";
import { change, clamp, state } from "./state.js";

const list = document.getElementById("keys");
const seconds = document.getElementById("seconds");
const keys = [];
let playing = 0;

export function addKey() {
  keys.push({ ...state.camera });
  drawKeys();
}

function drawKeys() {
  list.replaceChildren(...keys.map((key, index) => {
    const button = document.createElement("button");
    button.type = "button";
    button.textContent = `${index + 1}: ${key.yaw.toFixed(0)}°, ${key.pitch.toFixed(0)}°`;
    button.onclick = () => change({ camera: { ...key } });
    return button;
  }));
}

// As the program does for films (Catmull and Rom 1974).
function along(name, part) {
  const position = part * (keys.length - 1);
  const first = Math.min(Math.floor(position), Math.max(keys.length - 2, 0));
  const t = position - first;
  const at = (i) => keys[Math.min(Math.max(i, 0), keys.length - 1)][name];
  const [a, b, c, d] = [at(first - 1), at(first), at(first + 1), at(first + 2)];
  const value =
    b + 0.5 * t * (c - a + t * (2 * a - 5 * b + 4 * c - d + t * (3 * (b - c) + d - a)));
  const all = keys.map((key) => key[name]);
  return Math.min(Math.max(value, Math.min(...all)), Math.max(...all));
}

// Within the limits of the field, which the program accepts. The field shows what is taken.
function chosenSeconds() {
  const chosen = clamp(Number(seconds.value), Number(seconds.min), Number(seconds.max));
  seconds.value = chosen;
  return chosen;
}

export function play() {
  if (keys.length < 2) return say("Add two views or more.");
  stopPlaying();
  const start = performance.now();
  const duration = 1000 * chosenSeconds();
  const step = (now) => {
    const part = Math.min((now - start) / duration, 1);
    const names = ["yaw", "pitch", "roll", "distance"];
    change({ camera: Object.fromEntries(names.map((name) => [name, along(name, part)])) });
    playing = part < 1 ? requestAnimationFrame(step) : 0;
  };
  playing = requestAnimationFrame(step);
}

export function stopPlaying() {
  cancelAnimationFrame(playing);
}

async function saveFilm(format) {
  if (keys.length < 2) return say("Add two views or more.");
  try {
    await ask("film", { face: state.face, sliders: state.sliders, keys, format,
      seconds: chosenSeconds(), fps: format === "mp4" ? 30 : 20 });
  } catch (error) {
    return say(error.message);
  }
  await watchJob(false);
}

document.getElementById("key").onclick = addKey;
document.getElementById("play").onclick = play;
document.getElementById("clear").onclick = () => { stopPlaying(); keys.length = 0; drawKeys(); };
for (const format of ["gif", "webp", "mp4"])
  document.getElementById(format).onclick = () => saveFilm(format);
