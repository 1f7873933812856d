// What axe finds: each violated rule with its impact, the elements, and why each fails.
// Charts are emptied meanwhile: axe judges no text in drawings, but reads each of their thousands of parts.
async ([include, exclude, options]) => {
  const charts = [...document.querySelectorAll(".js-plotly-plot .main-svg")].map((one) => [one, [...one.childNodes]]);
  for (const [chart] of charts) chart.replaceChildren();
  try {
    const { violations } = await axe.run({ include, exclude }, options);
    return violations.map(({ id, impact, nodes }) => {
      const elements = nodes.map(({ target, failureSummary }) => [target.flat().join(" >> "), failureSummary]);
      return { rule: id, impact, elements };
    });
  } finally {
    for (const [chart, parts] of charts) chart.replaceChildren(...parts);
  }
}
