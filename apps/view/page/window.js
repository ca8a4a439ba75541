// What follows the viewer before the camera: the screen as a window, where the face is rendered for
// the position of the eyes, and the face, which does as the viewer's own.

import { post } from "./api.js";
import { say } from "./message.js";
import { change, resetView, state } from "./state.js";

const frame = document.getElementById("frame");
const video = document.getElementById("camera");
const button = document.getElementById("window");
const mouseButton = document.getElementById("mouse");
const faceButton = document.getElementById("own");
const line = document.getElementById("eyes");
const sightLine = document.getElementById("sight");
const canvas = document.createElement("canvas");

export const head = { following: false, measured: null, eye: null, lag: 0, milliseconds: 0,
  seen: 0 };
let stream = null;
let current = null;  // the attempt to open the camera, and then to follow, that counts

const metres = (id) => Number(document.getElementById(id).value) / 100;

function settings() {
  const radians = Number(document.getElementById("fov").value) * Math.PI / 180;
  return new URLSearchParams({ fov: radians, y: metres("above") });
}

function lookFrom(eye) {
  change({ eye: { eye, screen: metres("screen") } });
}

export const followHead = () => follow(button, followEyes);
export const followFace = () => follow(faceButton, followExpression);

// `see` handles one image of the camera after the other.
async function follow(pressed, see) {
  const again = current?.pressed === pressed;
  stopFollowing();
  if (again) return undefined;
  const attempt = current = { pressed, begun: false, next: null, wait: 0 };
  try {
    if (!navigator.mediaDevices) throw new Error("browsers give it to this machine's pages only");
    const opened = await navigator.mediaDevices.getUserMedia(
      { video: { width: 640, height: 480 } });
    if (current !== attempt) return stopTracks(opened);
    stream = opened;
    video.srcObject = stream;
    await video.play();
  } catch (error) {
    if (current === attempt) stopFollowing();
    return say("There is no camera to be had: " + error.message);
  }
  if (current !== attempt) return undefined;
  head.following = true;
  pressed.setAttribute("aria-pressed", "true");
  try {
    while (current === attempt) await see(attempt);
  } catch (error) {
    say(error.message);
    if (current === attempt) stopFollowing();
  }
  return undefined;
}

function stopTracks(opened) {
  for (const track of opened?.getTracks() ?? []) track.stop();
}

async function imageOfCamera(width, mirrored) {
  canvas.width = width;
  canvas.height = Math.round(width * video.videoHeight / video.videoWidth) || 3 * width / 4;
  const context = canvas.getContext("2d");
  if (mirrored) context.setTransform(-1, 0, 0, 1, width, 0);
  context.drawImage(video, 0, 0, canvas.width, canvas.height);
  const taken = performance.now();
  return { taken, image: await new Promise((done) => canvas.toBlob(done, "image/jpeg", 0.8)) };
}

// What the program sees in the camera's image; nothing without a face, or if it came too late.
// The next image is made while the program looks at this one, so that neither waits.
async function seen(attempt, path, width, line, mirrored = false) {
  const { taken, image } = await (attempt.next ?? imageOfCamera(width, mirrored));
  const posted = performance.now();
  const answer = post(path, image);
  attempt.next = new Promise((done) => setTimeout(done, 0.7 * attempt.wait))
    .then(() => imageOfCamera(width, mirrored));
  const sight = await (await answer).json();
  if (current !== attempt) return null;
  attempt.wait = performance.now() - posted;
  head.milliseconds = performance.now() - taken;
  if (sight.found) return sight;
  line.textContent = "No face is seen.";
  await new Promise((done) => setTimeout(done, 100));
  return null;
}

async function followEyes(attempt) {
  const sight = await seen(attempt, "eyes?" + settings(), 320, line);
  if (!sight) return;
  Object.assign(head, { measured: sight.measured, eye: sight.eye, lag: sight.lag });
  const [x, y, z] = sight.eye.map((value) => (100 * value).toFixed(0));
  line.textContent = `Eyes at ${x}, ${y}, ${z} cm · ` +
    `found in ${head.milliseconds.toFixed(0)} ms · filter behind by ${sight.lag.toFixed(0)} ms`;
  lookFrom(sight.eye);
}

async function followExpression(attempt) {
  const path = attempt.begun ? "expression" : "expression?anew=1";
  const sight = await seen(attempt, path, 480, sightLine, true);
  if (!sight) return;
  attempt.begun = true;
  head.seen += 1;
  sightLine.textContent = `Seen in ${head.milliseconds.toFixed(0)} ms`;
  const { yaw, pitch, roll } = sight;
  change({ expression: sight.expression, camera: { ...state.camera, yaw, pitch, roll } });
}

export function stopFollowing() {
  const was = head.following || mouseButton.getAttribute("aria-pressed") === "true";
  const wasFace = faceButton.getAttribute("aria-pressed") === "true";
  head.following = false;
  current = null;
  stopTracks(stream);
  stream = null;
  video.srcObject = null;
  for (const pressed of [button, mouseButton, faceButton])
    pressed.setAttribute("aria-pressed", "false");
  frame.onpointermove = null;
  line.textContent = sightLine.textContent = "";
  if (was) change({ eye: null, expression: [] });
  if (wasFace) resetView();
}

// The mouse over the picture moves the eyes in a plane half a metre before the screen.
function followMouse() {
  if (mouseButton.getAttribute("aria-pressed") === "true") return stopFollowing();
  stopFollowing();
  mouseButton.setAttribute("aria-pressed", "true");
  frame.onpointermove = (event) => {
    const box = frame.getBoundingClientRect();
    const x = (event.clientX - box.left) / box.width - 0.5;
    const y = (event.clientY - box.top) / box.height - 0.5;
    lookFrom([0.5 * x, -0.5 * y, 0.5]);
  };
  lookFrom([0, 0, 0.5]);
}

export function windowIsOn() {
  return head.following || mouseButton.getAttribute("aria-pressed") === "true";
}

button.onclick = followHead;
faceButton.onclick = followFace;
mouseButton.onclick = followMouse;
