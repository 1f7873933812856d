// A camera that films a seeded scene: a sign moves, is covered, goes out of the picture and comes back, beside one like it.
// It takes its next picture once the one before was answered, so that answers and pictures go together.
(() => {
  const [COLS, ROWS, SIDE, LAST] = [400, 300, 40, 60];
  const COVERED = [11, 22];
  const AWAY = [30, 52];
  let seed = 7;
  const random = () => (seed = (seed * 1103515245 + 12345) % 2147483648) / 2147483648;
  const drawing = (cols, rows) => new OffscreenCanvas(cols, rows).getContext("2d");
  const within = (number, [first, end]) => number >= first && number < end;

  const ground = drawing(COLS, ROWS);
  for (let row = 0; row < ROWS; row += 6) {
    for (let col = 0; col < COLS; col += 6) {
      ground.fillStyle = `rgb(${[0, 0, 0].map(() => Math.floor(40 + 160 * random())).join()})`;
      ground.fillRect(col, row, 7, 7);
    }
  }
  const sign = (sibling) => {
    const drawn = drawing(SIDE, SIDE);
    drawn.scale(SIDE / 64, SIDE / 64); // drawn on a grid of 64 cells
    drawn.fillStyle = "#d8d2c0";
    drawn.fillRect(0, 0, 64, 64);
    drawn.strokeStyle = "#203048";
    drawn.lineWidth = 5;
    drawn.strokeRect(2.5, 2.5, 59, 59);
    const last = sibling ? [46, 48] : [14, 50];
    for (const [x, y, r, colour] of [[20, 20, 8, "#b03028"], [44, 24, 6, "#2870a8"], [30, 44, 9, "#388048"], [...last, 6, "#604080"]]) {
      drawn.fillStyle = colour;
      drawn.beginPath();
      drawn.arc(x, y, r, 0, 7);
      drawn.fill();
    }
    return drawn.canvas;
  };
  const [own, other] = [sign(false), sign(true)];

  const camera = Object.assign(document.createElement("canvas"), { width: COLS, height: ROWS });
  const context = camera.getContext("2d");
  const placeAt = (number) => {
    const turn = (2 * Math.PI * number) / 75;
    const away = within(number, AWAY) ? 1.1 * COLS * Math.sin((Math.PI * (number - AWAY[0])) / (AWAY[1] - AWAY[0])) : 0;
    return { row: ROWS * (0.45 + 0.28 * Math.sin(1.3 * turn)), col: COLS * (0.5 + 0.33 * Math.cos(turn)) + away };
  };
  const isUnseen = (number) => within(number, COVERED) || placeAt(number).col > COLS + SIDE / 2;
  const paint = (number) => {
    const { row, col } = placeAt(number);
    context.drawImage(ground.canvas, 0, 0);
    context.drawImage(other, 0.14 * COLS, 0.79 * ROWS);
    const side = SIDE * (1 + 0.05 * Math.sin(number / 30));
    context.drawImage(own, col - side / 2, row - side / 2, side, side);
    context.fillStyle = "#506888";
    if (within(number, COVERED)) context.fillRect(col - SIDE, row - SIDE, 2 * SIDE, 2 * SIDE);
    context.fillStyle = `rgba(0, 0, 0, ${0.12 + 0.12 * Math.sin(number / 11)})`; // the light changes
    context.fillRect(0, 0, COLS, ROWS);
    for (let bit = 0; bit < 8; bit++) {
      context.fillStyle = (number >> bit) & 1 ? "#fff" : "#000"; // which picture it is, read when it is sent
      context.fillRect(8 * bit, 0, 8, 8);
    }
  };

  const sent = []; // numbers of the pictures that are not answered yet
  const scene = { number: 0, told: [], placeAt, AWAY, COLS, SIDE, LAST };
  /** @type {any} */ (window).scene = scene;
  const take = () => paint(scene.number); // what is painted is the camera's next picture
  navigator.mediaDevices.getUserMedia = async () => {
    Object.assign(scene, { number: 0, told: [] });
    sent.length = 0;
    const waiting = setInterval(() => (scene.told.length + sent.length ? clearInterval(waiting) : take()), 50);
    return camera.captureStream();
  };
  navigator.mediaDevices.enumerateDevices = async () => [];

  const Socket = window.WebSocket;
  window.WebSocket = class extends Socket {
    constructor(...given) {
      super(...given);
      if (!String(given[0]).endsWith("/live")) return;
      this.addEventListener("message", ({ data }) => {
        if (typeof data === "string") return;
        const length = new DataView(data).getUint32(0, true);
        const { state, place, score, error } = JSON.parse(new TextDecoder().decode(new Uint8Array(data, 4, length)));
        const number = sent.shift();
        scene.told.push({ number, state, place, score, error, truth: placeAt(number), unseen: isUnseen(number) });
        if (number !== scene.number) return; // an older picture once more
        if (scene.number < LAST) scene.number += 1;
        take();
      });
    }
  };

  const encode = OffscreenCanvas.prototype.convertToBlob;
  OffscreenCanvas.prototype.convertToBlob = function (...given) {
    const { data } = this.getContext("2d").getImageData(0, 4, 64, 1);
    sent.push(Array.from({ length: 8 }, (_, bit) => Number(data[4 * (8 * bit + 4)] > 128) << bit).reduce((one, other) => one + other));
    return encode.apply(this, given);
  };
})();
