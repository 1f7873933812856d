// Follows the focus through a page: the stops of the Tab key, and whether the focus is visible at each.
(() => {
  document.body.tabIndex = -1; // from the beginning, wherever the focus was
  document.body.focus();
  document.body.removeAttribute("tabindex");
  if (window.walk) {
    Object.assign(window.walk, { stops: [], done: false });
    return;
  }
  const LOOK = ["outlineStyle", "outlineWidth", "outlineColor", "boxShadow", "borderTopColor", "borderBottomColor"];
  const AROUND = 4; // enclosing elements that may be framed in place of the focused one

  const still = document.createElement("style");
  still.textContent = "* { transition: none !important }"; // a frame fades in, but must be visible at once
  document.head.append(still);

  const focused = () => {
    let one = document.activeElement;
    while (one?.shadowRoot?.activeElement) one = one.shadowRoot.activeElement;
    return one;
  };
  const all = (root) => [...root.querySelectorAll("*")].flatMap((one) => (one.shadowRoot ? [one, ...all(one.shadowRoot)] : [one]));
  const look = (one) => {
    const style = getComputedStyle(one);
    return LOOK.map((name) => style[name]).join();
  };
  const seen = (one) => one.checkVisibility({ visibilityProperty: true }) && one.getBoundingClientRect().width > 0;
  const around = (one) => {
    const found = [one, one.nextElementSibling].filter(Boolean);
    for (let out = one.parentElement; out && found.length < AROUND + 2; out = out.parentElement) found.push(out);
    return found;
  };
  const named = (one) => {
    const labels = [...(one.labels ?? [])].map((label) => label.textContent).join(" ");
    const text = one.getAttribute("aria-label") || labels || (one.matches("main") ? "" : one.textContent) || one.title || "";
    return `${one.getAttribute("role") ?? one.localName} ${text.trim().replace(/\s+/g, " ")}`;
  };

  let last = null;
  const walk = (window.walk = { stops: [], done: false });

  // Compares the look of the last stop with and without the focus.
  walk.leave = () => {
    if (last) last.framed = last.looks.some(([one, before]) => look(one) !== before);
    last = null;
  };
  addEventListener("keydown", ({ key }) => {
    if (key !== "Tab") return;
    walk.leave();
    const one = focused();
    walk.done ||= walk.ended();
    if (walk.done || one === document.body) return;
    last = { one, looks: around(one).map((each) => [each, look(each)]) };
    walk.stops.push(last);
  }, true);

  // Past the last control, or back at the first.
  walk.ended = () => walk.done || (walk.stops.length > 0 && [document.body, walk.stops[0].one].includes(focused()));
  walk.told = () => walk.stops.map(({ one, framed }) => ({ name: named(one), framed, tag: one.localName }));

  // The controls at which Tab did not stop; one stop is enough for a group traversed with the arrow keys.
  walk.missed = () => {
    const CONTROLS = "a[href], button, input, select, textarea, summary, [tabindex], [role=slider], [role=button], [role=tab], [role=radio], [role=combobox]";
    const GROUPS = "[role=tablist], [role=radiogroup], [role=toolbar], [role=listbox], [role=grid], [data-testid=stNumberInputContainer], .react-aria-ComboBox";
    const stops = new Set(walk.stops.map(({ one }) => one));
    const byArrows = (one) => [...stops].some((stop) => one.closest(GROUPS)?.contains(stop));
    const can = (one) => one.matches(CONTROLS) && !one.disabled && !one.closest("[inert], [aria-disabled=true]");
    return all(document).filter((one) => can(one) && seen(one) && !stops.has(one) && !byArrows(one)).map(named);
  };
})();
