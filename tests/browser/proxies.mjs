// The viewer through forwarded ports and behind nginx, in a real browser, and the pages that must
// stay outside. Every name of .test leads to this machine.
// Usage: node proxies.mjs STYMO_VIEW NGINX NODE_MODULES CHROMIUM WORK_FOLDER

import assert from "node:assert/strict";
import { spawn } from "node:child_process";
import fs from "node:fs";
import http from "node:http";
import { createRequire } from "node:module";
import net from "node:net";
import path from "node:path";

const [viewer, nginx, modules, chromium, work] = process.argv.slice(2);
const require = createRequire(path.resolve(modules, "package.json"));
const playwright = require(path.resolve(modules, "playwright-core"));
const slow = 120000;  // milliseconds, for a machine that is busy
const started = [];

// ---- programs and ports ----

async function freePort() {
  const server = net.createServer().listen(0, "127.0.0.1");
  await new Promise((done) => server.once("listening", done));
  const { port } = server.address();
  await new Promise((done) => server.close(done));
  return port;
}

function run(program, options) {
  const child = spawn(program, options, { stdio: ["ignore", "inherit", "pipe"] });
  started.push(child);
  return child;
}

// Starts a viewer and returns the address that it prints.
async function view(port, ...options) {
  const child = run(viewer, ["--port", String(port), ...options]);
  let said = "";
  for await (const part of child.stderr) {
    said += part;
    const address = /^Open (http\S+) /m.exec(said);
    if (address) {
      child.stderr.resume();
      return address[1];
    }
  }
  throw new Error(`the viewer has ended: ${said}`);
}

// What `ssh -L PORT:127.0.0.1:TO` does.
async function forward(host, to) {
  const server = net.createServer((from) => {
    const other = net.connect(to, "127.0.0.1");
    from.pipe(other).pipe(from);
    for (const end of [from, other]) end.on("error", () => { from.destroy(); other.destroy(); });
  }).listen(0, host);
  await new Promise((done) => server.once("listening", done));
  return server.address().port;
}

// `locations`: path -> directives.
function nginxSite(port, locations) {
  const blocks = Object.entries(locations).map(
    ([at, directives]) => `location ${at} { ${directives} }`).join("\n");
  return `server {
    listen 127.0.0.1:${port} ssl;
    ssl_certificate ${work}/certificate.pem;
    ssl_certificate_key ${work}/key.pem;
    client_max_body_size 64m;
    ${blocks}
  }`;
}

async function startNginx(sites) {
  fs.writeFileSync(path.join(work, "nginx.conf"), `
    daemon off; master_process off; pid ${work}/nginx.pid; error_log ${work}/nginx.log;
    events {}
    http {
      access_log off;
      ${["client_body", "proxy", "fastcgi", "uwsgi", "scgi"].map(
        (name) => `${name}_temp_path ${work}/${name};`).join("\n")}
      ${sites.join("\n")}
    }`);
  run(nginx, ["-p", work, "-e", `${work}/nginx.log`, "-c", path.join(work, "nginx.conf")]);
}

// ---- what is tested ----

let failed = 0;
async function test(name, body) {
  try {
    await body();
    console.log(`ok ${name}`);
  } catch (error) {
    failed += 1;
    console.log(`FAILED ${name}: ${error.message.split("\n").slice(0, 6).join("\n  ")}`);
  }
}

let browser;
async function opened(address, body) {
  const page = await browser.newPage({ ignoreHTTPSErrors: true });
  page.setDefaultTimeout(slow);
  try {
    for (let attempt = 0; ; ++attempt) {
      try {
        await page.goto(address);
        break;
      } catch (error) {  // nginx may not listen yet
        if (attempt > 50) throw error;
        await page.waitForTimeout(100);
      }
    }
    return await body(page);
  } finally {
    await page.close();
  }
}

// A face is shown, and a file can be sent: the viewer works.
const works = (address) => opened(address, async (page) => {
  await page.waitForFunction(() => window.stymo?.shown.quality === "still");
  const notes = path.join(work, "notes.txt");
  fs.writeFileSync(notes, "x".repeat(3 << 20));
  await page.setInputFiles("#photo", notes);
  await page.waitForFunction(() => window.stymo.job.ended > 0);
  assert.equal(await page.textContent("#message"), "the photo: not an image");
});

const isRefused = (address, reason) => opened(address, async (page) => {
  // A refusal as JSON, what the script says, or what the page says if its script is refused.
  await page.waitForFunction(() => {
    const blocked = document.getElementById("blocked");
    return blocked ? getComputedStyle(blocked).visibility === "visible" :
      (document.getElementById("told") ?? document.body).textContent !== "";
  });
  assert.match(await page.textContent("body"), reason);
  assert.equal(await page.evaluate(() => window.stymo), undefined);
});

