// The viewer's page in a real browser. Each test opens a page of its own.
// Usage: node viewer.mjs ADDRESS NODE_MODULES CHROMIUM WORK_FOLDER [--fast | TEST...]
// --fast leaves out the tests that are marked as slow.

import assert from "node:assert/strict";
import fs from "node:fs";
import { createRequire } from "node:module";
import path from "node:path";

import { acts, headFilm, places, shift, width } from "./head_film.mjs";
import "./mishaps.mjs";  // adds its tests
import {
  address, chromium, difference, drag, faceCount, jobEnds, modules, photoOfAFace, pixels, settled,
  shown, slow, test, tests, tuneFor, version, wanted, work,
} from "./page.mjs";

const fast = wanted[0] === "--fast";
const require = createRequire(path.resolve(modules, "package.json"));
const playwright = require(path.resolve(modules, "playwright-core"));

// ---- the tests ----

test("a face is shown, exact when nothing moves", async (page) => {
  assert.ok(await faceCount(page) >= 6);
  const all = await pixels(page);
  assert.ok(Math.max(...all.filter((_, i) => i % 4 === 0)) > 100, "the picture is not dark");
  assert.match(await page.textContent("#told"), /exact/);
});

test("dragging turns the face, and no stale picture comes after", async (page) => {
  const before = await pixels(page);
  await drag(page, 120, 0);
  const yaw = await page.evaluate(() => window.stymo.state.camera.yaw);
  assert.ok(yaw < -5, `yaw ${yaw}`);
  await settled(page);
  const after = await pixels(page);
  assert.ok(difference(before, after) > 2, "the picture has changed");
  assert.equal((await shown(page)).yaw, yaw);
  await page.waitForTimeout(500);
  assert.equal((await shown(page)).version, await version(page));
  assert.ok(difference(after, await pixels(page)) < 0.5, "and stays");
  await page.dblclick("#frame");
  await settled(page);
  assert.ok(difference(before, await pixels(page)) < 1, "a double click resets");
});

test("versions of shown pictures never go back", async (page) => {
  await page.evaluate(() => {
    window.seen = [];
    const look = () => {
      const { version } = window.stymo.shown;
      if (window.seen.at(-1) !== version) window.seen.push(version);
      requestAnimationFrame(look);
    };
    look();
  });
  for (let i = 0; i < 5; ++i) {
    await drag(page, 60 - 30 * i, 20, 8);
    await page.waitForTimeout(120);
  }
  await settled(page);
  const seen = await page.evaluate(() => window.seen);
  assert.ok(seen.length > 3);
  seen.forEach((value, i) => assert.ok(i === 0 || value >= seen[i - 1], seen.join(" ")));
});

test("the wheel approaches and keys do what the mouse does", async (page) => {
  await page.focus("#frame");
  await page.mouse.move(300, 300);
  await page.mouse.wheel(0, -300);
  const near = await page.evaluate(() => window.stymo.state.camera.distance);
  assert.ok(near < 1.15);
  for (const key of ["ArrowLeft", "ArrowLeft", "ArrowUp", "-"]) await page.keyboard.press(key);
  const camera = await page.evaluate(() => window.stymo.state.camera);
  assert.equal(camera.yaw, 6);
  assert.equal(camera.pitch, 3);
  assert.ok(camera.distance > near);
  await page.keyboard.press("0");
  assert.deepEqual(await page.evaluate(() => window.stymo.state.camera),
    { yaw: 0, pitch: 0, roll: 0, distance: 1.15 });
});

test("a slider changes the face, its group's reset takes it back", async (page) => {
  const before = await pixels(page);
  const slider = page.locator(".group").first().locator("input").first();
  await slider.evaluate((input) => {
    input.value = 2.5;
    input.dispatchEvent(new Event("input"));
  });
  await settled(page);
  assert.ok(difference(before, await pixels(page)) > 1);
  await page.locator(".group").first().getByRole("button").click();
  await settled(page);
  assert.ok(difference(before, await pixels(page)) < 1);
});

