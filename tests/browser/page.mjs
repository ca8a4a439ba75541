// What the tests of the viewer's page share: their list, what they look at, and a photo to fit.

import path from "node:path";

export const [address, modules, chromium, work, ...wanted] = process.argv.slice(2);
export const slow = 120000;  // milliseconds, for a machine that is busy

export const tests = [];
export function test(name, body, options = {}) {
  tests.push({ name, body, options });
}

// ---- what a test looks at ----

export const shown = (page) =>
  page.evaluate(() => ({ ...window.stymo.shown, latencies: undefined }));
export const version = (page) => page.evaluate(() => window.stymo.stateVersion());

export async function settled(page) {
  await page.waitForFunction(() => {
    const { shown, stateVersion } = window.stymo ?? {};
    return shown && shown.quality === "still" && shown.version === stateVersion();
  }, null, { timeout: slow });
}

// Mean colour of a part of the picture, and all of its pixels in a small copy.
export async function pixels(page, side = 32) {
  return page.evaluate((size) => {
    const canvas = document.createElement("canvas");
    canvas.width = canvas.height = size;
    const context = canvas.getContext("2d");
    context.drawImage(document.getElementById("picture"), 0, 0, size, size);
    return [...context.getImageData(0, 0, size, size).data];
  }, side);
}

export function difference(a, b) {
  return a.reduce((sum, value, i) => sum + Math.abs(value - b[i]), 0) / a.length;
}

export async function drag(page, x, y, steps = 12) {
  const box = await page.locator("#frame").boundingBox();
  const [cx, cy] = [box.x + box.width / 2, box.y + box.height / 2];
  await page.mouse.move(cx, cy);
  await page.mouse.down();
  for (let i = 1; i <= steps; ++i) await page.mouse.move(cx + x * i / steps, cy + y * i / steps);
  await page.mouse.up();
}

// Waits for the n-th job of this page to end, and returns how it did.
export async function jobEnds(page, count = 1) {
  await page.waitForFunction((n) => window.stymo.job.ended >= n, count, { timeout: slow });
  return page.evaluate(() => ({ ...window.stymo.job }));
}

export const faceCount = (page) => page.locator(".face").count();

// ---- a photo, and how it is fitted ----

export async function photoOfAFace(page) {
  await page.locator(".face").nth(4).getByRole("button", { name: "Show" }).click();
  await page.evaluate(() => {
    window.stymo.state.camera.distance = 1.5;
  });
  const [download] = await Promise.all([
    page.waitForEvent("download"), page.click("#snapshot")]);
  const file = path.join(work, "photo.jpg");
  await download.saveAs(file);
  await page.click("#reset");
  return file;
}

export async function tuneFor(page, seconds) {
  await page.evaluate((value) => {
    document.getElementById("tune").append(new Option("", value));
  }, String(seconds));
  await page.selectOption("#tune", String(seconds));
}
