/* The nameplate's fields, judged by the service as they are left: what is wrong, what to do, and what the plate means. */
import { say } from "./page.js";

const form = document.querySelector("#plate");
let asked = 0;

async function judge() {
  const number = ++asked;
  const answer = await fetch("/plate", {
    method: "POST",
    headers: { accept: "application/json" },
    body: new URLSearchParams(new FormData(form)),
  });
  if (answer.ok && number === asked) show(await answer.json());
}

function show(judged) {
  let wrong = 0;
  for (const box of form.querySelectorAll("[data-field]")) {
    const complaint = judged.fields[box.dataset.field],
      input = box.querySelector("input"),
      message = box.querySelector(".msg");
    box.classList.toggle("bad", complaint !== "");
    if (complaint === "") input.removeAttribute("aria-invalid");
    else {
      input.setAttribute("aria-invalid", "true");
      wrong += 1;
    }
    message.textContent = complaint || message.dataset.hint;
  }
  document.querySelector("#why").textContent = wrong
    ? say("%s to correct", wrong)
    : say("energises nothing, writes nothing");
  const note = document
    .querySelector(judged.is_odd ? "#judgedodd" : "#judged")
    .content.firstElementChild.cloneNode(true);
  note.querySelector("b").textContent = judged.verdict;
  note.querySelector("span").textContent = judged.reason;
  document.querySelector("#judgement").replaceChildren(...(judged.verdict ? [note] : []));
}

const inputs = [...form.querySelectorAll("input")];
for (const input of inputs) input.addEventListener("change", judge);
if (inputs.some((input) => input.value !== input.defaultValue)) judge(); // typed before this was here
