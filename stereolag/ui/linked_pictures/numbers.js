// Numbers as they are read, as stereolag/typography.py sets them.

// Thousands apart, a true minus sign but none before zero, "–" for none, and a unit that no line break parts from it.
function shortened(number, digits = 0, unit = "") {
  if (Number.isNaN(number)) return "–";
  const text = number.toLocaleString("en", { minimumFractionDigits: digits, maximumFractionDigits: digits });
  return text.replace(/^-(?=[0.,]*$)/, "").replace("-", "−") + (unit && `\u00a0${unit}`);
}