test("sliders are called by what they do, and show it", async (page) => {
  const slider = page.locator(".group label").first();
  await page.waitForFunction(() => {
    const first = document.querySelector(".names span");
    return first.textContent && !first.textContent.startsWith("direction");
  }, null, { timeout: slow });
  const names = await page.locator(".group").nth(1).locator(".names span").allTextContents();
  assert.ok(names.includes("mouth open"), names.join(", "));
  assert.equal(names.length, 12);
  assert.ok(names.filter((name) => name && !name.startsWith("direction")).length >= 10,
    names.join(", "));
  const ends = await slider.locator(".names span").allTextContents();
  assert.match(await slider.locator("input").getAttribute("aria-label"),
    new RegExp(`Identity: ${ends[0]} to ${ends[1]}`));
  await slider.hover();
  await page.waitForFunction(() => !document.getElementById("ends").hidden &&
    [...document.querySelectorAll("#ends img")].every((image) => image.naturalWidth === 64));
  assert.deepEqual(await page.locator("#ends figcaption").allTextContents(), ends);
  const [low, high] = await page.evaluate(() =>
    [...document.querySelectorAll("#ends img")].map((image) => {
      const context = document.createElement("canvas").getContext("2d");
      context.drawImage(image, 0, 0);
      return [...context.getImageData(0, 0, 64, 64).data];
    }));
  assert.ok(difference(low, high) > 3, "the ends differ");
  await page.hover("h1");
  assert.ok(await page.locator("#ends").isHidden());
});

test("a first visit says what to do, and a fit is tuned unless told otherwise", async (page) => {
  assert.match(await page.textContent("#welcome"), /^Drop a photo/);
  assert.ok(await page.locator("#welcome").isVisible());
  assert.equal(await page.inputValue("#tune"), "28");
  await drag(page, 30, 0);
  await page.waitForTimeout(400);
  await page.reload();
  await settled(page);
  assert.ok(await page.locator("#welcome").isHidden());
});

test("the picture has the pixels of the screen", async (page) => {
  const sides = () => page.evaluate(() => {
    const picture = document.getElementById("picture");
    return [picture.width, Math.round(picture.clientWidth * devicePixelRatio)];
  });
  const [before, wanted] = await sides();
  assert.equal(before, wanted);
  await page.setViewportSize({ width: 900, height: 700 });
  await page.waitForFunction(() => {
    const picture = document.getElementById("picture");
    return picture.width === Math.round(picture.clientWidth * devicePixelRatio);
  });
  assert.notEqual((await sides())[0], before);
});

test("mixing makes a new face with the ticked groups of another", async (page) => {
  const count = await faceCount(page);
  const before = await page.evaluate(() => window.stymo.state.codes);
  await page.locator(".face").nth(2).getByRole("button", { name: "Mix" }).click();
  await page.waitForFunction((n) => document.querySelectorAll(".face").length === n, count + 1);
  const after = await page.evaluate(() => window.stymo.state.codes);
  assert.equal(after.slice(0, 400), before.slice(0, 400), "the identity stays");
  assert.notEqual(after.slice(716, 1116), before.slice(716, 1116), "the texture does not");
});

test("dragging a face onto the picture mixes, too", async (page) => {
  const count = await faceCount(page);
  await page.locator(".face").nth(3).dragTo(page.locator("#frame"));
  await page.waitForFunction((n) => document.querySelectorAll(".face").length === n, count + 1);
});

test("depth, mask and normals are shown", async (page) => {
  const face = await pixels(page);
  for (const layer of ["depth", "mask", "normals"]) {
    await page.selectOption("#layer", layer);
    await settled(page);
    assert.ok(difference(face, await pixels(page)) > 5, layer);
  }
});

test("a reload shows the same face from the same side", async (page) => {
  await page.locator(".face").nth(1).getByRole("button", { name: "Show" }).click();
  await drag(page, 60, 30);
  await settled(page);
  await page.waitForTimeout(400);
  const before = await pixels(page);
  const camera = await page.evaluate(() => window.stymo.state.camera);
  await page.reload();
  await settled(page);
  const after = await page.evaluate(() => window.stymo.state.camera);
  assert.ok(Math.abs(after.yaw - camera.yaw) < 0.01);
  assert.ok(difference(before, await pixels(page)) < 1.5);
});

