// One line that tells what went wrong or came out; it goes after a while.

const line = document.getElementById("message");
let timer = 0;

export function say(text) {
  clearTimeout(timer);
  line.textContent = text;
  if (text) timer = setTimeout(() => { line.textContent = ""; }, 8000);
}
