// Parallel coordinates: one upright axis a setting or result, one line a run. Dragging along an axis filters the page.

const AXIS_GAP = 104;

function parallelPanel(panel) {
  const results = panel.metrics.filter(
    (metric) => new Set(runs.map((run) => value(run, metric)).filter(isNumber)).size > 1,
  );
  const axes = [...varied(), ...results];
  if (!varied().length || axes.length < 2)
    return widePanel(panel.title, empty(panel.empty));
  const scroller = h("div", {
    class: "scroller",
    tabindex: 0,
    role: "group",
    "aria-label": "parallel coordinates, scrolls sideways",
  });
  const letGo = () => {
    ranges.clear();
    store.brushes.clear();
    redraw();
    changed();
  };
  const clear = button("Clear brushes", letGo, { hidden: true });
  const ranges = new Map();
  let lines = [];

  const draw = (width) => {
    const height = 300,
      top = 40,
      bottom = height - 34;
    const gap = Math.max(AXIS_GAP, (width - 140) / (axes.length - 1));
    const full = Math.max(width, gap * (axes.length - 1) + 140);
    const svg = s("svg", {
      width: full,
      height,
      viewBox: `0 0 ${full} ${height}`,
      role: "img",
      "aria-label": `settings and results of ${runs.length} runs`,
    });
    const columns = axes.map((name, index) => {
      const scale = scaleFor(
        runs.map((run) => dimension(run, name)),
        bottom,
        top,
      );
      const at = (run) => {
        const one = dimension(run, name);
        return one === undefined || one === null ? height - 14 : scale(one);
      };
      return { name, x: 70 + index * gap, scale, at };
    });
    lines = runs.map((run) => {
      const path = s("path", {
        class: "curve thread",
        d: "M" + columns.map((column) => `${column.x.toFixed(1)} ${column.at(run).toFixed(1)}`).join("L"),
      });
      hover(path, () => [
        label(run),
        ...results.map((metric) => `${showMetric(metric)} ${showNumber(value(run, metric))}`),
      ]);
      path.addEventListener("click", () => {
        location.hash = runAddress(run);
      });
      svg.append(path);
      return { run, path };
    });
    columns.forEach((column) => svg.append(axisWithBrush(column, top, bottom, svg)));
    scroller.replaceChildren(svg);
    colour();
  };

  const axisWithBrush = (column, top, bottom, svg) => {
    const group = s("g", { class: "brush-axis", "data-axis": column.name });
    group.append(s("line", { class: "axis", x1: column.x, x2: column.x, y1: top, y2: bottom }));
    for (const tick of column.scale.ticks(5)) {
      group.append(
        s(
          "text",
          { class: "tick halo", x: column.x + 6, y: column.scale(tick), "dominant-baseline": "central" },
          showAny(tick),
        ),
      );
    }
    const name = data.axes.includes(column.name) ? showKey(column.name) : showMetric(column.name);
    group.append(
      s(
        "text",
        { class: "axis-name", x: column.x, y: 18, "text-anchor": "middle" },
        name.length > 17 ? `${name.slice(0, 16)}…` : name,
        s("title", {}, name),
      ),
    );
    const mark = s("rect", { class: "brush", x: column.x - 8, width: 16, y: 0, height: 0, rx: 3 });
    const show = () => {
      const range = ranges.get(column.name);
      mark.setAttribute("y", range ? range[0] : 0);
      mark.setAttribute("height", range ? range[1] - range[0] : 0);
    };
    const hit = s("rect", { class: "brush-hit", x: column.x - 16, width: 32, y: top - 8, height: bottom - top + 16 });
    let start = null;
    const place = (event) => Math.min(Math.max(event.clientY - svg.getBoundingClientRect().top, top - 6), bottom + 6);
    hit.addEventListener("pointerdown", (event) => {
      start = place(event);
      hit.setPointerCapture(event.pointerId);
      event.preventDefault();
    });
    hit.addEventListener("pointermove", (event) => {
      if (start === null) return;
      const now = place(event),
        range = [Math.min(start, now), Math.max(start, now)];
      if (range[1] - range[0] > 3) ranges.set(column.name, range);
      else ranges.delete(column.name);
      show();
      apply(column);
    });
    hit.addEventListener("pointerup", (event) => {
      if (start !== null && Math.abs(place(event) - start) <= 3) {
        ranges.delete(column.name);
        show();
        apply(column);
      }
      start = null;
    });
    hit.addEventListener("pointercancel", () => {
      start = null;
    });
    group.append(mark, hit);
    show();
    return group;
  };

  const apply = (column) => {
    const range = ranges.get(column.name);
    if (!range) store.brushes.delete(column.name);
    else
      store.brushes.set(column.name, (run) => {
        const one = dimension(run, column.name);
        return one !== undefined && one !== null && column.scale(one) >= range[0] && column.scale(one) <= range[1];
      });
    changed();
  };

  const colour = () => {
    const colours = colouring(store.colourBy);
    for (const { run, path } of lines) {
      const shown = isShown(run);
      path.classList.toggle("off", !shown);
      path.style.stroke = shown ? colours.of(run) : "";
    }
    clear.hidden = !store.brushes.size;
  };

  // Another height of the axes would move what was brushed.
  const redraw = whenSized(scroller, draw);
  subscribe(colour);
  return widePanel(
    panel.title,
    hint(
      "Drag along an axis to keep only the runs in that range, everywhere on this page; click the axis to let go. With the keyboard: the filter above, e.g. seed<3. ",
    ),
    clear,
    scroller,
  );
}
