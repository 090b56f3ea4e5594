// The first things to know: how many runs, the best ones, and how they stand beside the paper.

function cardsPanel(panel) {
  const box = h("div", { class: "cards" });
  subscribe(() => {
    const shown = shownRuns();
    const done = shown.filter((run) => run.state === "done");
    const seconds = shown.map((run) => run.seconds).filter(isNumber);
    const counts = STATES.map((state) => [state, shown.filter((run) => run.state === state).length]).filter(
      (pair) => pair[1],
    );
    const cards = [
      card(
        "runs",
        showNumber(shown.length),
        counts.map(([state, number]) => h("span", { class: `state ${state}` }, `${number} ${state}`)),
      ),
    ];
    if (seconds.length)
      cards.push(
        card(
          "fitting, together",
          showSeconds(seconds.reduce((a, b) => a + b, 0)),
          `median ${showSeconds(median(seconds))} a run`,
        ),
      );
    for (const metric of panel.metrics) {
      const have = done.filter((run) => isNumber(value(run, metric)));
      if (!have.length) continue;
      const sign = isHigherBetter(metric) ? -1 : 1;
      const best = have.reduce((a, b) => (sign * value(a, metric) <= sign * value(b, metric) ? a : b));
      cards.push(
        card(
          `best ${showMetric(metric)}`,
          showNumber(value(best, metric)),
          h("a", { href: runAddress(best), title: label(best) }, label(best)),
        ),
      );
    }
    box.replaceChildren(...cards);
  });
  return box;
}

function card(name, number, detail) {
  return h(
    "div",
    { class: "card" },
    h("div", { class: "card-name" }, name),
    h("div", { class: "card-number" }, number),
    h("div", { class: "card-detail" }, detail),
  );
}

function median(values) {
  const sorted = [...values].sort((a, b) => a - b),
    middle = sorted.length >> 1;
  return sorted.length % 2 ? sorted[middle] : (sorted[middle - 1] + sorted[middle]) / 2;
}

function versusPanel(panel) {
  if (!data.versus.length) return widePanel(panel.title, empty(panel.empty));
  const columns = [
    {
      name: "paper's table",
      of: (row) => `${row.table} ${row.place}`,
      show: (row) => h("span", { title: row.what }, `${row.table} ${row.place}`),
    },
    { name: "measured", of: (row) => row.metric, show: (row) => showMetric(row.metric) + showScale(row.scale) },
    {
      name: "shapes",
      numeric: true,
      of: (row) => row.shapes,
      show: (row) => h("span", { title: row.names }, shapesOf(row)),
    },
    { name: "ours", numeric: true, of: (row) => row.ours, show: (row) => showNumber(row.ours) },
    {
      name: "paper",
      numeric: true,
      of: (row) => row.paper,
      show: (row) => [
        showNumber(row.paper),
        row.notes.length ? h("sup", {}, row.notes.map((note) => notes.indexOf(note) + 1).join(" ")) : null,
      ],
    },
    { name: "ours / paper", numeric: true, of: (row) => row.ours / row.paper, show: (row) => ratio(row) },
    { name: "our settings", of: (row) => row.group, show: (row) => h("div", { class: "wrap" }, row.group || MISSING) },
  ];
  const notes = [...new Set(data.versus.flatMap((entry) => entry.notes))];
  const table = sortable(columns, "Means over shapes, ours and the paper's");
  subscribe(() => table.set(data.versus.flatMap(versusRows)));
  return widePanel(
    panel.title,
    hint(
      "Ours is the mean over the shapes that are here, repetitions of a shape counted once; the paper's is over its dataset.",
    ),
    table.node,
    notes.length
      ? h(
          "ol",
          { class: "footnotes" },
          notes.map((note) => h("li", {}, note)),
        )
      : null,
  );
}

function versusRows(entry) {
  const shown = entry.runs.map((index) => runs[index]).filter(isShown);
  return groupsOf(shown).map(({ label: group, runs: members }) => {
    const shapes = grouped(members, (run) => run.shape);
    const ours = mean([...shapes.values()].map((same) => mean(same.map((run) => value(run, entry.metric)))));
    return { ...entry, group, shapes: shapes.size, names: [...shapes.keys()].join(", "), ours: entry.scale * ours };
  });
}

function shapesOf(row) {
  return row.whole ? `${row.shapes} of ${row.whole}` : showNumber(row.shapes);
}

// "Better" is said only of a mean over all the shapes that the paper's number is a mean of.
function ratio(row) {
  const isBetter = isHigherBetter(row.metric) ? row.ours > row.paper : row.ours < row.paper;
  const isWhole = row.whole > 0 && row.shapes >= row.whole;
  const number = Number((row.ours / row.paper).toPrecision(3)).toString();
  return h("span", { class: isBetter && isWhole ? "good" : "" }, number, isBetter && isWhole ? " better" : "");
}
