// The life of the panel of a component's element: created once, given the data of each run, closed at the end.

const panels = new WeakMap();

// `wire` sets the callbacks of a panel before it is given its data.
function shown(Panel, { data, parentElement }, wire) {
  let panel = panels.get(parentElement);
  if (!panel) panels.set(parentElement, (panel = new Panel(parentElement)));
  wire?.(panel);
  panel.load(data);
  return () => {
    panel.close?.();
    panels.delete(parentElement);
  };
}
