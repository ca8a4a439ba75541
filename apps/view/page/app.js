// Starts the page and joins its parts.

import { openSession, post, save } from "./api.js";
import { enableColor, isPicking, setPicking } from "./color.js";
import {
  addFace, drawNew, enableDrop, fitCovered, fitPhoto, makeGroups, openFiles, setFaces, showFace,
} from "./faces.js";
import { request, shown } from "./frames.js";
import { cancelJob, job, watchJob } from "./job.js";
import { say } from "./message.js";
import { enableOrbit } from "./orbit.js";
import { addKey, play, stopPlaying } from "./path.js";
import { makeSliders, nameSliders } from "./sliders.js";
import { change, clamp, remembered, resetView, state, stateVersion } from "./state.js";
import { followFace, followHead, head, stopFollowing, windowIsOn } from "./window.js";

const element = (id) => document.getElementById(id);

async function snapshot() {
  const response = await post("frame", request("snapshot"));
  if (response.status === 204) return;  // a newer one was asked for
  save(await response.blob(), "face.jpg");
}

const shownFace = () => JSON.stringify({ face: state.face, sliders: state.sliders });

async function saveCodes() {
  const response = await post("codes", shownFace());
  const name = /filename="([^"]+)"/.exec(response.headers.get("Content-Disposition"))[1];
  save(await response.blob(), name);
}

async function saveMesh() {
  await post("mesh", shownFace());
  await watchJob(false);
}

async function saveTuned() {
  await post("tuned?" + new URLSearchParams({ face: state.face }));
  await watchJob(false);
}

function guarded(action) {
  return () => Promise.resolve(action()).catch((error) => say(error.message));
}

function keepSliders() {
  return addFace({ face: state.face, sliders: state.sliders });
}

function connectButtons() {
  element("reset").onclick = () => { stopFollowing(); resetView(); };
  element("snapshot").onclick = guarded(snapshot);
  element("codes").onclick = guarded(saveCodes);
  element("tuned").onclick = guarded(saveTuned);
  element("mesh").onclick = guarded(saveMesh);
  element("draw").onclick = drawNew;
  element("photo").onchange = (event) => {
    fitPhoto(event.target.files[0]);
    event.target.value = "";
  };
  element("open").onchange = (event) => {
    openFiles([...event.target.files]);
    event.target.value = "";
  };
  element("covered").onclick = fitCovered;
  element("keep").onclick = keepSliders;
  element("zero").onclick = () => change({ sliders: {} });
  element("layer").onchange = (event) => change({ layer: event.target.value });
}

function connectKeys() {
  const actions = {
    n: drawNew, s: guarded(snapshot), c: () => setPicking(!isPicking()), k: addKey, p: play,
    w: followHead, f: followFace,
    Escape: () => { cancelJob(); stopFollowing(); stopPlaying(); setPicking(false); },
  };
  addEventListener("keydown", (event) => {
    if (document.querySelector("dialog[open]")) return;  // it gets all keys, also Escape
    const typing = event.target.matches("select, input[type=number], input[type=color]") &&
      event.key !== "Escape";
    if (typing || event.repeat || event.ctrlKey || event.metaKey || event.altKey) return;
    actions[event.key.length === 1 ? event.key.toLowerCase() : event.key]?.();
  });
}

function allowedSliders(sliders, groups) {
  return Object.fromEntries(groups.filter(({ group }) => sliders[group]).map(
    ({ group, shares }) =>
      [group, sliders[group].slice(0, shares.length).map((amount) => clamp(amount, -6, 6))]));
}

async function start() {
  element("blocked").remove();
  let opened;
  try {
    opened = await openSession();
  } catch (error) {
    element("told").textContent = error.message;
    return;
  }
  makeGroups(opened.groups);
  makeSliders(opened.groups);
  element("draw").disabled = !opened.draws;
  element("photo").disabled = !opened.fits;
  connectButtons();
  connectKeys();
  enableOrbit((event) => isPicking() || windowIsOn() || event.button !== 0, stopFollowing);
  enableColor();
  enableDrop();
  setFaces(opened);
  state.model = opened.model;
  const before = remembered();
  const isForeign = before && before.model !== opened.model;
  const known = before && opened.faces.find((face) => face.codes === before.codes);
  if (isForeign) {
    showFace(opened.faces[0].face);
    say("The address shows a face of another model.");
  } else if (before) {
    const layers = [...element("layer").options].map((option) => option.value);
    const layer = layers.includes(before.layer) ? before.layer : "image";
    element("layer").value = layer;
    before.sliders = allowedSliders(before.sliders, opened.groups);
    change({ layer, camera: before.camera });
    if (known) showFace(known.face, before.sliders);
    else if (!await addFace({ codes: before.codes, name: "shared" }, before.sliders))
      showFace(opened.faces[0].face);
  } else {
    showFace(opened.faces[0].face);
    element("welcome").hidden = !opened.fits;
  }
  nameSliders(opened.groups).catch(() => {});  // they work without names
  element("frame").focus();
  // For the tests in a browser.
  window.stymo = { state, shown, job, head, stateVersion };
}

start();