test("an address with the codes of another model is refused in one line", async (page) => {
  await page.waitForTimeout(400);
  await page.evaluate(() => { location.hash = location.hash.replace(/m=[^&]*/, "m=0"); });
  await page.reload();
  await page.getByText("The address shows a face of another model.").waitFor();
  await settled(page);
  assert.ok(await page.evaluate(() => window.stymo.state.codes.length > 0));
});

test("codes, a snapshot, a mesh and films are saved", async (page) => {
  const saved = async (action) => {
    const [download] = await Promise.all([
      page.waitForEvent("download", { timeout: slow }), action()]);
    return { name: download.suggestedFilename(), bytes: fs.readFileSync(await download.path()) };
  };
  const codes = await saved(() => page.click("#codes"));
  assert.equal(JSON.parse(codes.bytes).code.id.length, 100);
  const snapshot = await saved(() => page.click("#snapshot"));
  assert.equal(snapshot.bytes[0], 0xff);
  const mesh = await saved(() => page.click("#mesh"));
  assert.equal(mesh.bytes.subarray(0, 3).toString(), "ply");
  await jobEnds(page, 1);
  await page.click("#key");
  await page.focus("#frame");
  for (let i = 0; i < 5; ++i) await page.keyboard.press("ArrowLeft");
  await page.keyboard.press("k");
  await page.fill("#seconds", "0.5");
  const gif = await saved(() => page.click("#gif"));
  assert.equal(gif.bytes.subarray(0, 4).toString(), "GIF8");
  await jobEnds(page, 2);
  const mp4 = await saved(() => page.click("#mp4"));
  assert.equal(mp4.bytes.subarray(4, 8).toString(), "ftyp");
  await jobEnds(page, 3);
  await page.click("#play");
  await page.waitForTimeout(1500);
  assert.equal(await page.evaluate(() => window.stymo.state.camera.yaw), 15);
});

test("a photo is fitted, picture after picture, tuned, saved and opened", async (page) => {
  const file = await photoOfAFace(page);
  const before = await faceCount(page);
  await tuneFor(page, 2);
  await page.setInputFiles("#photo", file);
  await page.waitForFunction(() => ["fitting"].includes(window.stymo.job.phase) ||
    window.stymo.job.ended > 0, null, { timeout: slow });
  const begun = (await shown(page)).frames;
  await page.waitForFunction(() => window.stymo.job.phase === "tuning" ||
    window.stymo.job.ended > 0, null, { timeout: slow });
  assert.ok((await shown(page)).frames > begun + 2, "pictures came while it was fitted");
  const job = await jobEnds(page);
  assert.equal(job.state, "done", job.error);
  assert.equal(await faceCount(page), before + 1);
  await settled(page);
  const tuned = await pixels(page);
  const files = [];
  for (const [button, name] of [["#codes", "codes.json"], ["#tuned", "tuned.safetensors"]]) {
    const [download] = await Promise.all([page.waitForEvent("download"), page.click(button)]);
    files.push(path.join(work, name));
    await download.saveAs(files.at(-1));
  }
  await page.locator(".face").nth(0).getByRole("button", { name: "Show" }).click();
  const count = await faceCount(page);
  await page.setInputFiles("#open", files);
  await page.waitForFunction((n) => document.querySelectorAll(".face").length === n, count + 2);
  await settled(page);
  assert.ok(difference(tuned, await pixels(page)) < 1, await page.textContent("#message"));
  assert.ok(await page.locator("#tuned").isVisible());
});

