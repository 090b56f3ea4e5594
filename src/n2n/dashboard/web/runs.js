// The table of all runs.

function runAddress(run) {
  return `#/run/${encodeURIComponent(run.address)}`;
}

function stateBadge(run) {
  return h("span", { class: `state ${run.state}` }, run.state);
}

function runsPanel(panel) {
  if (!runs.length) return widePanel(panel.title, empty(panel.empty));
  const several = new Set(runs.map((run) => run.sweep)).size > 1;
  const columns = [
    {
      name: "state",
      of: (run) => run.state,
      show: (run) => [
        stateBadge(run),
        run.problems.length ? h("span", { class: "warning", title: run.problems.join("\n") }, " ⚠ damaged") : null,
      ],
    },
    {
      name: "run",
      of: (run) => run.id,
      show: (run) => h("a", { href: runAddress(run), title: run.id }, run.id.split("-").at(-1)),
    },
    several ? { name: "sweep", of: (run) => run.sweep, show: (run) => run.sweep || MISSING } : null,
    ...varied().map((key) => ({
      name: showKey(key),
      title: key,
      numeric: runs.some((run) => isNumber(asked(run, key))),
      of: (run) => asked(run, key),
      show: (run) => showSetting(asked(run, key)),
    })),
    ...panel.metrics
      .filter((metric) => metric !== "seconds" && hasResults(metric))
      .map((metric) => ({
        name: showMetric(metric),
        title: metric,
        numeric: true,
        of: (run) => value(run, metric),
        show: (run) => showNumber(value(run, metric)),
      })),
    { name: "took", numeric: true, of: (run) => run.seconds, show: (run) => showSeconds(run.seconds) },
    runs.some((run) => run.attempt > 1)
      ? { name: "attempts", numeric: true, of: (run) => run.attempt, show: (run) => showNumber(run.attempt) }
      : null,
  ].filter(Boolean);
  const table = sortable(columns, "Runs");
  const title = h("h3", {}, panel.title);
  subscribe(() => {
    const shown = shownRuns();
    title.textContent =
      shown.length === runs.length ? panel.title : `${panel.title}: ${shown.length} of ${runs.length}`;
    table.set(shown);
  });
  return h("section", { class: "panel wide", id: "runs-table" }, title, table.node);
}
