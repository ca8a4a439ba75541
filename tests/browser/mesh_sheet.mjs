// A mesh of stymo-export in three.js, as a contact sheet: five sides, and three blend shapes.
// Usage: node mesh_sheet.mjs GLB SHEET MODULES CHROMIUM. Fails if the page has an error or if a
// shape moves nothing.

import fs from "node:fs";
import http from "node:http";
import path from "node:path";
import { createRequire } from "node:module";

const [glb, sheet, folder, executablePath] = process.argv.slice(2);
const modules = path.resolve(folder);
const { chromium } = createRequire(modules + "/")("playwright-core");

const page = `<script type="importmap">{"imports":
  {"three": "/three/build/three.module.js", "three/addons/": "/three/examples/jsm/"}}</script>
<script type="module">
import * as THREE from "three";
import { GLTFLoader } from "three/addons/loaders/GLTFLoader.js";
const side = 256;
const renderer = new THREE.WebGLRenderer({ antialias: true, preserveDrawingBuffer: true });
renderer.setSize(side, side);
const scene = (await new GLTFLoader().loadAsync("/face.glb")).scene;
const box = new THREE.Box3().setFromObject(scene);
const middle = box.getCenter(new THREE.Vector3());
const camera = new THREE.PerspectiveCamera(28, 1, 0.01, 10);
let face;
scene.traverse((object) => { if (object.isMesh) face = object; });
const sheet = document.createElement("canvas");
[sheet.width, sheet.height] = [4 * side, 2 * side];
const context = sheet.getContext("2d", { willReadFrequently: true });
const draw = (cell, yaw, shapes) => {
  face.morphTargetInfluences.fill(0);
  for (const name of shapes) face.morphTargetInfluences[face.morphTargetDictionary[name]] = 1;
  const distance = 2.1 * (box.max.y - box.min.y), angle = yaw * Math.PI / 180;
  camera.position.set(distance * Math.sin(angle), 0, distance * Math.cos(angle)).add(middle);
  camera.lookAt(middle);
  renderer.render(scene, camera);
  const [x, y] = [cell % 4 * side, Math.floor(cell / 4) * side];
  context.drawImage(renderer.domElement, x, y);
  return context.getImageData(x, y, side, side).data;
};
let cell = 0;
const sides = [-60, -30, 0, 30, 60].map((yaw) => draw(cell++, yaw, []));
window.changed = [["eyeBlinkLeft", "eyeBlinkRight"], ["jawOpen"],
  ["mouthSmileLeft", "mouthSmileRight"]].map((shapes) => {
  const pixels = draw(cell++, 0, shapes);
  return pixels.filter((value, i) => Math.abs(value - sides[2][i]) > 16).length / 3;
});
window.sheet = sheet.toDataURL("image/jpeg", 0.9);
</script>`;

const server = http.createServer((request, response) => {
  const isPage = request.url === "/";
  const file = request.url === "/face.glb" ? glb : path.join(modules, request.url);
  response.setHeader("content-type", isPage ? "text/html" : "text/javascript");
  response.end(isPage ? page : fs.existsSync(file) ? fs.readFileSync(file) : "");
}).listen(0, "127.0.0.1");
await new Promise((listening) => server.once("listening", listening));
const browser = await chromium.launch({ executablePath, args: ["--no-sandbox",
  "--use-gl=angle", "--use-angle=swiftshader", "--enable-unsafe-swiftshader"] });
try {
  const view = await browser.newPage();
  const errors = [];
  view.on("pageerror", (error) => errors.push(error.message));
  await view.goto(`http://127.0.0.1:${server.address().port}/`);
  await view.waitForFunction(() => window.sheet, null, { timeout: 120000 })
    .catch((error) => errors.push(error.message));
  if (errors.length > 0) throw new Error(errors.join("; "));
  const changed = await view.evaluate(() => window.changed);
  console.log(JSON.stringify({ "pixels that a shape changes": changed }));
  if (Math.min(...changed) < 50) throw new Error("a blend shape moves nothing");
  const data = await view.evaluate(() => window.sheet);
  fs.writeFileSync(sheet, Buffer.from(data.split(",")[1], "base64"));
} finally {
  await browser.close();
  server.close();
}