// The photo twice in one, the right one larger.
async function photoOfTwo(page) {
  const one = fs.readFileSync(await photoOfAFace(page)).toString("base64");
  const both = await page.evaluate(async (base64) => {
    const bytes = Uint8Array.from(atob(base64), (letter) => letter.charCodeAt(0));
    const image = await createImageBitmap(new Blob([bytes]));
    const canvas = new OffscreenCanvas(1000, 560);
    const context = canvas.getContext("2d");
    context.drawImage(image, 0, 60, 440, 440);
    context.drawImage(image, 440, 0, 560, 560);
    const blob = await canvas.convertToBlob({ type: "image/jpeg", quality: 0.95 });
    return [...new Uint8Array(await blob.arrayBuffer())];
  }, one);
  const file = path.join(work, "two.jpg");
  fs.writeFileSync(file, Buffer.from(both));
  return file;
}

test("another face of a photo is chosen, also while one is fitted", async (page) => {
  const file = await photoOfTwo(page);
  const count = await faceCount(page);
  await page.selectOption("#tune", "60");
  await page.setInputFiles("#photo", file);
  await page.locator("#which").waitFor({ state: "visible", timeout: slow });
  assert.deepEqual(await page.locator("#which option").allTextContents(),
    ["largest", "1 from the left", "2 from the left"]);
  await page.waitForFunction(() => window.stymo.job.phase === "fitting" ||
    window.stymo.job.ended > 0, null, { timeout: slow });
  await page.selectOption("#tune", "0");
  await page.selectOption("#which select", "1");
  const job = await jobEnds(page, 2);
  assert.equal(job.state, "done", job.error);
  assert.equal(await faceCount(page), count + 1, "the fit of the other face was cancelled");
  assert.ok(await page.locator("#which").isVisible());
  await page.setInputFiles("#photo", path.join(work, "photo.jpg"));
  assert.equal((await jobEnds(page, 3)).state, "done");
  assert.ok(!await page.locator("#which").isVisible());
}, { slow: true });

test("a page that is closed while it fits does not hold up another", async (page) => {
  const file = await photoOfAFace(page);
  const other = await page.context().newPage();
  await other.goto(address);
  await settled(other);
  await tuneFor(other, 600);  // longer than a test waits
  await other.setInputFiles("#photo", file);
  await other.waitForFunction(() => window.stymo.job.phase === "tuning", null, { timeout: slow });
  await other.close();
  await page.click("#mesh");
  assert.equal((await jobEnds(page)).state, "done");
}, { slow: true });

test("a fit is cancelled and leaves no face", async (page) => {
  const file = await photoOfAFace(page);
  const count = await faceCount(page);
  await page.selectOption("#tune", "60");
  await page.setInputFiles("#photo", file);
  await page.waitForFunction(() => ["fitting"].includes(window.stymo.job.phase) ||
    window.stymo.job.ended > 0, null, { timeout: slow });
  await page.click("#cancel");
  const job = await jobEnds(page);
  assert.equal(job.state, "cancelled", job.error);
  assert.equal(await faceCount(page), count);
  await settled(page);
});

test("a file that is no photo is refused in one line", async (page) => {
  const file = path.join(work, "notes.txt");
  fs.writeFileSync(file, "no photo");
  await page.setInputFiles("#photo", file);
  await jobEnds(page);
  assert.equal(await page.textContent("#message"), "the photo: not an image");
});

test("hair takes another colour", async (page) => {
  const hair = 0.13;  // of the height of the picture
  const before = await pixels(page);
  const count = await faceCount(page);
  await page.evaluate(() => {
    const input = document.getElementById("color");
    input.value = "#99401a";
    input.dispatchEvent(new Event("input"));
  });
  await page.click("#pick");
  const box = await page.locator("#frame").boundingBox();
  await page.mouse.click(box.x + box.width * 0.5, box.y + box.height * hair);
  await jobEnds(page);
  assert.equal(await faceCount(page), count + 1, await page.textContent("#message"));
  await settled(page);
  const after = await pixels(page);
  const redness = (all) => {
    const at = 4 * (Math.round(32 * hair) * 32 + 16);
    return all[at] - all[at + 2];
  };
  assert.ok(redness(after) > redness(before) + 20, `${redness(before)} to ${redness(after)}`);
});

