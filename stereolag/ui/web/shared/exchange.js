// What components pass to each other on a page, whichever of them is there first. Every item has a kind and a name; it
// stays as long as the component that brought it, and each change is an event of the window.

/** @returns {Map<string, any>} */
const itemsOf = (kind) => ((/** @type {any} */ (window).stereolagItems ??= {})[kind] ??= new Map());

export const eventOf = (kind) => `stereolag-${kind}`;

export function tell(kind, detail) {
  window.dispatchEvent(new CustomEvent(eventOf(kind), { detail }));
}

/** @returns {any} */
export const received = (kind, name) => itemsOf(kind).get(name)?.item;

// Keeps an item for a holder, an object; the previous item of this holder goes, unless others hold it too.
const held = new WeakMap();

export function hold(kind, name, item, holder) {
  const before = held.get(holder);
  if (before !== name) {
    held.set(holder, name);
    const holders = (itemsOf(kind).get(name)?.holders ?? 0) + 1;
    itemsOf(kind).set(name, { item, holders });
    if (before !== undefined) drop(kind, before);
  } else itemsOf(kind).get(name).item = item;
  tell(kind, { name, before, item });
}

export function release(kind, holder) {
  if (!held.has(holder)) return;
  const name = held.get(holder);
  held.delete(holder);
  if (drop(kind, name)) tell(kind, { name });
}

function drop(kind, name) {
  const one = itemsOf(kind).get(name);
  one.holders -= 1;
  return one.holders === 0 && itemsOf(kind).delete(name);
}
