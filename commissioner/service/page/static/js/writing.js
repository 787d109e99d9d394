/* A write-back or restore that goes on: its steps as the run's records tell them, until the page that says how it ended comes. */
import { number, put, say } from "./page.js";

const EVERY_MS = 300;
const panel = document.querySelector("#writing");
const steps = [...panel.querySelectorAll("[data-step]")];

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
  try {
    const answer = await fetch(`/api/runs/${encodeURIComponent(panel.dataset.run)}/writing`);
    if (answer.ok) show(await answer.json());
  } catch {
    /* the band says that the service is lost */
  }
  setTimeout(look, EVERY_MS);
}
document.querySelector("main form").addEventListener("submit", () => {
  panel.hidden = false;
  panel.scrollIntoView({ block: "nearest" });
  setTimeout(look, EVERY_MS);
});
