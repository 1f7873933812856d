// Numbers and their texts, formatted as in stereolag/core/typography.py.

/** @type {(value: number, low: number, high: number) => number} */
export const clamp = (value, low, high) => Math.min(Math.max(value, low), high);

export const total = (values) => values.reduce((sum, value) => sum + value, 0);

// Thousands separators, a true minus sign but none before zero, "–" for NaN, and a no-break space before the unit.
export function shortened(number, digits = 0, unit = "") {
  if (Number.isNaN(number)) return "–";
  const text = number.toLocaleString("en", { minimumFractionDigits: digits, maximumFractionDigits: digits });
  return text.replace(/^-(?=[0.,]*$)/, "").replace("-", "−") + (unit && `\u00a0${unit}`);
}

// A text with each {name} replaced by the value of that name.
export const filled = (text, values) => text.replace(/\{(\w+)\}/g, (_, name) => values[name]);

// The round whole numbers from `first` to `last`, at least `least` apart.
export function ticks(first, last, least) {
  const power = 10 ** Math.floor(Math.log10(Math.max(least, 1)));
  const step = [1, 2, 5, 10].map((times) => times * power).find((each) => each >= least);
  const begin = Math.ceil(first / step);
  return Array.from({ length: Math.floor(last / step) - begin + 1 }, (_, at) => (begin + at) * step);
}
