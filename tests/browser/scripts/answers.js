// Tracks in a page what it waits for: the server's first message about a requested run, the end of that run, the
// address for a file, and the page's own short timers, with which a slider delays what it sends.
const field = (bytes, start) => {
  let [value, shift, at] = [0, 0, start];
  do { value += (bytes[at] & 127) * 2 ** shift; shift += 7; } while (bytes[at++] & 128);
  return [value, at];
};
const fields = (bytes) => {
  const found = new Map();
  for (let at = 0, tag, size; at < bytes.length;) {
    [tag, at] = field(bytes, at);
    [size, at] = [0, 1, 5].includes(tag & 7) ? { 0: field(bytes, at), 1: [8, at], 5: [4, at] }[tag & 7]
      : field(bytes, at);
    found.set(tag >> 3, tag & 7 ? bytes.subarray(at, at + size) : size);
    at += tag & 7 ? size : 0;
  }
  return found;
};
const message = (data) => fields(new Uint8Array(data.buffer ?? data, data.byteOffset ?? 0, data.byteLength));
const [RERUN_SCRIPT, FILE_URLS_REQUEST, NEW_SESSION, SCRIPT_FINISHED] = [11, 16, 4, 6];
const AUTOMATIC = 6;
const awaited = window.awaited = { answer: false, run: false, upload: false, timers: new Set() };
const send = WebSocket.prototype.send;
WebSocket.prototype.send = function (data) {
  if (!this.url.endsWith("/_stcore/stream")) return send.call(this, data); // a live stream, which takes no run
  if (!this.watched) this.addEventListener("message", ({ data }) => {
    const told = message(data);
    if (told.has(NEW_SESSION)) [awaited.answer, awaited.run] = [false, true];
    if (told.has(SCRIPT_FINISHED)) awaited.run = false;
  });
  this.watched = true;
  const asked = message(data);
  const rerun = asked.get(RERUN_SCRIPT);
  // A part of the page that asks again by itself is not answered when a run has removed it.
  if (rerun && !fields(rerun).get(AUTOMATIC)) [awaited.answer, awaited.upload] = [true, false];
  if (asked.has(FILE_URLS_REQUEST)) awaited.upload = true;
  return send.call(this, data);
};
const [setTimer, clearTimer] = [window.setTimeout, window.clearTimeout];
window.setTimeout = (call, delay, ...given) => {
  const timer = setTimer(() => { awaited.timers.delete(timer); call(...given); }, delay);
  if (delay > 50 && delay <= 500) awaited.timers.add(timer);
  return timer;
};
window.clearTimeout = (timer) => { awaited.timers.delete(timer); clearTimer(timer); };
