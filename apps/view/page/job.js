// Follows what takes seconds: a fit, a change of colour, a film, a mesh, tuned weights.

import { ask, post, save } from "./api.js";
import { drawThumbnail, faceOf, offerFaces, refreshFaces, showFace } from "./faces.js";
import { refreshSoon } from "./frames.js";
import { say } from "./message.js";
import { state } from "./state.js";

const box = document.getElementById("job");
const progress = document.getElementById("progress");
const phase = document.getElementById("phase");

export const job = { state: "none", phase: "", ended: 0 };

export function cancelJob() {
  return ask("cancel").catch((error) => say(error.message));
}

document.getElementById("cancel").onclick = cancelJob;

/// Cancels the job, if one runs, and waits for its end.
export async function endJob() {
  await cancelJob();
  while (!box.hidden) await new Promise((done) => setTimeout(done, 50));
}

/// Until the job ends. `live`: its face changes on the way and is shown.
export async function watchJob(live) {
  box.hidden = false;
  const before = state.face;
  const watched = { face: "", step: -1 };
  try {
    let status;
    do {
      status = await ask("job");
      Object.assign(job, status);
      tell(status);
      offerFaces(status.faces);
      if (live && status.face && status.state === "running") await follow(status, watched);
      await new Promise((done) => setTimeout(done, 120));
    } while (status.state === "running");
    await finish(status, watched.face, before);
  } catch (error) {
    say(error.message);
  } finally {
    box.hidden = true;
    job.ended += 1;
  }
}

function tell(status) {
  phase.textContent = status.phase + (status.total ? ` ${status.done} of ${status.total}` : "");
  if (status.total) progress.value = status.done / status.total;
  else progress.removeAttribute("value");
}

async function follow(status, watched) {
  if (!watched.face) {
    watched.face = status.face;
    await refreshFaces();
    showFace(status.face);
  } else if (status.done !== watched.step && state.face === watched.face) {
    refreshSoon();
  }
  watched.step = status.done;
}

async function finish(status, face, before) {
  if (status.state === "failed") say(status.error);
  else if (status.note) say(status.note);
  await refreshFaces();
  if (status.state === "cancelled") say("Cancelled.");
  if (status.state === "done" && status.face) {
    // Whoever has chosen another face meanwhile keeps it, and so do sliders that were moved.
    if (state.face === status.face) showFace(status.face, state.sliders);
    else if (state.face === face || state.face === before) showFace(status.face);
    drawThumbnail(status.face);
    refreshSoon();
  } else if (face && !faceOf(face)) {
    showFace(document.querySelector(".face").dataset.face);
  }
  if (status.state === "done" && status.artifact) {
    const response = await post("result");
    const name = /filename="([^"]+)"/.exec(response.headers.get("Content-Disposition"))[1];
    save(await response.blob(), name);
    say(name + " is saved.");
  }
}
