/* A write-back or restore that goes on: its steps as the run's records tell them, then the page that says how it ended. The form is sent
   from here, so that a service that is lost meanwhile leaves a page that says what to do. */
import { number, on, put, say, showPage } from "./page.js";

const EVERY_MS = 300;
const panel = document.querySelector("#writing"),
  form = document.querySelector("main form");
const steps = [...panel.querySelectorAll("[data-step]")];
const run = encodeURIComponent(panel.dataset.run);
let goesOn = false,
  isLost = false;

function show(told) {
  const now = steps.findIndex((step) => step.dataset.step === told.step);
  if (now < 0) return;
  steps.forEach((step, k) => {
    step.classList.toggle("done", k < now);
    if (k !== now) step.removeAttribute("aria-current");
    else if (!step.hasAttribute("aria-current")) {
      step.setAttribute("aria-current", "step");
      put("say", step.textContent.trim());
    }
  });
  put("writingsince", say("begun %s ago", number(told.seconds, 0, "s")));
}
async function look() {
  if (!goesOn) return;
  try {
    const answer = await fetch(`/api/runs/${run}/writing`);
    if (answer.ok && goesOn) show(await answer.json());
  } catch {
    /* whoever waits for the answer hears of it, too */
  }
  setTimeout(look, EVERY_MS);
}
function lost() {
  isLost = true;
  const note = document.querySelector("#writinglost");
  note.hidden = false;
  panel.hidden = true;
  note.scrollIntoView({ block: "nearest" });
  put("say", note.textContent.trim());
}
on("offline", (isOffline) => {
  if (isLost && !isOffline) location.assign(`/runs/${run}`);
});
form.addEventListener("submit", async (event) => {
  event.preventDefault();
  if (goesOn) return;
  goesOn = true;
  form.parentElement.hidden = true; // its way back would say that nothing is written
  panel.hidden = false;
  panel.scrollIntoView({ block: "nearest" });
  setTimeout(look, EVERY_MS);
  try {
    const answer = await fetch(form.action, { method: "POST", body: new URLSearchParams(new FormData(form)) });
    if (answer.redirected) location.assign(answer.url);
    else showPage(await answer.text());
  } catch {
    lost();
  }
  goesOn = false;
});
