// Outlines over maps: lines that are thin at every zoom, light on dark, so that they are visible on every colour.
// They are a separate layer, so that a moving crosshair does not redraw them.

// Draws a path, px of the picture, over a layer, or removes it if empty; `view` is the viewBox of the zoom.
function outline(layer, path, view) {
  let svg = layer.querySelector(".outlines");
  if (!path) return svg?.remove();
  svg ??= drawn("svg", { class: "outlines", preserveAspectRatio: "none", "aria-hidden": true }, layer);
  if (svg.path !== path) {
    svg.path = path;
    svg.replaceChildren();
    for (const name of ["outline-halo", "outline"]) drawn("path", { class: name, d: path }, svg);
  }
  if (svg.view !== view) svg.setAttribute("viewBox", (svg.view = view));
}
