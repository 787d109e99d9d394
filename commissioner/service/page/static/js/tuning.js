/* A drive's own tuning: the same page anew when a repeat is done or the person at the drive is asked something. */
import { on, renew } from "./page.js";

let newest = null,
  isRenewing = false;
const isOld = () => {
  const shown = document.querySelector("#tuning")?.dataset.shown;
  return shown !== undefined && newest !== null && shown !== `${newest.done} ${newest.question ?? ""}`;
};
on("live", async (live) => {
  newest = live.tuning;
  if (isRenewing) return;
  isRenewing = true;
  try {
    while (isOld() && (await renew())) await new Promise((done) => setTimeout(done, 200));
  } finally {
    isRenewing = false;
  }
});
