// The parts that stick out of the page, or are cut off without an ellipsis.
() => {
  const main = document.querySelector("[data-testid=stMainBlockContainer]");
  const edge = main.getBoundingClientRect().right + 1;
  const inside = (one) => (one.shadowRoot ? [one, ...all(one.shadowRoot)] : [one]);
  const all = (root) => [...root.querySelectorAll("*")].flatMap(inside);
  const named = (one) => `${one.localName} ${one.textContent.trim().slice(0, 40)}`;
  const handle = (one) => one.matches("input[type=range], input[type=file]"); // drawn by what is around it
  return all(main).filter((one) => {
    if (!one.checkVisibility({ visibilityProperty: true }) || handle(one)) return false;
    const { width, right } = one.getBoundingClientRect();
    const { overflowX, textOverflow } = getComputedStyle(one);
    const clips = ["hidden", "clip"].includes(overflowX) && textOverflow !== "ellipsis" && one.innerText?.trim();
    return width > 1 && (right > edge || (clips && one.scrollWidth > one.clientWidth + 1));
  }).map(named);
}
