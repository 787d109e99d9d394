/* The nameplate's fields, judged by the service as they are left: what is wrong, and what to do. */
import { number, say } from "./page.js";

const form = document.querySelector("#plate");
const csrf = document.body.dataset.csrf;
const value = (name) => form.elements[name]?.value.trim() ?? "";

function plate() {
  const fields = {};
  for (const name of ["rated_voltage_v", "rated_current_a", "rated_frequency_hz", "rated_speed_rpm", "pole_pairs", "power_factor", "inertia_kg_m2", "connection"]) if (value(name) !== "") fields[name] = value(name);
  const kilowatts = Number(value("rated_power_kw").replace(",", "."));
  fields.rated_power_w = value("rated_power_kw") !== "" && Number.isFinite(kilowatts) ? Number((1000 * kilowatts).toPrecision(10)) : value("rated_power_kw");
  return fields;
}

async function judge() {
  const answer = await fetch("/api/nameplates/validate", { method: "POST", headers: { "content-type": "application/json", "x-csrf-token": csrf }, body: JSON.stringify(plate()) });
  if (answer.ok) show(await answer.json());
}

function show(judged) {
  let wrong = 0;
  for (const box of form.querySelectorAll("[data-field]")) {
    const field = judged.fields[box.dataset.field], input = box.querySelector("input"), message = box.querySelector(".msg");
    box.classList.toggle("bad", !field.ok);
    if (field.ok) input.removeAttribute("aria-invalid"); else { input.setAttribute("aria-invalid", "true"); wrong += 1; }
    message.textContent = field.ok ? message.dataset.hint : `${field.what}: ${field.remedy}`;
  }
  document.querySelector("#why").textContent = wrong ? say("%s to correct", wrong) : say("energises nothing, writes nothing");
  const note = document.querySelector("#judgement p");
  if (note && judged.efficiency !== null) note.dataset.efficiency = number(100 * judged.efficiency, 1, "%");
}

for (const input of form.querySelectorAll("input")) input.addEventListener("change", judge);
