// Results shape by shape, beside what doing nothing and exact projection reach.

const FLOORS = {
  do_nothing: "do nothing",
  oracle: "exact projection",
  split: "truth against itself",
  resample: "truth drawn anew",
};

function shapesPanel(panel) {
  const metrics = evaluated(panel.metrics);
  if (!metrics.length) return widePanel(panel.title, empty(panel.empty));
  const columns = [
    { name: "data", of: (row) => row.data, show: (row) => row.data },
    { name: "shape", of: (row) => row.shape, show: (row) => row.shape },
    { name: "settings", of: (row) => row.group, show: (row) => h("div", { class: "wrap" }, row.group || MISSING) },
    {
      name: "runs",
      numeric: true,
      of: (row) => row.members.length,
      show: (row) => h("a", { href: runAddress(row.members[0]) }, showNumber(row.members.length)),
    },
    ...metrics.flatMap((metric) => [
      {
        name: showMetric(metric),
        title: metric,
        numeric: true,
        of: (row) => average(row.members, (run) => value(run, metric)),
        show: (row) =>
          scaled(
            average(row.members, (run) => value(run, metric)),
            metric,
          ),
      },
      ...floorsOf(metric).map((floor) => ({
        name: FLOORS[floor] ?? floor,
        title: `${metric} of: ${FLOORS[floor] ?? floor}`,
        numeric: true,
        of: (row) => average(row.members, (run) => floorValue(run, metric, floor)),
        show: (row) =>
          h(
            "span",
            { class: "floor" },
            scaled(
              average(row.members, (run) => floorValue(run, metric, floor)),
              metric,
            ),
          ),
      })),
    ]),
  ];
  const scaled = (one, metric) => showNumber(isNumber(one) ? one * scaleOf(metric, panel.scale) : undefined);
  const table = sortable(columns, "Results by shape");
  subscribe(() => {
    const have = shownRuns().filter((run) => metrics.some((metric) => isNumber(value(run, metric))));
    table.set(
      groupsOf(have, "datamodule.name").flatMap((group) =>
        [...grouped(group.runs, (run) => JSON.stringify([used(run, "datamodule.name"), run.shape])).values()].map(
          (members) => ({
            data: showSetting(used(members[0], "datamodule.name")),
            shape: members[0].shape || MISSING,
            group: group.label,
            members,
          }),
        ),
      ),
    );
  });
  return widePanel(
    panel.title,
    hint(
      `CD and P2M × 10${superscript(Math.round(Math.log10(panel.scale)))}; other results as they are. Repetitions are averaged.`,
    ),
    table.node,
  );
}

// The metrics of the panel first, then whatever else the runs were evaluated by, as long as the table stays readable.
function evaluated(first) {
  const have = [...new Set(runs.flatMap((run) => Object.keys(run.values)))].filter(
    (name) => name.split("/").length === 3 && METRIC_NAMES[name.split("/")[2]],
  );
  const known = first.filter((metric) => have.includes(metric));
  return [
    ...known,
    ...have.filter(
      (metric) =>
        !known.includes(metric) &&
        !known.some((one) => one.split("/").slice(0, 2).join() === metric.split("/").slice(0, 2).join()),
    ),
  ].slice(0, 6);
}

function scaleOf(metric, scale) {
  return /(_sum2|_mean2|p2m\w*)$/.test(metric) ? scale : 1;
}

function floorValue(run, metric, floor) {
  const [task, protocol, name] = metric.split("/");
  return run.floors[`${task}/${protocol}/${floor}/${name}`];
}

function floorsOf(metric) {
  return Object.keys(FLOORS)
    .filter((floor) => runs.some((run) => isNumber(floorValue(run, metric, floor))))
    .slice(0, 2);
}

function average(members, of) {
  const values = members.map(of).filter(isNumber);
  return values.length ? mean(values) : undefined;
}
