// Two sensors on the line y = 0, `apart` metres apart and centred on 0, and a source anywhere.

/** @type {(source: number[], sensor: number) => number} */
export const pathTo = ([x, y], sensor) => Math.hypot(x - sensor, y);

// How much longer the path to sensor 2 is than the path to sensor 1, metres.
export const pathDifference = (source, apart) => pathTo(source, apart / 2) - pathTo(source, -apart / 2);

// Points of the branch of the hyperbola of all sources with this path difference, up to `reach` from the middle.
export function branch(difference, apart, reach) {
  const a = Math.min(Math.abs(difference), apart) / 2;
  const b = Math.sqrt(Math.max(0, (apart / 2) ** 2 - a ** 2));
  const side = difference > 0 ? -1 : 1; // nearer to sensor 1 if the path to sensor 2 is longer
  const far = Math.acosh(Math.max(1, (2 * reach) / apart)) + 2;
  const along = Array.from({ length: 121 }, (_, step) => (far * (step - 60)) / 60);
  return along.map((t) => [side * a * Math.cosh(t), b * Math.sinh(t)]);
}
