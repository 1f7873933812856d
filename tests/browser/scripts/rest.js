// Resolves once the page was found finished three times, each time idle: a message from the server or a click may still
// be queued, on a busy machine for long.
async (patience) => {
  const none = (selector) => !document.querySelector(selector);
  const waitsFor = () => [
    ...Object.entries(awaited).filter(([, value]) => value === true).map(([name]) => name),
    ...[...awaited.timers].map((timer) => `timer ${timer}`),
  ];
  const finished = () => !waitsFor().length && !none("h1")
    && document.querySelector("[data-testid=stApp]")?.dataset.testScriptState === "notRunning"
    && none("[data-testid=stSkeleton], [data-testid=stSpinner], [class*=st-key-results-cancel]")
    && [...document.querySelectorAll("[data-testid=stPlotlyChart]")].every((chart) => chart.querySelector("svg"))
    && [...document.images].every((image) => image.complete)
    // A fold opens by an animation whatever one prefers; a click meanwhile goes down on a button and up beside it.
    && !document.getAnimations().some(({ playState, effect }) =>
      playState === "running" && effect.getComputedTiming().endTime < Infinity);
  const last = { priority: "background" };
  const idle = () => new Promise((done) => requestAnimationFrame(() => scheduler.postTask(done, last)));
  const pause = () => scheduler.postTask(() => {}, { delay: 40 }); // each frame that is asked for takes the processor
  const end = performance.now() + patience;
  for (let times = 0; times < 3; times = finished() ? times + 1 : 0) {
    if (performance.now() > end) throw new Error(`still busy after ${patience} ms: ${waitsFor()}`);
    await (finished() ? idle() : pause());
  }
}
