// The legend of a picture's colours.

import { html } from "./lit_html.js";

export const legend = ({ title, colours, words, strip, ticks, picture }) => html`
  <div class="legend ${strip && !picture ? "along" : ""}">
    ${title ? html`<span class="title">${title}</span>` : ""}
    ${picture ? html`<img class="wheel" src=${picture} alt=${words[0]} /><span>${words[0]}</span>` : ""}
    ${strip && !picture ? html`
      ${words[0]}
      <span class="scale">
        <span class="strip" style="background: linear-gradient(to right, ${colours.join(", ")})"></span>
        <span class="ticks ${ticks.some(([, , below]) => below) ? "two" : ""}">${ticks.map(([share, word, below]) => html`
          <span style="left: ${100 * share}%">${word}${below ? html`<br />${below}` : ""}</span>`)}</span>
      </span>
      ${words[1]}` : ""}
    ${strip || picture ? "" : colours.map((colour, at) => html`
      <span><span class="swatch" style="background: ${colour}"></span>${words[at]}</span>`)}
  </div>`;
