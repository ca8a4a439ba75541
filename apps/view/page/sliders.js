// The sliders: standard deviations along the leading directions of each group of the codes.

import { change, onChange, state } from "./state.js";

const place = document.getElementById("sliders");
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
      Object.assign(input, { type: "range", min: -3, max: 3, step: 0.05, value: 0 });
      input.setAttribute("aria-label", `${label}, direction ${index + 1}`);
      input.title = `direction ${index + 1}: ${Math.round(100 * share)} % of what varies`;
      input.oninput = () => take(group);
      input.ondblclick = () => { input.value = 0; take(group); };
      set.querySelector(".rows").append(input);
      return input;
    }));
    place.append(set);
  }
  if (!inputs.size) place.textContent = "This model has no statistics of codes.";
  onChange(reflect);
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
