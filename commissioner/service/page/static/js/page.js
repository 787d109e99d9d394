/* STOP, the band and the line to the service. Nothing on any page is needed for STOP but this file, or no script at all. */
const $ = (selector) => document.querySelector(selector);
export const texts = JSON.parse($("#texts").textContent);
export const say = (message, ...facts) =>
  facts.reduce((text, fact) => text.replace(/%[a-z]/, fact), texts[message] ?? message);
export const language = document.documentElement.lang;

/* numbers: fixed digits, the language's decimal mark, a true minus, a no-break space before the unit */
export const number = (value, digits, unit = "") => {
  if (value === null || value === undefined || !Number.isFinite(value)) return "–";
  const shown = Math.abs(value) < 0.5 * 10 ** -digits ? 0 : value;
  const text = Math.abs(shown).toFixed(digits);
  return (
    (shown < 0 ? "\u2212" : "") + (language === "de" ? text.replace(".", ",") : text) + (unit ? `\u00a0${unit}` : "")
  );
};

const root = document.documentElement;
const place = document.body.dataset;
const OFFLINE_MS = 1500,
  RETRY_MS = 500,
  ONCE_MS = 5000;
let socket = null,
  heardAt = performance.now(),
  wasLive = root.dataset.level === "live" || root.dataset.level === "alarm";
let isOffline = false,
  stopPending = 0,
  lastBand = null;
const listeners = { band: [], live: [], samples: [], history: [], over: [], control: [], refused: [], offline: [] };
export const on = (kind, act) => listeners[kind].push(act);
const tell = (kind, fact) => {
  for (const act of listeners[kind] ?? []) act(fact);
};

/* ---- the line ---------------------------------------------------------------------------------------------------- */
function connect() {
  const scheme = location.protocol === "https:" ? "wss" : "ws";
  const path = place.run ? `/api/runs/${encodeURIComponent(place.run)}/control` : "/api/control";
  const query = place.drive ? `&drive=${encodeURIComponent(place.drive)}` : "";
  socket = new WebSocket(`${scheme}://${location.host}${path}?lang=${root.lang}${query}`);
  socket.addEventListener("message", (event) => {
    heardAt = performance.now();
    if (isOffline) online();
    const said = JSON.parse(event.data);
    for (const kind of Object.keys(said)) {
      if (kind === "band") showBand(said.band);
      else if (kind === "stopped") stopped(said.stopped);
      tell(kind, said[kind]);
    }
  });
  socket.addEventListener("close", () => {
    if (!leaving) setTimeout(connect, RETRY_MS);
  });
}
export const send = (fact) => {
  if (socket === null || socket.readyState !== WebSocket.OPEN) return false;
  socket.send(JSON.stringify(fact));
  return true;
};
let leaving = false;
addEventListener("pagehide", () => {
  leaving = true;
});
addEventListener("pageshow", (event) => {
  leaving = false;
  if (event.persisted) location.reload();
});
connect();
setInterval(() => {
  if (performance.now() - heardAt > OFFLINE_MS) offline();
}, 250);

/* ---- the band ---------------------------------------------------------------------------------------------------- */
export const put = (id, text) => {
  const node = document.getElementById(id);
  if (node.textContent !== text) node.textContent = text;
};
function showBand(band) {
  const changed =
    lastBand === null
      ? root.dataset.level !== band.level || $("#big").textContent !== band.big
      : lastBand.level !== band.level || lastBand.big !== band.big;
  lastBand = band;
  level(band.level);
  put("big", band.big);
  put("small", band.small);
  put("drive", band.drive);
  put("driveline", band.drive_line);
  put("control", band.control);
  put("controlline", band.control_line);
  if (performance.now() > stopPending) put("stopsub", band.stop);
  const field = $("#stopform [name=run]");
  field.value = band.run;
  if (changed) {
    put("say", `${band.big}. ${band.small}`);
    document.title = `${band.big}: ${document.title.split(": ").slice(1).join(": ")}`;
  }
  wasLive = band.level === "live" || band.level === "alarm";
  if (place.run && band.run === place.run) follow(band.phase);
  else if (place.run && $("#livedata, #tuning")) follow("ended"); // a service that was begun anew knows it as one that was cut off
}
export function level(name) {
  if (root.dataset.level === name) return;
  root.dataset.level = name;
  for (const shape of document.querySelectorAll("[data-shape]")) shape.hidden = shape.dataset.shape !== name;
}
function offline() {
  if (!isOffline) {
    isOffline = true;
    level(wasLive ? "alarm" : "unknown");
    put("big", say(wasLive ? "TAKE THE MOTOR AS LIVE" : "State of the motor not known"));
    put(
      "small",
      say(wasLive ? "This page has lost the service. The motor was energised" : "This page has lost the service"),
    );
    put("control", say("not known"));
    put("controlline", say("no service"));
    put("say", `${$("#big").textContent}. ${$("#small").textContent}`);
    tell("offline", true);
  }
  if (performance.now() > stopPending) put("stopsub", say("cannot be sent: use the emergency stop")); // not over what a STOP was answered
  put("driveline", say("last word %s ago", number((performance.now() - heardAt) / 1000, 1, "s")));
}
function online() {
  isOffline = false;
  lastBand = null;
  stopPending = 0;
  tell("offline", false);
}

