// Requests to the program.

const token = new URLSearchParams(location.search).get("token") ?? "";
let session = "";

export class RequestFailed extends Error {
  constructor(status, message) {
    super(message);
    this.status = status;
  }
}

export async function post(path, body = "", options = {}) {
  const headers = { "X-Stymo-Session": session };
  if (token) headers["X-Stymo-Token"] = token;
  let response;
  try {
    const address = new URL("../api/" + path, import.meta.url);  // below the path of a proxy, too
    response = await fetch(address, { method: "POST", headers, body, ...options });
  } catch (error) {
    if (error.name === "AbortError") throw error;
    throw new RequestFailed(0, "The program has ended or cannot be reached.");
  }
  if (response.ok) return response;
  let text = response.statusText;
  try {
    text = (await response.json()).error;
  } catch { /* not ours */ }
  throw new RequestFailed(response.status, text);
}

export async function ask(path, value) {
  const body = value === undefined ? "" : JSON.stringify(value);
  return (await post(path, body)).json();
}

export async function openSession() {
  const opened = await ask("session");
  session = opened.session;
  // So that the program does not take a page that nobody touches for one that is closed.
  setInterval(() => post("job").catch(() => {}), 20000);
  addEventListener("pagehide", () => { post("close", "", { keepalive: true }).catch(() => {}); });
  // A page that the browser has kept comes back to a session that has ended.
  addEventListener("pageshow", (event) => { if (event.persisted) location.reload(); });
  return opened;
}

export function save(blob, name) {
  const link = document.createElement("a");
  link.href = URL.createObjectURL(blob);
  link.download = name;
  link.click();
  setTimeout(() => URL.revokeObjectURL(link.href), 10000);
}
