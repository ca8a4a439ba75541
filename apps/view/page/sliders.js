// The sliders: standard deviations along the leading directions of each group of the codes.

import { ask } from "./api.js";
import { thumbnail } from "./faces.js";
import { change, onChange, state } from "./state.js";

const panel = document.getElementById("sliders");
const inputs = new Map();  // group -> inputs

export function makeSliders(groups) {
  for (const { group, label, shares } of groups) {
    if (!shares.length) continue;
    const set = document.createElement("div");
    set.className = "group";
    set.role = "group";
    set.setAttribute("aria-label", label);
    set.innerHTML = `<div class="head"><span>${label}</span></div><div class="rows"></div>`;
    const reset = document.createElement("button");
    reset.type = "button";
    reset.textContent = "Reset";
    reset.onclick = () => setAmounts(group, []);
    set.querySelector(".head").append(reset);
    inputs.set(group, shares.map((share, index) => {
      const input = document.createElement("input");
      Object.assign(input, { type: "range", min: -most, max: most, step: 0.05, value: 0 });
      input.dataset.share = `${Math.round(100 * share)} % of what varies`;
      input.oninput = () => take(group);
      input.ondblclick = () => { input.value = 0; take(group); };
      const row = document.createElement("label");
      row.innerHTML = '<span class="names"><span></span><span></span></span>';
      row.prepend(input);
      row.onpointerenter = () => showEndsSoon(group, index);
      row.onpointerleave = hideEnds;
      row.addEventListener("focusin", () => showEndsSoon(group, index));
      row.addEventListener("focusout", hideEnds);
      set.querySelector(".rows").append(row);
      name(input, label, index);
      return input;
    }));
    panel.append(set);
  }
  if (!inputs.size) panel.textContent = "This model has no statistics of codes.";
  onChange(reflect);
}

// ---- what the sliders do ----

const most = 3;
const ends = document.getElementById("ends");
let endsTimer = 0;

function name(input, label, index, [more, less] = ["", ""]) {
  const known = more ? `${less} to ${more}` : `direction ${index + 1}`;
  input.setAttribute("aria-label", `${label}: ${known}`);
  input.title = `${known}: ${input.dataset.share}`;
  const [left, right] = input.nextSibling.children;
  [left.textContent, right.textContent] = more ? [less, more] : [known, ""];
}

/// Measuring takes the program some seconds, once.
export async function nameSliders(groups) {
  let names;
  while (!names) {
    await new Promise((done) => setTimeout(done, 1000));
    ({ names } = await ask("names"));
  }
  for (const { group, label } of groups)
    (inputs.get(group) ?? []).forEach((input, i) => name(input, label, i, names[group][i]));
}

function hideEnds() {
  clearTimeout(endsTimer);
  endsTimer = 0;
  ends.hidden = true;
}

function showEndsSoon(group, index) {
  hideEnds();
  endsTimer = setTimeout(() => showEnds(group, index).catch(() => {}), 200);
}

// The shown face at both ends of a slider.
async function showEnds(group, index) {
  const input = inputs.get(group)[index];
  const timer = endsTimer;
  const captions = [...input.nextSibling.children].map((item) => item.textContent);
  const pictures = [];
  for (const amount of [-most, most]) {
    if (timer !== endsTimer) break;
    const amounts = inputs.get(group).map((other) => Number(other.value));
    amounts[index] = amount;
    pictures.push(await thumbnail(state.face, { ...state.sliders, [group]: amounts }));
  }
  if (timer !== endsTimer) return pictures.forEach((url) => URL.revokeObjectURL(url));
  [...ends.children].forEach((figure, i) => {
    const [image, caption] = figure.children;
    if (image.src) URL.revokeObjectURL(image.src);
    image.src = pictures[i] ?? "";
    caption.textContent = captions[i];
  });
  input.closest(".group").append(ends);
  ends.hidden = false;
}

function take(group) {
  setAmounts(group, inputs.get(group).map((input) => Number(input.value)));
}

export function setAmounts(group, amounts) {
  change({ sliders: { ...state.sliders, [group]: amounts } });
}

function reflect() {
  for (const [group, list] of inputs) {
    const amounts = state.sliders[group] ?? [];
    list.forEach((input, index) => {
      const value = String(amounts[index] ?? 0);
      if (Number(input.value) !== Number(value)) input.value = value;
    });
  }
}
