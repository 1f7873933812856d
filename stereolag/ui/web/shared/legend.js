// The legend of a picture's colours.

import { element } from "./dom.js";

export function legend({ title, colours, words, strip, ticks, picture }) {
  const box = element("div", strip ? "legend along" : "legend", ...(title ? [element("span", "title", title)] : []));
  if (picture) {
    const wheel = Object.assign(element("img", "wheel"), { src: picture, alt: words[0] });
    box.append(wheel, element("span", "", words[0]));
  } else if (strip) {
    const bar = element("span", "strip");
    bar.style.background = `linear-gradient(to right, ${colours.join(", ")})`;
    const scale = element("span", "ticks", ...ticks.map(([share, word, below]) => {
      const tick = element("span", "", word, ...(below ? [element("br"), below] : []));
      tick.style.left = `${100 * share}%`;
      return tick;
    }));
    if (ticks.some(([, , below]) => below)) scale.classList.add("two");
    box.append(words[0], element("span", "scale", bar, scale), words[1]);
  } else {
    colours.forEach((colour, index) => {
      const swatch = element("span", "swatch");
      swatch.style.background = colour;
      box.append(element("span", "", swatch, words[index]));
    });
  }
  return box;
}
