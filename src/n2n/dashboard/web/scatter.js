// Results over a setting: every run a dot, the means of runs that agree in all else a line, the paper's curve beside it.

function settingPlot(box, width, { x: key, metric, scale, shown, paper }) {
  const height = 260;
  const dots = shown
    .map((run) => ({ run, x: used(run, key), y: value(run, metric) * scale }))
    .filter((dot) => isNumber(dot.y) && dot.x !== undefined && dot.x !== null);
  const groups = groupsOf(
    dots.map((dot) => dot.run),
    key,
  ).map((group) => {
    const members = new Set(group.runs);
    return {
      label: group.label,
      first: group.runs[0],
      places: grouped(
        dots.filter((dot) => members.has(dot.run)),
        (dot) => dot.x,
      ),
    };
  });
  // A group with one value of the setting says nothing about the setting.
  const telling = groups.filter((group) => group.places.size > 1);
  const ordered = (telling.length || paper ? telling : groups).sort((a, b) => b.places.size - a.places.size);
  const drawn = ordered.flatMap((group) => [...group.places.values()].flat());
  const curves = paper ? [paper] : [];
  const xs = [...drawn.map((dot) => dot.x), ...curves.flatMap((curve) => curve.points.map((p) => p[0]))];
  const ys = [...drawn.map((dot) => dot.y), ...curves.flatMap((curve) => curve.points.map((p) => p[1]))];
  if (!ys.length) return 0;
  const x = scaleFor(xs, MARGIN.left, width - MARGIN.right);
  const positive = ys.every((one) => one > 0);
  const y = scaleFor(ys, height - MARGIN.bottom, MARGIN.top, positive && Math.max(...ys) / Math.min(...ys) > 6);
  const name = showMetric(metric) + showScale(scale);
  const svg = frame(width, height, x, y, showKey(key), "", `${name} over ${key}`);
  const legend = [];
  for (const curve of curves) {
    svg.append(
      s("path", { class: "curve paper", d: "M" + curve.points.map((p) => `${x(p[0])} ${y(p[1])}`).join("L") }),
    );
    for (const p of curve.points) {
      const mark = s("rect", { class: "paper-mark", x: x(p[0]) - 3.5, y: y(p[1]) - 3.5, width: 7, height: 7 });
      hover(mark, () => [`paper, ${curve.table}`, `${showNumber(p[1])} at ${showKey(key)}=${showNumber(p[0])}`]);
      svg.append(mark);
    }
    legend.push([`paper, ${curve.table}: ${curve.data}`, "var(--paper)", "dashed"]);
  }
  ordered.forEach(({ label: group, first, places }, index) => {
    const colour = index < COLOURS ? `var(--c${index})` : "var(--muted)";
    // Means over other shapes at every place would be no curve.
    const shapes = [...places.values()]
      .map((members) => new Set(members.map((dot) => dot.run.shape)))
      .reduce((a, b) => new Set([...a].filter((shape) => b.has(shape))));
    const line = [...places]
      .map(([at, members]) => [at, members.filter((dot) => shapes.has(dot.run.shape)).map((dot) => dot.y)])
      .filter((place) => place[1].length)
      .map(([at, some]) => [at, mean(some)]);
    if (line.every((p) => isNumber(p[0]))) line.sort((a, b) => a[0] - b[0]);
    if (line.length > 1) {
      const path = s("path", { class: "curve mean", d: "M" + line.map((p) => `${x(p[0])} ${y(p[1])}`).join("L") });
      path.style.stroke = colour;
      svg.append(path);
    }
    for (const dot of [...places.values()].flat()) {
      const mark = s("circle", { class: "dot", cx: x(dot.x), cy: y(dot.y), r: 3.5 });
      mark.style.fill = colour;
      hover(mark, () => [label(dot.run), `${name} ${showNumber(dot.y)}`]);
      mark.addEventListener("click", () => {
        location.hash = runAddress(dot.run);
      });
      svg.append(mark);
    }
    if (index < COLOURS)
      legend.push([
        `${(paper ? besidePaper(first, group) : group) || "runs here"}${shapes.size > 1 ? `: mean of the ${shapes.size} shapes common to all` : ""}`,
        colour,
        "solid",
      ]);
  });
  if (ordered.length > COLOURS) legend.push([`${ordered.length - COLOURS} further groups`, "var(--muted)", "solid"]);
  box.append(h("h4", {}, name), svg, legendList(legend));
  return ordered.length;
}

