// The strip of faces: showing, mixing, drawing, fitting a photo, opening files.

import { ask, post } from "./api.js";
import { paintCover } from "./cover.js";
import { endJob, watchJob } from "./job.js";
import { say } from "./message.js";
import { change, state } from "./state.js";

const strip = document.getElementById("faces");
const groupsBar = document.getElementById("groups");
let faces = [];

export function chosenGroups() {
  return [...groupsBar.querySelectorAll("input:checked")].map((box) => box.value);
}

export function makeGroups(groups) {
  groupsBar.append("Mix:");
  for (const { group, label } of groups) {
    const box = document.createElement("label");
    box.innerHTML = `<input type="checkbox" value="${group}"> ${label}`;
    box.firstChild.checked = group === "expr" || group === "tex";
    groupsBar.append(box);
  }
}

export function faceOf(id) {
  return faces.find((face) => face.face === id);
}

export function showFace(id, sliders = {}) {
  const face = faceOf(id);
  if (!face) return;
  document.getElementById("tuned").hidden = !face.tuned;
  change({ face: id, codes: face.codes, sliders });
  mark();
}

function mark() {
  for (const card of strip.children) {
    const isShown = card.dataset.face === state.face;
    card.classList.toggle("shown", isShown);
    card.querySelector(".show").setAttribute("aria-current", String(isShown));
  }
}

/// Shows the faces of the session.
export function setFaces(answer) {
  faces = answer.faces;
  const cards = new Map([...strip.children].map((card) => [card.dataset.face, card]));
  for (const face of faces) {
    if (!cards.has(face.face)) strip.append(card(face));
    cards.delete(face.face);
  }
  for (const gone of cards.values()) gone.remove();
  mark();
}

function card(face) {
  const item = document.createElement("div");
  item.className = "face";
  item.role = "listitem";
  item.dataset.face = face.face;
  item.draggable = true;
  item.innerHTML = `<button class="show" type="button"><img alt="" draggable="false"></button>
    <div class="name"></div>
    <div class="acts"><button class="mix" type="button">Mix</button>
    <button class="remove" type="button" aria-label="Remove">×</button></div>`;
  item.querySelector(".name").textContent = face.name;
  item.querySelector(".show").setAttribute("aria-label", "Show " + face.name);
  item.querySelector(".show").onclick = () => showFace(face.face);
  item.querySelector(".mix").onclick = () => mixFrom(face.face);
  item.querySelector(".remove").onclick = () => remove(face.face);
  item.ondragstart = (event) => {
    event.dataTransfer.setData("text/stymo-face", face.face);
    event.dataTransfer.effectAllowed = "copy";
  };
  drawThumbnail(face.face);
  return item;
}

let thumbnails = Promise.resolve();  // one after the other

/// The address of a small picture of a face; null if a newer one was asked for.
export function thumbnail(face, sliders = {}) {
  const made = thumbnails.then(async () => {
    const response = await post("frame", JSON.stringify({ face, sliders, quality: "thumbnail" }));
    return response.status === 204 ? null : URL.createObjectURL(await response.blob());
  });
  thumbnails = made.catch(() => null);
  return made;
}

export async function drawThumbnail(id) {
  try {
    const source = await thumbnail(id);
    const image = strip.querySelector(`[data-face="${id}"] img`);
    if (!source) return;
    if (!image) return URL.revokeObjectURL(source);
    if (image.src) URL.revokeObjectURL(image.src);
    image.src = source;
  } catch (error) {
    say(error.message);
  }
}

export async function addFace(wish, sliders = {}) {
  try {
    const answer = await ask("face", wish);
    setFaces(answer);
    showFace(answer.face, sliders);
    return answer.face;
  } catch (error) {
    say(error.message);
    return null;
  }
}

export function drawNew() {
  return addFace({ seed: Math.floor(Math.random() * 1e9), truncation: 0.7 });
}

export function mixFrom(source) {
  const groups = chosenGroups();
  if (!groups.length) return say("Tick what mixing takes from a face.");
  return addFace({ face: state.face, source, groups, sliders: state.sliders });
}

async function remove(id) {
  if (faces.length < 2) return say("One face must stay.");
  try {
    const query = new URLSearchParams({ face: id });
    const answer = await (await post("remove?" + query)).json();
    setFaces(answer);
    if (state.face === id) showFace(faces[0].face);
  } catch (error) {
    say(error.message);
  }
}

/// Codes, tuned weights, or both of a face.
export async function openFiles(files) {
  const weights = files.find((file) => file.name.endsWith(".safetensors"));
  const codes = files.find((file) => file.name.endsWith(".json"));
  if (codes && !await addFace({ file: await codes.text(), name: codes.name })) return;
  if (!weights) return;
  try {
    const query = new URLSearchParams({ face: state.face });
    await post("weights?" + query, weights);
  } catch (error) {
    say(error.message);
    return;
  }
  await watchJob(false);
}

let lastPhoto = null;
let lastCover = null;  // of lastPhoto, for its other faces
const which = document.getElementById("which");
const number = which.querySelector("select");

/// Offers the faces of the last photo, counted from the left.
export function offerFaces(count) {
  if (!which.hidden || count < 2) return;
  const names = Array.from({ length: count }, (_, i) => `${i + 1} from the left`);
  number.replaceChildren(...["largest", ...names].map((name, i) => new Option(name, i)));
  which.hidden = false;
}

number.onchange = () => endJob().then(() => fitPhoto(lastPhoto, lastCover));

/// `cover`: a PNG mask that is white where something covers the face.
export async function fitPhoto(file, cover = null) {
  if (!file) return;
  document.getElementById("welcome").hidden = true;
  if (file !== lastPhoto) which.hidden = true;
  lastPhoto = file;
  lastCover = cover;
  document.getElementById("covered").disabled = false;
  const query = new URLSearchParams({ tune: document.getElementById("tune").value });
  if (!which.hidden) query.set("face", number.value);
  if (cover) query.set("cover", cover.size);
  try {
    await post("photo?" + query, cover ? new Blob([file, cover]) : file);
  } catch (error) {
    say(error.message);
    return;
  }
  await watchJob(true);
}

export async function fitCovered() {
  try {
    const cover = await paintCover(lastPhoto);
    if (cover) await fitPhoto(lastPhoto, cover);
  } catch (error) {
    say(error.message);
  }
}

export async function refreshFaces() {
  setFaces(await ask("faces"));
}

export function enableDrop() {
  const frame = document.getElementById("frame");
  const drop = document.getElementById("drop");
  addEventListener("dragover", (event) => {
    event.preventDefault();
    drop.hidden = !event.dataTransfer.types.includes("Files");
  });
  addEventListener("dragleave", (event) => { if (!event.relatedTarget) drop.hidden = true; });
  addEventListener("drop", (event) => {
    event.preventDefault();
    drop.hidden = true;
    const face = event.dataTransfer.getData("text/stymo-face");
    if (face) {
      if (frame.contains(event.target)) mixFrom(face);
      return;
    }
    const files = [...event.dataTransfer.files];
    if (files.some((file) => /\.(json|safetensors)$/.test(file.name))) openFiles(files);
    else fitPhoto(files[0]);
  });
}