const [plain, proxied, trusting, tls, other] =
  await Promise.all([0, 0, 0, 0, 0].map(freePort));
const pass = (port) => `proxy_pass http://127.0.0.1:${port}`;
const kept = "proxy_set_header Host $http_host;";
const forwarded = "proxy_set_header X-Forwarded-Proto $scheme; " +
  "proxy_set_header X-Forwarded-Host $http_host;";

try {
  browser = await playwright.chromium.launch({ executablePath: chromium, args: [
    "--no-sandbox", "--disable-dev-shm-usage", "--host-resolver-rules=MAP *.test 127.0.0.1",
    // So that pages of other names may ask this machine at all.
    "--disable-features=PrivateNetworkAccessSendPreflights,LocalNetworkAccessChecks"] });
  await startNginx([
    nginxSite(tls, {
      "/": `${pass(proxied)}; ${kept}`,
      "/renamed/": `${pass(proxied)}/;`,
      "/stripped/": `${pass(proxied)}/; ${kept}`,
      "/user/proxy/8080": `${pass(proxied)}; ${kept}`,
      "/buffers-nothing/": `${pass(proxied)}/; ${kept} proxy_http_version 1.1; ` +
        "proxy_request_buffering off; proxy_buffering off;",
    }),
    nginxSite(other, {
      "/": `${pass(trusting)}; ${forwarded}`,
      "/untold/": `${pass(trusting)}/;`,
      "/plain/": `${pass(plain)}/; ${kept}`,
    }),
  ]);
  const name = `https://name.test:${tls}`;
  await view(plain);
  const printed = await view(proxied, "--origin", `${name}/user/proxy/8080`, "--token", "secret");
  await view(trusting, "--trust-proxy", "--token", "secret");

  for (const host of ["127.0.0.1", "localhost", "::1"]) {
    await test(`a forwarded port of ${host}`, async () => {
      const port = await forward(host, plain);
      await works(`http://${host.includes(":") ? `[${host}]` : host}:${port}/`);
    });
  }
  await test("behind HTTPS, and a proxy that does not take its path away", async () => {
    assert.equal(printed, `${name}/user/proxy/8080/?token=secret`);
    await works(printed);
  });
  await test("the same without the last slash", () => works(printed.replace("/?", "?")));
  for (const at of ["/", "/stripped/", "/stripped", "/renamed/", "/buffers-nothing/"])
    await test(`behind HTTPS at ${at}`, () => works(`${name}${at}?token=secret`));
  await test("behind a proxy that says where the page is", () =>
    works(`https://any.test:${other}/?token=secret`));

  await test("without the token or with a wrong one, the page says so", async () => {
    for (const token of ["", "?token=other"])
      await isRefused(`${name}/${token}`, /the token is missing or wrong/);
  });
  await test("a proxy that was not told of is refused, and the option is named", async () => {
    await isRefused(`https://any.test:${other}/plain/`, /start stymo-view with --origin/);
    await isRefused(`https://any.test:${other}/untold/?token=secret`,
      /must be started with\s+--origin/);
  });
  await test("a page whose name leads here is refused", async () => {
    await isRefused(`http://rebinding.test:${plain}/`, /this name is not the viewer's/);
    await isRefused(`http://rebinding.test:${proxied}/`, /this name is not the viewer's/);
    await isRefused(`http://rebinding.test:${trusting}/`, /the token is missing or wrong/);
  });
  await test("a foreign page is refused, even with the token", async () => {
    const site = http.createServer((_, answer) => {
      answer.setHeader("Content-Type", "text/html");
      answer.end("<title>other</title>");
    }).listen(0, "127.0.0.1");
    await new Promise((done) => site.once("listening", done));
    for (const foreign of ["evil.test", "localhost"]) {
      await opened(`http://${foreign}:${site.address().port}/`, async (page) => {
        for (const target of [`http://127.0.0.1:${plain}`, `http://localhost:${plain}`, name]) {
          const seen = page.waitForResponse((answer) => answer.url().startsWith(target));
          const got = await page.evaluate(async (url) => {
            try {  // without a preflight; the answer cannot be read
              const answer = await fetch(url, { method: "POST", body: "", mode: "no-cors" });
              return answer.type;
            } catch (error) {
              return error.message;
            }
          }, `${target}/api/session`);
          assert.ok(["opaque", "Failed to fetch"].includes(got), got);
          assert.equal((await seen).status(), 403, target);
          const told = await page.evaluate(async (url) => {
            try {
              await fetch(url, { method: "POST", headers: { "X-Stymo-Token": "secret" } });
              return "answered";
            } catch {
              return "refused";
            }
          }, `${target}/api/session`);
          assert.equal(told, "refused");
        }
      });
    }
    site.close();
  });
} finally {
  for (const child of started) child.kill();
  await browser?.close();
}
process.exit(failed ? 1 : 0);
