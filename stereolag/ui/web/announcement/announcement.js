// The page's only live region. It stays outside the re-rendered content because a new region is not read aloud.

import { keepFocus } from "../shared/focus.js";

const REST_MS = 600; // a dragged slider must not be read out at every step
let waiting;

function region() {
  const found = document.getElementById("stereolag-announced");
  if (found) return found;
  const made = Object.assign(document.createElement("div"), { id: "stereolag-announced", role: "status", ariaLive: "polite" });
  made.style.cssText = "position: fixed; width: 1px; height: 1px; overflow: hidden; clip-path: inset(50%); white-space: nowrap";
  document.body.append(made);
  return made;
}

export default function ({ data }) {
  keepFocus();
  const told = region();
  clearTimeout(waiting);
  waiting = setTimeout(() => {
    if (told.textContent !== data) told.textContent = data;
  }, REST_MS);
  return () => {
    clearTimeout(waiting);
    told.textContent = "";
  };
}
