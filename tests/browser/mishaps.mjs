// Tests of what goes wrong or crosses on the viewer's page: files that are refused, several presses
// at once, keys behind a dialog, what is changed while a job runs.

import assert from "node:assert/strict";
import fs from "node:fs";

import {
  difference, drag, faceCount, jobEnds, photoOfAFace, pixels, settled, slow, test, tuneFor,
} from "./page.mjs";

const notes = { name: "notes.txt", mimeType: "text/plain", buffer: Buffer.from("no photo") };
const state = (page) => page.evaluate(() => window.stymo.state);

async function moveFirstSlider(page, amount) {
  await page.locator(".group input").first().evaluate((input, value) => {
    input.value = value;
    input.dispatchEvent(new Event("input"));
  }, amount);
}

async function tuningBegins(page) {
  await page.waitForFunction(() => window.stymo.job.phase === "tuning" ||
    window.stymo.job.ended > 0, null, { timeout: slow });
  assert.equal(await page.evaluate(() => window.stymo.job.phase), "tuning");
}

// Opens the dialog of Covered; returns the proportions of the photo in it.
async function openCovered(page) {
  await page.click("#covered");
  await page.locator("#cover").waitFor();
  return page.evaluate(() => {
    const canvas = document.querySelector("#cover canvas");
    return canvas.width / canvas.height;
  });
}

test("sliders that are moved while a face is tuned stay", async (page) => {
  const file = await photoOfAFace(page);
  await tuneFor(page, 3);
  await page.setInputFiles("#photo", file);
  await tuningBegins(page);
  await moveFirstSlider(page, 2.5);
  const job = await jobEnds(page);
  assert.equal(job.state, "done", job.error);
  const { face, sliders } = await state(page);
  assert.equal(face, job.face);
  assert.equal(sliders.id[0], 2.5);
  assert.ok(await page.locator("#tuned").isVisible());
}, { slow: true });

test("files that are refused are not the last photo", async (page) => {
  await page.setInputFiles("#photo", notes);
  await jobEnds(page);
  assert.equal(await page.textContent("#message"), "the photo: not an image");
  assert.ok(await page.locator("#covered").isDisabled());
  const file = await photoOfAFace(page);
  await tuneFor(page, 600);  // longer than a test waits
  await page.setInputFiles("#photo", file);
  await page.waitForFunction(() => window.stymo.job.phase === "tuning", null, { timeout: slow });
  await page.setInputFiles("#photo", notes);
  await page.getByText("another job is running").waitFor();
  assert.equal(await openCovered(page), 1);
  // The photo is fitted again, in place of the job that runs.
  const count = await faceCount(page);
  await page.evaluate(() => { document.getElementById("tune").value = "0"; });
  const box = await page.locator("#cover canvas").boundingBox();
  await page.mouse.move(box.x + 5, box.y + 5);
  await page.mouse.down();
  await page.mouse.move(box.x + 50, box.y + 5);
  await page.mouse.up();
  await page.getByRole("button", { name: "Fit without it" }).click();
  const job = await jobEnds(page, 3);
  assert.equal(job.state, "done", job.error);
  assert.equal(await faceCount(page), count + 1);
}, { slow: true });

test("while Covered is open, its dialog alone gets the keys", async (page) => {
  const file = await photoOfAFace(page);
  await tuneFor(page, 600);
  await page.setInputFiles("#photo", file);
  await tuningBegins(page);
  const count = await faceCount(page);
  await openCovered(page);
  await page.keyboard.press("n");
  await page.waitForTimeout(500);
  assert.equal(await faceCount(page), count);
  await page.keyboard.press("Escape");
  await page.locator("#cover").waitFor({ state: "hidden" });
  await page.waitForTimeout(500);
  assert.equal(await page.evaluate(() => window.stymo.job.state), "running");
  await page.keyboard.press("Escape");
  assert.equal((await jobEnds(page)).state, "cancelled");
}, { slow: true });

test("snapshots that are taken at once are not empty", async (page) => {
  const downloads = [];
  page.on("download", (download) => downloads.push(download));
  await page.evaluate(() => {
    for (let i = 0; i < 5; ++i) document.body.dispatchEvent(
      new KeyboardEvent("keydown", { key: "s", bubbles: true }));
  });
  for (let waited = 0; !downloads.length && waited < slow; waited += 100)
    await page.waitForTimeout(100);
  await page.waitForTimeout(1000);
  assert.ok(downloads.length > 0);
  for (const download of downloads)
    assert.equal(fs.readFileSync(await download.path())[0], 0xff, "a JPEG");
});

test("seconds that are too few are shown as those that are played", async (page) => {
  await page.click("#key");
  await drag(page, 120, 0);
  const { yaw } = (await state(page)).camera;
  await page.click("#key");
  await page.fill("#seconds", "-2");
  await page.click("#reset");
  await page.click("#play");
  assert.equal(await page.inputValue("#seconds"), "0.5");
  await page.waitForFunction(
    (end) => Math.abs(window.stymo.state.camera.yaw - end) < 1e-6, yaw);
});

test("codes are dropped whatever the case of their ending", async (page) => {
  const [download] = await Promise.all([page.waitForEvent("download"), page.click("#codes")]);
  const text = fs.readFileSync(await download.path(), "utf8");
  const count = await faceCount(page);
  await page.evaluate((codes) => {
    const dataTransfer = new DataTransfer();
    dataTransfer.items.add(new File([codes], "codes.JSON"));
    document.body.dispatchEvent(new DragEvent("drop", { dataTransfer, bubbles: true }));
  }, text);
  await page.waitForFunction((n) => document.querySelectorAll(".face").length === n, count + 1);
});

test("the view behind the window stays as it was", async (page) => {
  const before = await pixels(page);
  await page.click("#mouse");
  await page.hover("#frame");
  await page.mouse.wheel(0, 300);
  await page.focus("#frame");
  await page.keyboard.press("ArrowLeft");
  await page.click("#mouse");
  assert.deepEqual((await state(page)).camera, { yaw: 0, pitch: 0, roll: 0, distance: 1.15 });
  await settled(page);
  assert.ok(difference(before, await pixels(page)) < 1);
});

test("the picture of a face that is removed is let go", async (page) => {
  const card = page.locator(".face").nth(2);
  await page.waitForFunction(() => document.querySelectorAll(".face img")[2].src);
  const source = await card.locator("img").getAttribute("src");
  await page.evaluate(() => {
    window.revoked = [];
    const revoke = URL.revokeObjectURL.bind(URL);
    URL.revokeObjectURL = (url) => { window.revoked.push(url); revoke(url); };
  });
  await card.getByRole("button", { name: "Remove" }).click();
  await page.waitForFunction((url) => window.revoked.includes(url), source);
});