/* a run that has moved on: the same address shows its next page; the band and STOP stay where they are */
const OVER = new Set(["ended", "diagnosing"]);
let isChanging = false;
async function follow(phase) {
  const before = place.phase;
  if (phase === before || isChanging) return;
  place.phase = phase;
  if (!OVER.has(phase) && !(before === "" && phase)) return;
  isChanging = true;
  try {
    if (!(await renew((next) => !(next.querySelector("#livedata") && $("#livedata"))))) place.phase = before;
  } catch {
    place.phase = before;
  } finally {
    isChanging = false;
  }
}
/* the work of this page as the service shows it now, where `isWanted` says so of it */
export async function renew(isWanted = () => true) {
  const answer = await fetch(location.href, { headers: { accept: "text/html" } });
  return showPage(await answer.text(), isWanted);
}
/* the work of another page in this one's place; band and STOP stay */
export function showPage(html, isWanted = () => true) {
  const next = new DOMParser().parseFromString(html, "text/html");
  if (!isWanted(next)) return false;
  if (!next.querySelector("#main")) return true;
  for (const selector of ["#main", "#steps"]) {
    const fresh = next.querySelector(selector),
      old = $(selector);
    if (fresh && old) old.replaceWith(fresh);
  }
  document.title = next.title;
  $("#main").focus({ preventScroll: true });
  scrollTo(0, 0);
  return true;
}
on("over", () => {
  place.phase = "…";
  follow("ended");
});

/* ---- STOP: on the press, at once, never asked back, never disabled; twice is harmless ---------------------------------- */
function note(text, seconds = 4) {
  stopPending = performance.now() + 1000 * seconds;
  put("stopsub", text);
  put("say", text);
}
export function stop(how) {
  note(say("sending …"), 6);
  if (!isOffline && send({ stop: how, run: place.run })) return;
  post(how);
}
async function post(how) {
  const url = place.run ? `/api/runs/${encodeURIComponent(place.run)}/stop` : "/api/stop";
  try {
    const answer = await fetch(url, {
      method: "POST",
      headers: { "content-type": "application/json" },
      body: JSON.stringify({ reason: how }),
      keepalive: true,
    });
    const said = await answer.json();
    if (answer.ok) stopped(said.stopped ?? [said]);
    else note(say("sent, not confirmed: emergency stop"), 10);
  } catch {
    note(say(isOffline || wasLive ? "cannot be sent: use the emergency stop" : "not sent: use the emergency stop"), 10);
  }
}
function stopped(runs) {
  if (runs.some((run) => !run.zero_volts)) note(say("sent, not confirmed: emergency stop"), 10);
  else if (runs.some((run) => run.after_s > 0))
    note(say("sent; zero volts confirmed after %s", number(Math.max(...runs.map((run) => run.after_s)), 2, "s")), 5);
  else note(say("sent; output was off already"), 3);
}
$("#stop").addEventListener("pointerdown", (event) => {
  if (event.button === 0) stop("STOP");
});
$("#stop").addEventListener("click", (event) => {
  event.preventDefault();
  if (event.detail === 0) stop("STOP");
});
$("#stopform").addEventListener("submit", (event) => {
  event.preventDefault();
});
document.addEventListener(
  "keydown",
  (event) => {
    if (event.key === "Escape") {
      event.preventDefault();
      stop("Esc");
      return;
    }
    const target = event.target;
    const typing =
      target.isContentEditable ||
      (/^(INPUT|TEXTAREA|SELECT)$/.test(target.tagName) && !/^(checkbox|radio|button|submit)$/.test(target.type));
    if (
      event.key === " " &&
      !event.repeat &&
      !typing &&
      (root.dataset.level === "live" || root.dataset.level === "alarm")
    ) {
      event.preventDefault();
      stop("Space");
    }
  },
  true,
);

/* ---- small helpers of forms -------------------------------------------------------------------------------------- */
document.addEventListener("submit", (event) => {
  const busy = event.target.dataset?.busy;
  if (busy && event.target.dataset.sent) event.preventDefault(); // pressed twice: once is enough
  else if (busy) {
    event.target.dataset.sent = "yes";
    setTimeout(() => delete event.target.dataset.sent, ONCE_MS); // where its answer was given up it may be pressed again
    const button = event.target.querySelector("button");
    button.textContent = busy;
    put("say", busy);
  }
});
