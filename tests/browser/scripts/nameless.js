// Visible pictures, drawings and charts that are neither named nor decoration.
() => {
  const drawings = "img, canvas, svg, [data-testid=stPlotlyChart]";
  const named = (one) => (one.matches("img") ? one.hasAttribute("alt") : one.getAttribute("aria-label"));
  // A button has the name of all that is in it, and a table its own for readers; the last is no part of the page.
  const excused = (one) =>
    one.closest("[aria-hidden=true], [role=img] *, button, [role=button], [data-testid=stDataFrame], #js-plotly-tester")
    || one.parentElement?.closest("[data-testid=stPlotlyChart]");
  const within = (root) => [...root.querySelectorAll("*")].flatMap((one) => [one, ...(one.shadowRoot ? within(one.shadowRoot) : [])]);
  return within(document)
    .filter((one) => one.matches(drawings) && one.checkVisibility() && !excused(one) && !named(one))
    .map((one) => one.outerHTML.slice(0, 120));
}
