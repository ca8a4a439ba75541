// The strip of faces: showing, mixing, drawing, fitting a photo, opening files.

import { ask, post } from "./api.js";
import { paintCover } from "./cover.js";
import { endJob, watchJob } from "./job.js";
import { say } from "./message.js";
import { cameraFor, change, state } from "./state.js";

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
  change({ face: id, codes: face.codes, sliders, camera: cameraFor(face.distance) });
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
  for (const gone of cards.values()) {
    URL.revokeObjectURL(gone.querySelector("img").src);
    gone.remove();
  }
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

const isCodes = (file) => /\.json$/i.test(file.name);
const isWeights = (file) => /\.safetensors$/i.test(file.name);

/// Codes, tuned weights, or both of a face.
export async function openFiles(files) {
  const weights = files.find(isWeights);
  const codes = files.find(isCodes);
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

let asked = null;  // {file, cover}: the photo that the program has taken to fit
let last = null;   // the last of these with a face in it, for Covered and Face
const covered = document.getElementById("covered");
const which = document.getElementById("which");
const number = which.querySelector("select");

/// Offers the faces of the photo that is fitted; none before they are found. A file without a face,
/// or that is no image, fails before, so the last photo stays.
export function offerFaces(count) {
  if (!count || asked === last) return;
  if (asked.file !== last?.file) nameFaces(count);
  last = asked;
  covered.disabled = false;
}

function nameFaces(count) {
  const names = Array.from({ length: count }, (_, i) => `${i + 1} from the left`);
  number.replaceChildren(...["largest", ...names].map((name, i) => new Option(name, i)));
  which.hidden = count < 2;
}

number.onchange = () => endJob().then(() => fitPhoto(last.file, last.cover));

/// `cover`: a PNG mask that is white where something covers the face.
export async function fitPhoto(file, cover = null) {
  if (!file) return;
  document.getElementById("welcome").hidden = true;
  const query = new URLSearchParams({ tune: document.getElementById("tune").value });
  if (file === last?.file && !which.hidden) query.set("face", number.value);
  if (cover) query.set("cover", cover.size);
  try {
    await post("photo?" + query, cover ? new Blob([file, cover]) : file);
  } catch (error) {
    say(error.message);
    return;
  }
  asked = { file, cover };
  await watchJob(true);
}

export async function fitCovered() {
  const { file } = last;
  try {
    const cover = await paintCover(file);
    if (!cover) return;
    await endJob();
    await fitPhoto(file, cover);
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
    if (files.some((file) => isCodes(file) || isWeights(file))) openFiles(files);
    else fitPhoto(files[0]);
  });
}
