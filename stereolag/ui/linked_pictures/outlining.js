// Outlines over maps: thin lines at every zoom, a light one on a dark one, so that they are seen on every colour.
// They are a layer of their own: a crosshair that moves over them does not draw them anew.

// Lays a path, px of the picture, over what a layer shows, or takes it away; `view` is the viewBox of the zoom.
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
