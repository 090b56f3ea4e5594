// How a sweep is doing: states, failures, time per run.

function statesPanel(panel) {
  if (!runs.length) return panelBox(panel.title, empty("no runs"));
  const rows = [...grouped(runs, (run) => run.sweep)].map(([sweep, members]) => {
    const counts = STATES.map((state) => [state, members.filter((run) => run.state === state)]).filter(
      (pair) => pair[1].length,
    );
    const bar = h(
      "div",
      { class: "bar", role: "img", "aria-label": counts.map(([state, some]) => `${some.length} ${state}`).join(", ") },
      counts.map(([state, some]) => {
        const part = h("span", { class: `part ${state}` });
        part.style.flexGrow = some.length;
        return part;
      }),
    );
    return h(
      "div",
      { class: "sweep" },
      h("div", { class: "sweep-name" }, sweep || "single runs"),
      bar,
      h(
        "div",
        { class: "sweep-counts" },
        counts.map(([state, some]) => h("span", { class: `state ${state}` }, `${some.length} ${state}`)),
      ),
    );
  });
  const stale = runs.filter((run) => run.state === "stale");
  return panelBox(
    panel.title,
    rows,
    stale.length
      ? h(
          "p",
          { class: "hint" },
          "Stale: no sign of life for longer than its heartbeat allows; the process was probably killed. `n2n sweep resume` goes on from the last checkpoint.",
        )
      : null,
  );
}

function failuresPanel(panel) {
  const failed = runs.filter((run) => run.state === "failed" || run.problems.length);
  if (!failed.length) return panelBox(panel.title, empty(panel.empty));
  const list = h("ul", { class: "failures" });
  subscribe(() => {
    const shown = failed.filter(isShown);
    list.replaceChildren(
      ...shown.map((run) =>
        h(
          "li",
          {},
          h("a", { href: runAddress(run) }, label(run)),
          run.state === "failed" ? h("code", {}, run.error || "no reason was left") : null,
          run.problems.map((text) => h("code", {}, `damaged: ${text}`)),
        ),
      ),
    );
  });
  return panelBox(panel.title, list);
}

function ratesPanel(panel) {
  const values = runs.map((run) => run.seconds).filter(isNumber);
  if (!values.length) return panelBox(panel.title, empty(panel.empty));
  const box = h("div", { class: "plot" });
  const redraw = whenSized(box, (width) => {
    const shown = shownRuns()
      .map((run) => run.seconds)
      .filter(isNumber);
    if (!shown.length) {
      box.replaceChildren(empty("none of the runs shown has ended"));
      return;
    }
    const height = 200,
      bins = Math.min(24, Math.max(5, Math.ceil(Math.sqrt(shown.length))));
    let [low, high] = extent(shown);
    if (low === high) [low, high] = [low * 0.9, high * 1.1 + 1e-9];
    const counts = Array(bins).fill(0);
    shown.forEach((one) => counts[Math.min(bins - 1, Math.floor(((one - low) / (high - low)) * bins))]++);
    const x = linearScale(low, high, MARGIN.left, width - MARGIN.right);
    const y = linearScale(0, Math.max(...counts), height - MARGIN.bottom, MARGIN.top);
    const ticks = y.ticks;
    y.ticks = (wanted) => ticks(wanted).filter(Number.isInteger);
    const svg = frame(width, height, x, y, "seconds", "runs", `seconds of ${shown.length} runs`);
    counts.forEach((number, i) => {
      const from = x(low + (i * (high - low)) / bins),
        to = x(low + ((i + 1) * (high - low)) / bins);
      if (number)
        svg.append(
          s("rect", {
            class: "column",
            x: from + 0.5,
            width: Math.max(1, to - from - 1),
            y: y(number),
            height: y(0) - y(number),
          }),
        );
    });
    box.replaceChildren(svg);
  });
  subscribe(redraw);
  return panelBox(panel.title, box);
}
