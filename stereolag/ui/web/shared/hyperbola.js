// Two sensors and a source; all lengths are in units of the sensor spacing, and the sensors lie on the line y = 0.

export const SENSORS = [[-0.5, 0], [0.5, 0]];

const FAR = 4.8; // of the parameter along a branch, so that it ends far outside every drawing

/** @type {(source: number[], sensor: number[]) => number} */
export const pathTo = ([x, y], [atX, atY]) => Math.hypot(x - atX, y - atY);

// How much longer the path to sensor 2 is than the path to sensor 1.
export const pathDifference = (source) => pathTo(source, SENSORS[1]) - pathTo(source, SENSORS[0]);

// Points of the branch of the hyperbola of all sources with this path difference.
export function branch(difference) {
  const a = Math.min(Math.abs(difference), 1) / 2;
  const b = Math.sqrt(0.25 - a ** 2);
  const side = difference > 0 ? -1 : 1; // nearer to sensor 1 if the path to sensor 2 is longer
  const along = Array.from({ length: 121 }, (_, step) => (FAR * (step - 60)) / 60);
  return along.map((t) => [side * a * Math.cosh(t), b * Math.sinh(t)]);
}
