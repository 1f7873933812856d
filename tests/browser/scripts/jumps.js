// Notes how far each visible part of the page moves vertically, px.
() => {
  window.jumps = [];
  const said = (node) => (node?.textContent ?? "").trim().slice(0, 40) || node?.localName;
  // The handle of a slider, with its number, moves by itself.
  const PASSING = "[class*=st-key-working-], [data-testid=stSpinner], [data-testid=stSlider]";
  const passing = (node) => (node?.parentElement ?? node)?.closest?.(PASSING);
  window.jumping = new PerformanceObserver((list) => {
    const moved = list.getEntries().flatMap(({ sources }) => sources);
    for (const { node, previousRect: before, currentRect: now } of moved) {
      if (!before.height || !now.height || passing(node)) continue;
      jumps.push([Math.round(Math.abs(now.y - before.y)), said(node)]);
    }
  });
  jumping.observe({ type: "layout-shift" });
}
