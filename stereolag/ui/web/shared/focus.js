// Keeps the keyboard focus through a run of the page. Streamlit disables a tab for a moment while a run redraws its
// panel, so that it loses the focus, and may replace a control by a new one: the next key would begin at the top.

const [PAUSE_MS, PATIENCE_MS] = [50, 3000];
let watched = false;
let pressed = false;

const taken = (one) => !one.isConnected || one.matches("[disabled], [aria-disabled=true], :not([tabindex], input, button)");

/** Return a function that finds a control again: the control itself, or the one that replaced it. */
function finder(one) {
  const [role, name] = [one.getAttribute("role"), one.textContent];
  const at = [...(one.closest("[class*=st-key-]")?.classList ?? [])].find((word) => word.startsWith("st-key-"));
  const alike = (other) => other.textContent === name;
  return () => {
    if (one.isConnected) return one;
    return role && at ? [...document.querySelectorAll(`.${CSS.escape(at)} [role=${role}]`)].find(alike) : null;
  };
}

function giveBack(find, end) {
  if (pressed || document.activeElement !== document.body || performance.now() > end) return;
  const found = find();
  if (found && !taken(found)) found.focus({ preventScroll: true });
  else setTimeout(() => giveBack(find, end), PAUSE_MS);
}

/** Give a control back the focus that a run of the page took from it, unless the visitor has moved on meanwhile. */
export function keepFocus() {
  if (watched) return;
  watched = true;
  for (const type of ["pointerdown", "pointerup", "pointercancel"]) {
    document.addEventListener(type, () => { pressed = type === "pointerdown"; }, true);
  }
  document.addEventListener("focusout", ({ target, relatedTarget }) => {
    if (pressed || relatedTarget || !(target instanceof Element) || !document.hasFocus()) return;
    const find = finder(target);
    const end = performance.now() + PATIENCE_MS;
    const early = taken(target);
    requestAnimationFrame(() => { if (early || taken(target)) giveBack(find, end); });
  }, true);
}
