// What is shown: the face, the sliders, the camera. It is in the address of the page, so that a
// reload or a shared link shows the same.

// From here the image cuts no hair; the distance is that of the face (usual_distance in
// nn/realtime/view.h).
const front = { yaw: 0, pitch: 0, roll: 0, distance: 1.15 };

export const state = {
  model: "",          // mark of the model, to which the codes belong
  face: "",           // id of the face
  codes: "",          // its codes as digits
  sliders: {},        // group -> amounts
  camera: { ...front },
  layer: "image",
  eye: null,          // {eye: [x, y, z], screen} in metres while the window follows someone
  expression: [],     // what is added to that of the face while someone's own face moves it
};

const listeners = [];
let version = 0;

export function onChange(listener) {
  listeners.push(listener);
}

export function stateVersion() {
  return version;
}

export function change(update) {
  Object.assign(state, update);
  version += 1;
  for (const listener of listeners) listener(state);
  rememberSoon();
}

export function turn(yaw, pitch, distance = 1) {
  if (state.eye) return;  // the window's view is shown, and the camera stays as it was before
  const camera = state.camera;
  change({ camera: {
    ...camera,
    yaw: clamp(camera.yaw + yaw, -90, 90),
    pitch: clamp(camera.pitch + pitch, -60, 60),
    distance: clamp(camera.distance * distance, 0.6, 2.5),
  } });
}

/// The camera for a face with this usual distance, unless the viewer has chosen another one.
export function cameraFor(distance) {
  const isUsual = state.camera.distance === front.distance;
  front.distance = distance;
  return isUsual ? { ...state.camera, distance } : state.camera;
}

export function resetView() {
  change({ camera: { ...front } });
}

export function clamp(value, low, high) {
  return Math.min(Math.max(value, low), high);
}

// ---- the address ----

const digits = (value, places) => Number(value.toFixed(places));
let timer = 0;

function rememberSoon() {
  clearTimeout(timer);
  timer = setTimeout(remember, 250);
}

function remember() {
  const { camera, sliders } = state;
  if (!state.codes) return;
  const parts = new URLSearchParams();
  parts.set("y", digits(camera.yaw, 2));
  parts.set("p", digits(camera.pitch, 2));
  parts.set("d", digits(camera.distance, 3));
  if (state.layer !== "image") parts.set("l", state.layer);
  for (const [group, amounts] of Object.entries(sliders)) {
    if (amounts.some((amount) => amount !== 0)) parts.set("s_" + group, amounts.join("_"));
  }
  parts.set("m", state.model);
  parts.set("codes", state.codes);
  history.replaceState(null, "", location.pathname + location.search + "#" + parts);
}

export function remembered() {
  const parts = new URLSearchParams(location.hash.slice(1));
  if (!parts.get("codes")) return null;
  const number = (name, usual) => {
    const value = Number(parts.get(name) ?? usual);
    return Number.isFinite(value) ? value : usual;
  };
  const sliders = {};
  for (const [name, value] of parts) {
    if (name.startsWith("s_"))
      sliders[name.slice(2)] = value.split("_").map(Number).filter(Number.isFinite);
  }
  return {
    codes: parts.get("codes"),
    model: parts.get("m") ?? state.model,
    sliders,
    layer: parts.get("l") ?? "image",
    camera: {
      yaw: clamp(number("y", 0), -90, 90),
      pitch: clamp(number("p", 0), -60, 60),
      roll: 0,
      distance: clamp(number("d", front.distance), 0.6, 2.5),
    },
  };
}
