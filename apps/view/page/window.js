// The screen as a window: the face is rendered for the position of the viewer's eyes.

import { post } from "./api.js";
import { say } from "./message.js";
import { change } from "./state.js";

const frame = document.getElementById("frame");
const video = document.getElementById("camera");
const button = document.getElementById("window");
const mouseButton = document.getElementById("mouse");
const line = document.getElementById("eyes");
const canvas = document.createElement("canvas");
const width = 320;  // of the images that are sent

export const head = { following: false, measured: null, eye: null, lag: 0, milliseconds: 0 };
let stream = null;
let starting = null;  // the attempt to open the camera that counts

const metres = (id) => Number(document.getElementById(id).value) / 100;

function settings() {
  const radians = Number(document.getElementById("fov").value) * Math.PI / 180;
  return new URLSearchParams({ fov: radians, y: metres("above") });
}

function lookFrom(eye) {
  change({ eye: { eye, screen: metres("screen") } });
}

export async function followHead() {
  if (head.following || starting) return stopFollowing();
  stopFollowing();
  const attempt = starting = Symbol("attempt");
  try {
    if (!navigator.mediaDevices) throw new Error("browsers give it to this machine's pages only");
    const opened = await navigator.mediaDevices.getUserMedia(
      { video: { width: 640, height: 480 } });
    if (starting !== attempt) return stopTracks(opened);
    stream = opened;
    video.srcObject = stream;
    await video.play();
  } catch (error) {
    if (starting === attempt) stopFollowing();
    return say("There is no camera to be had: " + error.message);
  }
  if (starting !== attempt) return undefined;
  starting = null;
  head.following = true;
  button.setAttribute("aria-pressed", "true");
  while (head.following) await followOnce();
  return undefined;
}

function stopTracks(opened) {
  for (const track of opened?.getTracks() ?? []) track.stop();
}

async function followOnce() {
  canvas.width = width;
  canvas.height = Math.round(width * video.videoHeight / video.videoWidth) || 240;
  canvas.getContext("2d").drawImage(video, 0, 0, canvas.width, canvas.height);
  const taken = performance.now();
  const image = await new Promise((done) => canvas.toBlob(done, "image/jpeg", 0.8));
  try {
    const sight = await (await post("eyes?" + settings(), image)).json();
    if (!head.following) return;
    if (!sight.found) {
      line.textContent = "No face is seen.";
      await new Promise((done) => setTimeout(done, 100));
      return;
    }
    const total = performance.now() - taken;
    Object.assign(head, { measured: sight.measured, eye: sight.eye, lag: sight.lag,
      milliseconds: total });
    const [x, y, z] = sight.eye.map((value) => (100 * value).toFixed(0));
    line.textContent = `Eyes at ${x}, ${y}, ${z} cm · found in ${total.toFixed(0)} ms · ` +
      `filter behind by ${sight.lag.toFixed(0)} ms`;
    lookFrom(sight.eye);
  } catch (error) {
    say(error.message);
    stopFollowing();
  }
}

export function stopFollowing() {
  const was = head.following || mouseButton.getAttribute("aria-pressed") === "true";
  head.following = false;
  starting = null;
  stopTracks(stream);
  stream = null;
  video.srcObject = null;
  button.setAttribute("aria-pressed", "false");
  mouseButton.setAttribute("aria-pressed", "false");
  frame.onpointermove = null;
  line.textContent = "";
  if (was) change({ eye: null });
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
mouseButton.onclick = followMouse;
