// Numbers, durations and names as people read them.

const SUPERSCRIPTS = "⁰¹²³⁴⁵⁶⁷⁸⁹";
const MISSING = "–";

function isNumber(value) {
  return typeof value === "number" && Number.isFinite(value);
}

function showNumber(value, digits = 4) {
  if (!isNumber(value)) return MISSING;
  if (Number.isInteger(value) && Math.abs(value) < 1e15) return value.toLocaleString("en-GB").replaceAll(",", "\u202f");
  const size = Math.abs(value);
  if (size !== 0 && (size < 1e-4 || size >= 1e6)) {
    const [mantissa, exponent] = value.toExponential(digits - 2).split("e");
    return `${mantissa} × 10${superscript(Number(exponent))}`;
  }
  return String(Number(value.toPrecision(digits)));
}

function superscript(exponent) {
  const digits = [...String(Math.abs(exponent))].map((digit) => SUPERSCRIPTS[digit]).join("");
  return (exponent < 0 ? "⁻" : "") + digits;
}

function showTick(value) {
  if (value === 0) return "0";
  const size = Math.abs(value);
  if (size >= 1e5 || size < 1e-4) {
    const exponent = Math.floor(Math.log10(size) + 1e-9);
    const mantissa = Number((value / 10 ** exponent).toPrecision(3));
    return (mantissa === 1 ? "" : `${mantissa}·`) + `10${superscript(exponent)}`;
  }
  return String(Number(value.toPrecision(4)));
}

function showSeconds(seconds) {
  if (!isNumber(seconds)) return MISSING;
  if (seconds < 100) return `${Number(seconds.toPrecision(2))} s`;
  if (seconds < 6000) return `${Math.round(seconds / 60)} min`;
  return `${(seconds / 3600).toFixed(1)} h`;
}

function showScale(scale) {
  return scale === 1 ? "" : ` × 10${superscript(Math.round(Math.log10(scale)))}`;
}

function showSetting(value) {
  if (value === null) return "auto";
  if (value === undefined) return MISSING;
  return typeof value === "number" ? showNumber(value) : String(value);
}

// "denoise/sbp/cd_sum2" is how it is logged; a column needs less.
const METRIC_NAMES = {
  cd_sum2: "CD",
  cd_mean2: "CD (mean)",
  cd_sum1: "L1CD (sum)",
  cd_mean1: "L1CD",
  cd_p2s: "CD (Points2Surf)",
  p2m: "P2M",
  nc: "NC",
  fscore: "F-score",
  hausdorff: "Hausdorff",
  validation: "held-out distance",
  validation_relative: "held-out distance / noise",
  seconds: "seconds",
  distance: "distance",
  memory_gib: "memory (GiB)",
  steps_per_second: "steps / s",
};
const HIGHER_IS_BETTER = new Set(["nc", "nc_inflated", "fscore", "precision", "recall", "steps_per_second"]);

function showMetric(name) {
  const parts = name.split("/");
  const metric = METRIC_NAMES[parts.at(-1)] ?? parts.at(-1).replaceAll("_", " ");
  return parts.length === 3 ? `${parts[0]} ${metric}` : metric;
}

function showKey(key) {
  if (key === "datamodule.name") return "data";
  return key.replace(/^datamodule\./, "").replace(/\.name$/, "");
}

function isHigherBetter(name) {
  return HIGHER_IS_BETTER.has(name.split("/").at(-1));
}

function count(number, noun) {
  return `${showNumber(number)} ${noun}${number === 1 ? "" : "s"}`;
}