test("the window follows the mouse and lets go", async (page) => {
  const before = await pixels(page);
  await page.click("#mouse");
  const box = await page.locator("#frame").boundingBox();
  await page.mouse.move(box.x + box.width * 0.9, box.y + box.height * 0.5);
  await settled(page);
  assert.ok(difference(before, await pixels(page)) > 1);
  await page.click("#mouse");
  await settled(page);
  assert.ok(difference(before, await pixels(page)) < 1);
});

test("the window follows a head before the camera", async (page) => {
  await page.click("#window");
  const seen = [];
  const start = Date.now();
  while (Date.now() - start < 12000 || (seen.length < 60 && Date.now() - start < 60000)) {
    const measured = await page.evaluate(() => window.stymo.head.measured);
    if (measured) seen.push(measured);
    await page.waitForTimeout(100);
  }
  assert.ok(seen.length > 20, "a face was seen");
  // The film shows the head on the left, then on the right of the image, at one size.
  const [least, most] = [0.05, 0.95].map((part) => {
    const sorted = seen.map((eye) => eye[0]).sort((a, b) => a - b);
    return sorted[Math.floor(part * (sorted.length - 1))];
  });
  const depth = seen.map((eye) => eye[2]).sort((a, b) => a - b)[seen.length >> 1];
  const focal = 0.5 * width / Math.tan(Math.PI / 6);
  const known = shift * depth / focal;
  assert.ok(Math.abs(most - least - known) < 0.12 * known,
    `moved by ${most - least} m, known ${known} m`);
  assert.ok(await page.evaluate(() => window.stymo.state.eye !== null));
  await page.keyboard.press("Escape");
  assert.equal(await page.evaluate(() => window.stymo.state.eye), null);
}, { slow: true, camera: places });

test("the face does as the one before the camera, like a mirror", async (page) => {
  await page.locator(".face").nth(1).getByRole("button", { name: "Show" }).click();
  await settled(page);
  const before = await pixels(page);
  await page.click("#own");
  await page.waitForFunction(() => window.stymo.head.seen > 0, null, { timeout: slow });
  const seen = [];
  const begun = { time: Date.now(), frames: (await shown(page)).frames };
  const count = () => page.evaluate(() => window.stymo.head.seen);
  const first = await count();
  const passed = () => Date.now() - begun.time;
  while (passed() < 12000 || (await count() < 60 && passed() < 60000)) {
    seen.push(await page.evaluate(() => {
      const { camera, expression } = window.stymo.state;
      return { yaw: camera.yaw, change: Math.hypot(...expression) };
    }));
    await page.waitForTimeout(50);
  }
  const seconds = passed() / 1000;
  const picture = await shown(page);
  const rate = (picture.frames - begun.frames) / seconds;
  console.log(`  ${(((await count()) - first) / seconds).toFixed(1)} images/s seen, ` +
    `${rate.toFixed(1)} pictures/s of ${picture.side} pixels shown`);
  const yaws = seen.map(({ yaw }) => yaw);
  const range = Math.max(...yaws) - Math.min(...yaws);
  // The model's heads are flatter than the one whose pose is found.
  assert.ok(range > 12 && range < 55, `turned by ${range} degrees, known 40`);
  assert.ok(yaws.find((yaw) => Math.abs(yaw) > 5) < 0, "a mirror turns the other way");
  const changes = seen.filter(({ yaw, change }) => Math.abs(yaw) < 5 && change > 0)
    .map(({ change }) => change);
  const [least, most] = [Math.min(...changes), Math.max(...changes)];
  assert.ok(most > 3 * least, `changes from ${least} to ${most}`);
  assert.ok(rate > 0.2);
  await page.keyboard.press("Escape");
  await settled(page);
  assert.ok(difference(before, await pixels(page)) < 1, "and lets go");
}, { camera: acts });

test("two pages have faces of their own; one that is closed does not matter", async (page) => {
  const other = await page.context().newPage();
  await other.goto(address);
  await settled(other);
  await other.click("#draw");
  await other.waitForFunction(() => document.querySelectorAll(".face").length === 7);
  assert.equal(await faceCount(page), 6);
  await Promise.all([drag(page, 80, 0), drag(other, -80, 0)]);
  await Promise.all([settled(page), settled(other)]);
  await other.close();
  await drag(page, -40, 0);
  await settled(page);
}, { slow: true });

