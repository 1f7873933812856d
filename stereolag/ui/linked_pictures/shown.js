// What a component does with the panel of its element: makes it once, hands it the data of each run, closes it in the end.

const panels = new WeakMap();

// `wire` tells a panel whom to answer, before it is given its data.
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
