// Items that the components of a page pass to each other, in whatever order they load. Every item has a kind and a name;
// it stays as long as the component that brought it, its holder, and each change is an event of the window.

const itemsByHolder = () => (/** @type {any} */ (window).stereolagItems ??= new Map());

export const eventOf = (kind) => `stereolag-${kind}`;

export function tell(kind, detail) {
  window.dispatchEvent(new CustomEvent(eventOf(kind), { detail }));
}

// The last item that came under a name.
export const received = (kind, name) =>
  [...itemsByHolder().values()].findLast((one) => one.kind === kind && one.name === name)?.item;

// Keeps an item for its holder, an object, in place of the previous one.
export function hold(kind, name, item, holder) {
  const before = itemsByHolder().get(holder)?.name;
  itemsByHolder().delete(holder);
  itemsByHolder().set(holder, { kind, name, item });
  tell(kind, { name, before, item });
}

export function release(holder) {
  const { kind, name } = itemsByHolder().get(holder) ?? {};
  if (itemsByHolder().delete(holder) && !received(kind, name)) tell(kind, { name });
}
