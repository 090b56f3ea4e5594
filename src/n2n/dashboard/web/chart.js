// A frame with axes and grid lines, and the box that says what the pointer is at.

const MARGIN = { top: 10, right: 14, bottom: 38, left: 64 };

function frame(width, height, x, y, xLabel, yLabel, name) {
  const svg = s("svg", { width, height, viewBox: `0 0 ${width} ${height}`, role: "img", "aria-label": name });
  const bottom = height - MARGIN.bottom,
    right = width - MARGIN.right;
  for (const tick of y.ticks(5)) {
    const at = y(tick);
    svg.append(
      s("line", { class: "grid", x1: MARGIN.left, x2: right, y1: at, y2: at }),
      s(
        "text",
        { class: "tick", x: MARGIN.left - 7, y: at, "text-anchor": "end", "dominant-baseline": "central" },
        showAny(tick),
      ),
    );
  }
  for (const tick of x.ticks(Math.max(2, Math.floor((right - MARGIN.left) / 80)))) {
    const at = x(tick);
    svg.append(
      s("line", { class: "notch", x1: at, x2: at, y1: bottom, y2: bottom + 4 }),
      s("text", { class: "tick", x: at, y: bottom + 16, "text-anchor": "middle" }, showAny(tick)),
    );
  }
  svg.append(
    s("line", { class: "axis", x1: MARGIN.left, x2: right, y1: bottom, y2: bottom }),
    s("text", { class: "axis-name", x: right, y: height - 4, "text-anchor": "end" }, xLabel),
  );
  if (yLabel)
    svg.append(
      s(
        "text",
        {
          class: "axis-name",
          x: 12,
          y: (MARGIN.top + bottom) / 2,
          "text-anchor": "middle",
          transform: `rotate(-90 12 ${(MARGIN.top + bottom) / 2})`,
        },
        yLabel,
      ),
    );
  return svg;
}

function showAny(tick) {
  if (isNumber(tick)) return showTick(tick);
  const text = showSetting(tick);
  return text.length > 18 ? `${text.slice(0, 17)}…` : text;
}

const tip = h("div", { class: "tip", role: "status", hidden: true });

function showTip(event, ...lines) {
  tip.replaceChildren(...lines.map((line) => h("div", {}, line)));
  tip.hidden = false;
  const { width, height } = tip.getBoundingClientRect();
  const left = Math.min(event.clientX + 14, innerWidth - width - 8);
  const top = event.clientY + 16 + height > innerHeight ? event.clientY - height - 10 : event.clientY + 16;
  tip.style.left = `${Math.max(8, left)}px`;
  tip.style.top = `${Math.max(8, top)}px`;
}

function hideTip() {
  tip.hidden = true;
}

function empty(text) {
  return h("p", { class: "empty" }, text);
}

function hint(text) {
  return h("p", { class: "hint" }, text);
}

function panelBox(title, ...children) {
  return h("section", { class: "panel" }, h("h3", {}, title), ...children);
}

function widePanel(title, ...children) {
  return h("section", { class: "panel wide" }, h("h3", {}, title), ...children);
}

// Nearest of a sorted list.
function nearestIndex(sorted, wanted) {
  let low = 0,
    high = sorted.length - 1;
  while (high - low > 1) {
    const middle = (low + high) >> 1;
    if (sorted[middle] < wanted) low = middle;
    else high = middle;
  }
  return Math.abs(sorted[low] - wanted) <= Math.abs(sorted[high] - wanted) ? low : high;
}
