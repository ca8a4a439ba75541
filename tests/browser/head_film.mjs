// Films of a head before a camera, as Chromium's fake camera plays them: JPEG after JPEG. The head
// is one that the viewer renders.

import fs from "node:fs";

export const [width, height] = [640, 480];
const headSide = 420;  // pixels of the picture of the head

/// Of the film of a head that is on the left for a while, then on the right, `shift` pixels away.
export const shift = 160;
export const places = [{ x: -shift / 2, frames: 60 }, { x: shift / 2, frames: 60 }];

/// Of the film of a head at rest that turns to both sides and then does something with its face.
/// The places' own camera and sliders are those of the request for a frame.
export const acts = [
  { frames: 90 }, { yaw: 20, frames: 45 }, { yaw: -20, frames: 45 },
  { sliders: { expr: [3, 0, 0] }, frames: 45 }, { sliders: { expr: [-3, 0, 0] }, frames: 45 }];

export async function headFilm(browser, address, film, scenes) {
  const page = await browser.newPage();
  await page.goto(address);
  const frames = await page.evaluate(async ({ width, height, headSide, scenes }) => {
    const session = await (await fetch("/api/session", { method: "POST" })).json();
    const post = (path, body) => fetch("/api/" + path, {
      method: "POST", headers: { "X-Stymo-Session": session.session }, body });
    const canvas = document.createElement("canvas");
    [canvas.width, canvas.height] = [width, height];
    const context = canvas.getContext("2d");
    const frames = [];
    for (const { x = 0, yaw = 0, sliders = {} } of scenes) {
      const picture = await post("frame", JSON.stringify({
        face: session.faces[4].face, quality: "still", sliders, camera: { yaw, distance: 1.4 } }));
      const head = await createImageBitmap(await picture.blob());
      context.fillStyle = "#000";
      context.fillRect(0, 0, width, height);
      context.drawImage(head, (width - headSide) / 2 + x, (height - headSide) / 2, headSide,
        headSide);
      frames.push(canvas.toDataURL("image/jpeg", 0.9).split(",")[1]);
    }
    await post("close", "");
    return frames;
  }, { width, height, headSide, scenes });
  await page.close();
  const parts = frames.flatMap((frame, i) =>
    Array(scenes[i].frames).fill(Buffer.from(frame, "base64")));
  fs.writeFileSync(film, Buffer.concat(parts));
}