// The paper's curve is of certain data, so ours says of which it is.
function besidePaper(run, group) {
  const [points, noise] = [used(run, "datamodule.points"), used(run, "datamodule.noise")];
  const facts = [
    used(run, "datamodule.name"),
    isNumber(points) ? `${showNumber(points)} points` : null,
    isNumber(noise) ? `noise ${showNumber(noise)}` : null,
    ...group.split(", ").filter((part) => !/^(data|points|noise)=/.test(part)),
  ];
  return `ours: ${facts.filter(Boolean).join(", ")}`;
}

function ablationPanel(panel) {
  const box = h("div", { class: "plots" });
  const note = h("span", { class: "hint" });
  const fold = h("details", { class: "panel wide" }, h("summary", {}, h("h3", {}, panel.title), note), box);
  const metrics = panel.metrics;
  const varies = (group) => new Set(group.runs.map((run) => used(run, panel.x))).size > 1;
  const has = (metric) =>
    groupsOf(
      runs.filter((run) => isNumber(value(run, metric))),
      panel.x,
    ).some(varies);
  const draw = () => {
    const shown = new Set(runs.map((run) => String(used(run, panel.x)))).size > 1 ? shownRuns() : [];
    const plots = metrics.map(() => h("div", { class: "plot" }));
    box.replaceChildren(...plots);
    const ours = plots
      .map((plot, i) =>
        settingPlot(plot, plot.clientWidth, {
          x: panel.x,
          metric: metrics[i],
          scale: panel.scale,
          shown,
          paper: panel.paper.find((curve) => curve.metric === metrics[i]),
        }),
      )
      .some(Boolean);
    note.textContent = ours ? "" : `the paper alone: ${panel.empty}`;
  };
  const redraw = whenSized(box, draw);
  fold.open = metrics.some(has);
  if (!fold.open) note.textContent = `the paper alone: ${panel.empty}`;
  subscribe(redraw);
  return fold;
}

function explorePanel(panel) {
  const keys = varied().filter((key) => key !== "datamodule.seed"),
    metrics = panel.metrics.filter(hasResults);
  const title = panel.title;
  if (!keys.length) return panelBox(title, empty(panel.empty));
  if (!metrics.length) return panelBox(title, empty("no run has results yet"));
  let key = keys.find((one) => !NOT_COMPARED.has(one)) ?? keys[0],
    metric = metrics[0];
  const box = h("div", { class: "plot" });
  const redraw = whenSized(box, (width) => {
    box.replaceChildren();
    const drawn = settingPlot(box, width, { x: key, metric, scale: 1, shown: shownRuns() });
    if (!drawn) box.replaceChildren(empty("none of the runs shown has this result"));
  });
  const choices = h(
    "div",
    { class: "choices" },
    selectBox(
      "result",
      metrics.map((one) => [one, showMetric(one)]),
      metric,
      (one) => {
        metric = one;
        redraw();
      },
    ),
    selectBox(
      "over",
      keys.map((one) => [one, showKey(one)]),
      key,
      (one) => {
        key = one;
        redraw();
      },
    ),
  );
  subscribe(redraw);
  return widePanel(title, choices, box);
}

function legendList(entries) {
  return h(
    "ul",
    { class: "legend" },
    entries.map(([text, colour, stroke]) => {
      const swatch = h("i", { class: `swatch ${stroke}` });
      swatch.style.borderColor = colour;
      return h("li", {}, swatch, text);
    }),
  );
}

function hover(mark, lines) {
  mark.addEventListener("pointermove", (event) => showTip(event, ...lines()));
  mark.addEventListener("pointerleave", hideTip);
}

function mean(values) {
  return values.reduce((sum, one) => sum + one, 0) / values.length;
}
