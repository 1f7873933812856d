// A plan of both sensors and a draggable source, which shows the places that give the same lag.

const WIDE = 4; // width of the plan, as a multiple of the distance between the sensors
const HIGH = 300;
const STEP = 0.01;

const metres = (value) => value.toLocaleString("en", { maximumSignificantDigits: 4 });

export default function (component) {
  return shown(Plan, component);
}

class Plan {
  constructor(parent) {
    this.find = (selector) => parent.querySelector(selector);
    this.root = this.find(".plan");
    this.stage = this.find(".stage");
    this.svg = this.find("svg");
    this.range = this.find("input");
    this.range.addEventListener("input", () => this.spread(Number(this.range.value)));
    this.stage.addEventListener("keydown", (event) => this.type(event));
    this.stage.addEventListener("pointerdown", (event) => this.grab(event));
    this.stage.addEventListener("pointermove", (event) => this.held && this.move(this.placeOf(event)));
    for (const name of ["pointerup", "pointercancel"]) this.stage.addEventListener(name, () => this.release());
    this.resized = new ResizeObserver(() => this.draw());
    this.resized.observe(this.stage);
  }

  close() {
    this.resized.disconnect();
  }

  load(data) {
    const text = JSON.stringify(data);
    if (text === this.loaded) return; // the page ran again: the source stays where it was dragged
    this.loaded = text;
    this.data = data;
    for (const [name, colour] of Object.entries(data.colours)) this.root.style.setProperty(`--${name}`, colour);
    const places = {
      "In line": () => [-this.sign * this.apart, 0],
      "Beside": () => [-this.sign * this.apart * 0.6, this.apart * 0.3],
      "As far from both": () => [0, this.apart * 0.6],
    };
    this.find(".places").replaceChildren(...Object.entries(places).map(([name, place]) => {
      const button = Object.assign(document.createElement("button"), { type: "button", textContent: name });
      button.addEventListener("click", () => this.move(place()));
      return button;
    }));
    this.sign = data.difference < 0 ? -1 : 1;
    this.smallest = Math.abs(data.difference) || data.example;
    this.apart = this.smallest * Number(this.range.value);
    this.move(places["Beside"]());
  }

  // Moves the sensors further apart or closer together; the source keeps its place on the plan.
  spread(times) {
    const before = this.apart;
    this.apart = this.smallest * times;
    this.move(this.source.map((each) => (each * this.apart) / before));
  }

  move([x, y]) {
    const half = (WIDE / 2) * this.apart;
    const high = this.svg.clientWidth ? (half * HIGH) / this.svg.clientWidth : half;
    this.source = [clamp(x, -half, half), clamp(y, -high, high)];
    this.draw();
  }

  grab(event) {
    if (event.button) return;
    this.held = true;
    this.stage.setPointerCapture(event.pointerId);
    this.stage.classList.add("dragging");
    this.move(this.placeOf(event));
  }

  release() {
    this.held = false;
    this.stage.classList.remove("dragging");
  }

  placeOf(event) {
    const box = this.svg.getBoundingClientRect();
    const scale = (WIDE * this.apart) / box.width;
    return [(event.clientX - box.left - box.width / 2) * scale, (box.height / 2 - (event.clientY - box.top)) * scale];
  }

  type(event) {
    if (event.ctrlKey || event.metaKey || event.altKey) return;
    const ways = { ArrowLeft: [-1, 0], ArrowRight: [1, 0], ArrowUp: [0, 1], ArrowDown: [0, -1] };
    if (!(event.key in ways)) return;
    const far = this.apart * STEP * (event.shiftKey ? 10 : 1);
    this.move(this.source.map((each, axis) => each + far * ways[event.key][axis]));
    event.preventDefault();
  }

  draw() {
    const width = this.svg.clientWidth;
    if (!width || !this.source) return;
    const { apart, source } = this;
    const scale = width / (WIDE * apart);
    const at = ([x, y]) => [width / 2 + x * scale, HIGH / 2 - y * scale];
    const line = (points) => "M" + points.map((point) => at(point).map((each) => each.toFixed(1)).join(" ")).join("L");
    const difference = pathDifference(source, apart);
    const sensors = [[-apart / 2, 0], [apart / 2, 0]];
    const reach = WIDE * apart;
    const add = emptied(this.svg, width, HIGH);
    add("path", { class: "line", d: `M0 ${HIGH / 2}H${width}` });
    if (this.data.difference !== null) {
      add("path", { class: "measured", d: line(branch(this.data.difference, apart, reach)) });
    }
    add("path", { class: "same", d: line(branch(difference, apart, reach)) });
    for (const sensor of sensors) add("path", { class: "path", d: line([source, sensor]) });
    const farther = sensors[difference > 0 ? 1 : 0];
    const length = pathTo(source, farther[0]);
    const share = length ? Math.abs(difference) / length : 0;
    const turn = farther.map((each, axis) => each + (source[axis] - each) * share);
    add("path", { class: "longer", d: line([turn, farther]) });
    sensors.forEach((sensor, index) => {
      const [x, y] = at(sensor);
      add("circle", { class: `sensor-${index + 1}`, cx: x, cy: y, r: 7 });
      add("text", { x, y: y + 22 }, `sensor ${index + 1}`);
    });
    const [x, y] = at(source);
    add("circle", { class: "source", cx: x, cy: y, r: 9 });
    add("text", { x: clamp(x, 22, width - 22), y: y < 24 ? y + 24 : y - 14 }, "source");
    this.find("output").textContent = `${metres(apart)}\u00a0m`;
    this.say(difference);
  }

  say(difference) {
    const size = Math.abs(difference);
    const [later, earlier] = difference > 0 ? [2, 1] : [1, 2];
    const seconds = (size / this.data.speed).toLocaleString("en", { maximumSignificantDigits: 3 });
    const same = this.data.difference !== null && Math.abs(difference - this.data.difference) < 0.02 * this.apart;
    const words = size < 0.005 * this.apart
      ? "Both paths are equally long: the lag is 0, however far apart the sensors are."
      : `The path to sensor ${later} is ${metres(size)}\u00a0m longer: it hears the source ${seconds}\u00a0s after sensor ${earlier}. `
        + (size > 0.995 * this.apart
          ? "In line with the sensors, the path difference is their distance."
          : `The sensors are ${metres(this.apart)}\u00a0m apart, more than the path difference.`);
    const text = words + (same ? " This is your lag." : "");
    if (text !== this.find(".said").textContent) this.find(".said").textContent = text;
  }
}
