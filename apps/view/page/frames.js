// Pulls frames: the next one is asked for when the last one has arrived. While something changes
// they are quick ones; when nothing does any more, an exact one follows.

import { post } from "./api.js";
import { onChange, state, stateVersion } from "./state.js";

const picture = document.getElementById("picture");
const context = picture.getContext("2d", { alpha: false });
const told = document.getElementById("told");

const stillAfter = 150;  // milliseconds without a change
let busy = false;
let shownVersion = -1;   // of the state that the picture shows
let shownStill = false;
let stillAbort = null;
let stillTimer = 0;
let refresh = false;     // the face changes although the state does not
let lastError = 0;
let movingPsnr = null;

// What tests and the line below the picture look at.
export const shown = { version: -1, quality: "", yaw: 0, frames: 0, latencies: [] };

export function request(quality) {
  const camera = state.eye ?? state.camera;
  return JSON.stringify({
    face: state.face, sliders: state.sliders, expression: state.expression, camera,
    layer: state.layer, quality });
}

export function refreshSoon() {
  refresh = true;
  pull();
}

async function show(response, version, quality, yaw, since = 0) {
  if (response.status === 204) {  // a newer one was asked for
    if (quality === "still") stillTimer = setTimeout(still, stillAfter);
    return;
  }
  const facts = JSON.parse(response.headers.get("X-Stymo-Frame"));
  const image = await createImageBitmap(await response.blob());
  if (version < shownVersion) return;
  // Enlarged here, because the browser's own scaling of a canvas shows its pixels.
  const side = Math.max(image.width, Math.round(picture.clientWidth * devicePixelRatio));
  if (picture.width !== side) picture.width = picture.height = side;
  context.imageSmoothingQuality = "high";
  context.drawImage(image, 0, 0, side, side);
  image.close();
  shownVersion = version;
  shownStill = quality === "still";
  Object.assign(shown, { version, quality, yaw, side: facts.side, frames: shown.frames + 1 });
  movingPsnr = facts.psnr ?? null;
  tell(facts, quality, since);
}

const times = [];
function tell(facts, quality, since) {
  const now = performance.now();
  times.push(now);
  while (times.length > 30 || (times.length && now - times[0] > 2000)) times.shift();
  const rate = times.length > 2 ? (times.length - 1) * 1000 / (now - times[0]) : 0;
  const parts = [`${facts.milliseconds.toFixed(0)} ms`, `${facts.mode}, ${facts.side} pixels`];
  if (quality === "moving") {
    if (rate > 1) parts.unshift(`${rate.toFixed(0)} frames/s`);
    if (since) {
      shown.latencies.push(now - since);
      if (shown.latencies.length > 500) shown.latencies.shift();
    }
  }
  if (movingPsnr !== null) parts.push(`moving: ${movingPsnr.toFixed(1)} dB from this one`);
  told.textContent = parts.join(" · ");
}

async function pull() {
  clearTimeout(stillTimer);
  if (!state.face) return;
  if (stillAbort) stillAbort.abort();
  if (busy) return;
  busy = true;
  let asked = shownVersion;
  let showing = Promise.resolve();
  while (asked !== stateVersion() || refresh) {
    refresh = false;
    const version = asked = stateVersion();
    const yaw = state.camera.yaw;
    const since = lastChange;
    try {
      const response = await post("frame", request("moving"));
      // While this one is decoded and drawn, the next one is rendered.
      await showing;
      showing = show(response, version, "moving", yaw, since);
      lastError = 0;
    } catch (error) {
      if (error.status === 410) return ended(error);
      told.textContent = error.message;
      lastError += 1;
      if (lastError > 3) break;
      asked = -1;
      await new Promise((done) => setTimeout(done, 300 * lastError));
    }
  }
  await showing.catch(ended);
  busy = false;
  stillTimer = setTimeout(still, stillAfter);
}

async function still() {
  if (busy || shownStill && shownVersion === stateVersion()) return;
  const version = stateVersion();
  stillAbort = new AbortController();
  try {
    const response = await post("frame", request("still"), { signal: stillAbort.signal });
    // A picture of what is not shown any more is thrown away.
    if (version === stateVersion() && !busy)
      await show(response, version, "still", state.camera.yaw);
  } catch (error) {
    if (error.status === 410) ended(error);
    else if (error.name !== "AbortError") told.textContent = error.message;
  }
  stillAbort = null;
}

// The program has been started anew, or the page was idle for long: the address has what is shown.
function ended(error) {
  told.textContent = error.message;
  if (error.status === 410) location.reload();
}

addEventListener("resize", refreshSoon);

let lastChange = 0;
onChange(() => {
  lastChange = performance.now();
  pull();
});
