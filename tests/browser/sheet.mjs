// A file of stymo-export in a page of this folder, whose canvas becomes a picture.
// Usage: node sheet.mjs PAGE FILE SHEET MODULES CHROMIUM. The page reads /file and the packages of
// MODULES, and sets `window.sheet`, a data URL, and `window.facts`, which are printed. Fails if the
// page has an error.

import fs from "node:fs";
import http from "node:http";
import path from "node:path";
import { createRequire } from "node:module";

const [page, file, sheet, folder, executablePath] = process.argv.slice(2);
const modules = path.resolve(folder);
const { chromium } = createRequire(modules + "/")("playwright-core");

const server = http.createServer((request, response) => {
  const wanted = request.url === "/" ? page
    : request.url.startsWith("/file") ? file : path.join(modules, request.url);
  response.setHeader("content-type", wanted === page ? "text/html" : "text/javascript");
  response.end(fs.existsSync(wanted) ? fs.readFileSync(wanted) : "");
}).listen(0, "127.0.0.1");
await new Promise((listening) => server.once("listening", listening));
const browser = await chromium.launch({ executablePath, args: ["--no-sandbox",
  "--use-gl=angle", "--use-angle=swiftshader", "--enable-unsafe-swiftshader"] });
try {
  const view = await browser.newPage();
  const errors = [];
  view.on("pageerror", (error) => errors.push(error.message));
  await view.goto(`http://127.0.0.1:${server.address().port}/`);
  await view.waitForFunction(() => window.sheet, null, { timeout: 60000 })
    .catch((error) => errors.push(error.message));
  if (errors.length > 0) throw new Error(errors.join("; "));
  console.log(JSON.stringify(await view.evaluate(() => window.facts)));
  const data = await view.evaluate(() => window.sheet);
  fs.writeFileSync(sheet, Buffer.from(data.split(",")[1], "base64"));
} finally {
  await browser.close();
  server.close();
}
