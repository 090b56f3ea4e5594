// Scales: from values to pixels, with round ticks.

function linearScale(low, high, from, to) {
  if (low === high) [low, high] = low === 0 ? [-1, 1] : [low - 0.1 * Math.abs(low), high + 0.1 * Math.abs(high)];
  const scale = (value) => from + ((value - low) / (high - low)) * (to - from);
  scale.ticks = (wanted) => {
    const rough = (high - low) / Math.max(wanted, 1),
      power = 10 ** Math.floor(Math.log10(rough));
    const step = [1, 2, 5, 10].map((factor) => factor * power).find((size) => size >= rough * 0.999);
    const first = Math.ceil(low / step - 1e-9);
    const ticks = [];
    for (let i = first; i * step <= high + 1e-9 * step; i++) ticks.push(Number((i * step).toPrecision(12)));
    return ticks;
  };
  return scale;
}

function logScale(low, high, from, to) {
  if (low === high) [low, high] = [low / 2, high * 2];
  const inner = linearScale(Math.log10(low), Math.log10(high), from, to);
  const scale = (value) => inner(Math.log10(value));
  scale.ticks = (wanted) => {
    const decades = Math.log10(high / low);
    const digits = decades < 1.2 ? [1, 2, 3, 5, 7] : decades < 3 ? [1, 2, 5] : [1];
    const stride = Math.max(1, Math.ceil(decades / Math.max(wanted, 1)));
    const ticks = [];
    for (let power = Math.floor(Math.log10(low)); power <= Math.log10(high); power++) {
      if (digits.length === 1 && power % stride) continue;
      digits.forEach((digit) => ticks.push(Number((digit * 10 ** power).toPrecision(6))));
    }
    const inside = ticks.filter((tick) => tick >= low * 0.9999 && tick <= high * 1.0001);
    return inside.length >= 2 ? inside : linearScale(low, high, from, to).ticks(wanted);
  };
  return scale;
}

function pointScale(values, from, to) {
  const index = new Map(values.map((value, i) => [value, i]));
  const step = (to - from) / Math.max(values.length, 1);
  const scale = (value) => from + step * (index.get(value) + 0.5);
  scale.ticks = (wanted) => values.filter((_, i) => i % Math.ceil(values.length / Math.max(wanted, 1)) === 0);
  return scale;
}

// Values as a scale wants them: numbers where all are, else names in order.
function scaleFor(values, from, to, log = null) {
  const known = [...new Set(values.filter((value) => value !== undefined && value !== null))];
  if (known.length && known.every(isNumber)) {
    const low = Math.min(...known),
      high = Math.max(...known);
    const isWide = low > 0 && high / low > 20;
    const pad = (high - low) * 0.04;
    if (low > 0 && (log ?? isWide)) return logScale(low / (high / low) ** 0.03, high * (high / low) ** 0.03, from, to);
    return linearScale(low - pad, high + pad, from, to);
  }
  known.sort((a, b) => String(a).localeCompare(String(b), "en", { numeric: true }));
  return pointScale(known, from, to);
}
