/* A recording dropped on the page goes into the form's file field and is sent. */
import { say } from "./page.js";

const box = document.querySelector("#drop"),
  form = document.querySelector("#dropform"),
  input = document.querySelector("#file");
for (const kind of ["dragenter", "dragover"])
  box.addEventListener(kind, (event) => {
    event.preventDefault();
    box.classList.add("over");
  });
for (const kind of ["dragleave", "drop"])
  box.addEventListener(kind, (event) => {
    event.preventDefault();
    box.classList.remove("over");
  });
box.addEventListener("drop", (event) => {
  if (event.dataTransfer.files.length) input.files = event.dataTransfer.files;
});
box.dataset.takes = "files";
form.addEventListener("submit", () => {
  form.querySelector("button").textContent = say("The file is being sent …");
});
