// Number formatting, as in stereolag/core/typography.py.

// Thousands separators, a true minus sign but none before zero, "–" for NaN, and a no-break space before the unit.
function shortened(number, digits = 0, unit = "") {
  if (Number.isNaN(number)) return "–";
  const text = number.toLocaleString("en", { minimumFractionDigits: digits, maximumFractionDigits: digits });
  return text.replace(/^-(?=[0.,]*$)/, "").replace("-", "−") + (unit && `\u00a0${unit}`);
}
