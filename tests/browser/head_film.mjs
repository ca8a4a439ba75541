// A film of a head before a camera, as Chromium's fake camera plays it: JPEG after JPEG. The head
// is one that the viewer renders; it stays on the left for a while, then on the right.

import fs from "node:fs";

const width = 640, height = 480;
const headSide = 420;  // pixels of the picture of the head
const shift = 160;     // pixels between the two places
const framesAtEach = 60;

export async function headFilm(browser, address, film, facts) {
  const page = await browser.newPage();
  await page.goto(address);
  const frames = await page.evaluate(async ({ width, height, headSide, shift }) => {
    const session = await (await fetch("/api/session", { method: "POST" })).json();
    const post = (path, body) => fetch("/api/" + path, {
      method: "POST", headers: { "X-Stymo-Session": session.session }, body });
    const picture = await post("frame", JSON.stringify({
      face: session.faces[4].face, quality: "still", camera: { distance: 1.4 } }));
    const head = await createImageBitmap(await picture.blob());
    const canvas = document.createElement("canvas");
    [canvas.width, canvas.height] = [width, height];
    const context = canvas.getContext("2d");
    const frames = [];
    for (const side of [-1, 1]) {
      context.fillStyle = "#000";
      context.fillRect(0, 0, width, height);
      context.drawImage(head, (width - headSide + side * shift) / 2, (height - headSide) / 2,
        headSide, headSide);
      frames.push(canvas.toDataURL("image/jpeg", 0.9).split(",")[1]);
    }
    await post("close", "");
    return frames;
  }, { width, height, headSide, shift });
  await page.close();
  const parts = frames.flatMap((frame) => Array(framesAtEach).fill(Buffer.from(frame, "base64")));
  fs.writeFileSync(film, Buffer.concat(parts));
  fs.writeFileSync(facts, JSON.stringify({ width, height, shift }));
}
