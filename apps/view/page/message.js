// One line that tells what went wrong or came out; it goes after a while.

const line = document.getElementById("message");
let timer = 0;

export function say(text) {
  clearTimeout(timer);
  line.textContent = text;
  const timeToRead = Math.max(8000, 120 * text.length);
  if (text) timer = setTimeout(() => { line.textContent = ""; }, timeToRead);
}
