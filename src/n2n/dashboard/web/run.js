// The page of one run.

function runPage(address) {
  const run = byAddress.get(address);
  if (!run) return h("main", {}, backLink(), empty(`no run is called ${address}`));
  const panels = data.sections.flatMap((section) => section.panels);
  const curves = panels.filter((panel) => panel.kind === "curve");
  const known = new Set(curves.flatMap((panel) => panel.metrics));
  const further = Object.keys(run.curves)
    .filter((name) => !known.has(name))
    .map((name) => ({ title: showMetric(name), metrics: [name], log: true }));
  const plots = [...curves, ...further].map((panel) => curvePanel(panel, [run])).filter(Boolean);
  const results = Object.entries(run.values).filter(([name]) => !run.curves[name] && name.split("/").length === 1);
  return h(
    "main",
    { class: "run-page" },
    backLink(),
    h("div", { class: "run-head" }, h("h2", {}, label(run)), stateBadge(run)),
    h(
      "p",
      { class: "hint" },
      [
        run.folder,
        run.sweep && `sweep ${run.sweep}`,
        run.started && `started ${run.started.slice(0, 16).replace("T", " ")}`,
        run.attempt > 1 && `attempt ${run.attempt}`,
        isNumber(run.seconds) && `took ${showSeconds(run.seconds)}`,
        run.note,
      ]
        .filter(Boolean)
        .join(" · "),
    ),
    run.error ? h("div", { class: "alert" }, h("strong", {}, "Failed: "), h("code", {}, run.error)) : null,
    run.state === "running" && isNumber(run.heartbeat)
      ? h(
          "div",
          { class: "alert mild" },
          `Running when this page was made; last sign of life ${showSeconds(run.heartbeat)} before.`,
        )
      : null,
    run.state === "stale" ? h("div", { class: "alert mild" }, staleText(run)) : null,
    run.problems.length
      ? h(
          "div",
          { class: "alert mild" },
          h("strong", {}, "Could not be read: "),
          h(
            "ul",
            {},
            run.problems.map((text) => h("li", {}, h("code", {}, text))),
          ),
        )
      : null,
    h(
      "div",
      { class: "panels" },
      mediaPanel(run),
      evaluationPanel(run),
      panelBox(
        "Results",
        results.length
          ? h(
              "div",
              { class: "tall" },
              plainTable(
                [],
                results.map(([name, one]) => [h("span", { title: name }, showMetric(name)), showNumber(one)]),
                "Results, raw",
              ),
            )
          : empty("nothing yet"),
      ),
      settingsPanel(run),
      plots.length
        ? plots
        : panelBox(
            "Training",
            empty(
              run.note ? "results of n2n tables keep no curves" : "nothing was logged; logger=csv keeps the curves",
            ),
          ),
    ),
  );
}

function staleText(run) {
  const since = isNumber(run.heartbeat) ? ` for ${showSeconds(run.heartbeat)}` : "";
  return `No sign of life${since} when this page was made: the process was probably killed. The same command, or n2n sweep resume, goes on from the last checkpoint.`;
}

function backLink() {
  return h("p", {}, h("a", { href: "#/" }, "← all runs"));
}

function evaluationPanel(run) {
  const measured = Object.keys(run.values).filter((name) => name.split("/").length === 3);
  const floors = Object.keys(FLOORS).filter((floor) => measured.some((name) => isNumber(floorValue(run, name, floor))));
  const rows = measured.map((name) => [
    h("span", { title: name }, `${showMetric(name)} (${name.split("/")[1]})`),
    showNumber(run.values[name]),
    ...floors.map((floor) => h("span", { class: "floor" }, showNumber(floorValue(run, name, floor)))),
  ]);
  return widePanel(
    "Evaluation",
    rows.length
      ? plainTable(["raw values", "this run", ...floors.map((floor) => FLOORS[floor])], rows, "Evaluation")
      : empty("not evaluated; 'evaluate=[denoise/sbp]' does it where the true surface is known"),
  );
}

function mediaPanel(run) {
  const missing = "no pictures; media=true makes them";
  const pictures = [
    run.scene ? sceneView(run) : null,
    run.picture ? h("img", { class: "picture", src: run.picture, alt: "level sets of the field" }) : null,
  ].filter(Boolean);
  return widePanel(
    "Surface and cloud",
    pictures.length
      ? pictures
      : empty(
          data.leftOut.pictures + data.leftOut.scenes
            ? `${missing}, or this page had no room for them (--media)`
            : missing,
        ),
  );
}

function settingsPanel(run) {
  const keys = [...new Set([...Object.keys(run.swept), ...Object.keys(run.config)])];
  const rows = keys.map((key) => {
    const chosen = run.effective[key];
    const text = showSetting(asked(run, key));
    return [
      h("span", { class: key in run.swept ? "swept" : "" }, key),
      chosen === undefined || String(chosen) === text ? text : `${text} → ${showSetting(chosen)}`,
    ];
  });
  const own = Object.keys(run.effective)
    .filter((key) => !(key in run.config))
    .map((key) => [key, `→ ${showSetting(run.effective[key])}`]);
  return panelBox(
    "Settings",
    keys.length
      ? h("div", { class: "tall" }, plainTable([], [...rows, ...own], "Settings; → what auto became"))
      : empty("config.yaml is missing"),
  );
}