test("the page is readable at phone width", async (page) => {
  await page.setViewportSize({ width: 375, height: 740 });
  await settled(page);
  const [wide, frame] = await page.evaluate(() => [
    document.documentElement.scrollWidth, document.getElementById("frame").clientWidth]);
  assert.ok(wide <= 375, `the page is ${wide} pixels wide`);
  assert.ok(frame > 300);
});

test("a moving picture comes often and soon", async (page) => {
  // The path moves the camera with every frame of the screen; the driver of the mouse would take
  // processor time of its own.
  await page.click("#key");
  await drag(page, 200, 0, 4);
  await page.click("#key");
  await page.fill("#seconds", "6");
  const playedRate = async () => {
    await page.click("#play");
    await page.waitForTimeout(1500);
    const begun = (await shown(page)).frames;
    await page.waitForTimeout(4000);
    return ((await shown(page)).frames - begun) / 4;
  };
  const rate = await playedRate();
  const side = await page.evaluate(() => window.stymo.shown.side);
  await page.waitForTimeout(1000);
  await page.evaluate(() => { window.stymo.shown.latencies.length = 0; });
  for (let i = 0; i < 4; ++i) await drag(page, 150, 0, 40);
  const latencies = await page.evaluate(() => window.stymo.shown.latencies);
  latencies.sort((a, b) => a - b);
  console.log(`  ${rate.toFixed(1)} pictures/s of ${side} pixels, ` +
    `${latencies[latencies.length >> 1].toFixed(0)} ms from a movement to its picture (median)`);
  assert.ok(rate > 2);

  await page.click("#reset");  // a photo from the front
  const file = await photoOfAFace(page);
  await page.selectOption("#tune", "60");
  await page.setInputFiles("#photo", file);
  await page.waitForFunction(() => window.stymo.job.phase === "tuning" ||
    window.stymo.job.ended > 0, null, { timeout: slow });
  const job = await page.evaluate(() => ({ ...window.stymo.job }));
  assert.equal(job.phase, "tuning", job.error);
  const beside = await playedRate();
  console.log(`  ${beside.toFixed(1)} pictures/s while a face is tuned`);
  assert.ok(beside > 1);
}, { slow: true });

// ---- running them ----

const plain = ["--no-sandbox", "--disable-dev-shm-usage"];
const browser = await playwright.chromium.launch({ executablePath: chromium, args: plain });

async function cameraBrowser(scenes) {
  const film = path.join(work, "head.mjpeg");
  await headFilm(browser, address, film, scenes);
  return playwright.chromium.launch({ executablePath: chromium, args: [...plain,
    "--use-fake-ui-for-media-stream", "--use-fake-device-for-media-stream",
    `--use-file-for-fake-video-capture=${film}`] });
}

let failed = 0;
for (const { name, body, options } of tests) {
  if (fast ? options.slow : wanted.length && !wanted.some((part) => name.includes(part))) continue;
  const own = options.camera ? await cameraBrowser(options.camera) : browser;
  const context = await own.newContext({
    viewport: { width: 1280, height: 900 }, acceptDownloads: true });
  const page = await context.newPage();
  const errors = [];
  page.on("pageerror", (error) => errors.push(error.message));
  page.setDefaultTimeout(slow);
  const start = Date.now();
  try {
    await page.goto(address);
    await settled(page);
    await body(page);
    assert.deepEqual(errors, []);
    console.log(`ok ${name} (${((Date.now() - start) / 1000).toFixed(1)} s)`);
  } catch (error) {
    failed += 1;
    console.log(`FAILED ${name}: ${error.message.split("\n").slice(0, 6).join("\n  ")}`);
    await page.screenshot({ path: path.join(work, `failed-${failed}.png`) }).catch(() => {});
  }
  await context.close();
  if (own !== browser) await own.close();
}
await browser.close();
process.exit(failed ? 1 : 0);
