/* Hold to energise: two seconds by pointer, Enter or Space; three confirmations first. A held key never becomes a STOP. */
import { level, say } from "./page.js";

const HOLD_MS = 2000;
const form = document.querySelector("#energise"),
  hold = document.querySelector("#hold"),
  message = document.querySelector("#holdmsg");
let timer = 0;
const missing = () => [...document.querySelectorAll(".must")].filter((box) => !box.checked);

function begin() {
  if (timer) return;
  const open = missing();
  if (open.length) {
    message.textContent = say("Not yet: confirm %s more above.", open.length);
    open[0].focus();
    return;
  }
  hold.classList.add("holding");
  message.textContent = say("Keep holding …");
  timer = setTimeout(energise, HOLD_MS);
}
function release() {
  if (!timer) return;
  clearTimeout(timer);
  timer = 0;
  hold.classList.remove("holding");
  message.textContent = say("Released before 2 s. Nothing was energised.");
}
async function energise() {
  timer = 0;
  hold.disabled = true;
  level("live");
  document.querySelector("#big").textContent = say("ENERGISED SOON");
  message.textContent = say("The run is being started …");
  const wish = new URLSearchParams(new FormData(form));
  wish.set("held", "yes");
  try {
    const answer = await fetch(form.action, { method: "POST", headers: { accept: "application/json" }, body: wish });
    const said = await answer.json();
    if (answer.ok) {
      location.assign(said.url);
      return;
    }
    message.textContent = [said.title, said.remedy].filter(Boolean).map((text) => text[0].toUpperCase() + text.slice(1)).join(". ");
  } catch (failure) {
    message.textContent = String(failure);
  }
  hold.disabled = false;
  hold.classList.remove("holding");
}
if (hold) {
  hold.addEventListener("pointerdown", (event) => {
    if (event.button === 0) begin();
  });
  for (const kind of ["pointerup", "pointerleave", "pointercancel", "blur"]) hold.addEventListener(kind, release);
  const isKey = (event) => event.key === "Enter" || event.key === " ";
  hold.addEventListener("keydown", (event) => {
    if (isKey(event)) {
      event.preventDefault();
      if (!event.repeat) begin();
    }
  });
  hold.addEventListener("keyup", (event) => {
    if (isKey(event)) {
      event.preventDefault();
      release();
    }
  });
  hold.addEventListener("contextmenu", (event) => event.preventDefault());
  hold.disabled = false; // only now does it hear a hand
} else if (document.querySelector("#warming")) setTimeout(() => location.reload(), 3000);
