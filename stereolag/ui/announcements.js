// The one live region of the page. It lies outside of what is drawn anew, for a region that is new is not read aloud.

const REST_MS = 600; // a slider that is dragged is not read out at every step
let waiting;

function region() {
  const found = document.getElementById("stereolag-announced");
  if (found) return found;
  const made = document.createElement("div");
  made.id = "stereolag-announced";
  made.setAttribute("role", "status");
  made.setAttribute("aria-live", "polite");
  made.style.cssText = "position: fixed; width: 1px; height: 1px; overflow: hidden; clip-path: inset(50%); white-space: nowrap";
  document.body.append(made);
  return made;
}

export default function ({ data }) {
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
