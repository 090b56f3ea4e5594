// What was logged over the iterations, all runs in one picture.

function curvePanel(panel, chosen = null) {
  const metric = panel.metrics[0];
  const mine = (chosen ?? runs).filter((run) => run.curves[metric]);
  if (!mine.length) return null;
  const box = h("div", { class: "plot" });
  let colour = colouring(store.colourBy);
  let drawn = [];

  const draw = (width) => {
    const height = 240;
    const shown = mine.filter((run) => chosen || isShown(run));
    if (!shown.length) {
      drawn = [];
      box.replaceChildren(empty("none of the runs shown has logged this"));
      return;
    }
    const values = shown.flatMap((run) => run.curves[metric][1].filter(isNumber));
    const steps = shown.flatMap((run) => run.curves[metric][0]);
    const positive = values.filter((one) => one > 0);
    const isLog = panel.log && positive.length > 0 && Math.max(...extent(positive)) / extent(positive)[0] > 2;
    const y = scaleFor(extent(isLog ? positive : values), height - MARGIN.bottom, MARGIN.top, isLog);
    const x = linearScale(0, extent(steps)[1], MARGIN.left, width - MARGIN.right);
    const svg = frame(width, height, x, y, "iteration", "", `${panel.title} of ${count(shown.length, "run")}`);
    drawn = shown.map((run) => {
      const points = [];
      run.curves[metric][0].forEach((step, i) => {
        const one = run.curves[metric][1][i];
        if (isNumber(one) && (!isLog || one > 0)) points.push([x(step), y(one), step, one]);
      });
      const path = s("path", {
        class: "curve",
        d: points.length ? "M" + points.map((p) => `${p[0].toFixed(1)} ${p[1].toFixed(1)}`).join("L") : "",
      });
      path.style.stroke = chosen ? "var(--c0)" : colour.of(run);
      svg.append(path);
      if (points.length === 1) svg.append(s("circle", { cx: points[0][0], cy: points[0][1], r: 3, class: "dot" }));
      return { run, path, points, at: points.map((p) => p[0]) };
    });
    svg.addEventListener("pointermove", (event) => point(svg, event));
    svg.addEventListener("pointerleave", () => point(svg, null));
    svg.addEventListener("click", (event) => {
      const near = nearest(svg, event);
      if (near && !chosen) location.hash = runAddress(near.run);
    });
    box.replaceChildren(svg);
  };

  const nearest = (svg, event) => {
    const area = svg.getBoundingClientRect();
    const px = event.clientX - area.left,
      py = event.clientY - area.top;
    let best = null;
    for (const one of drawn) {
      if (!one.points.length) continue;
      const place = one.points[nearestIndex(one.at, px)];
      const far = Math.abs(place[1] - py) + Math.abs(place[0] - px);
      if (!best || far < best.far) best = { ...one, far, place };
    }
    return best && best.far < 60 ? best : null;
  };

  const point = (svg, event) => {
    const near = event && nearest(svg, event);
    for (const one of drawn) one.path.classList.toggle("near", Boolean(near) && one.run === near.run);
    svg.classList.toggle("picked", Boolean(near) && drawn.length > 1);
    if (near) showTip(event, label(near.run), `${showNumber(near.place[3])} at iteration ${showNumber(near.place[2])}`);
    else hideTip();
  };

  const redraw = whenSized(box, draw);
  if (!chosen)
    subscribe(() => {
      colour = colouring(store.colourBy);
      redraw();
    });
  return panelBox(panel.title, box);
}

function extent(values) {
  let low = Infinity,
    high = -Infinity;
  for (const one of values) {
    if (one < low) low = one;
    if (one > high) high = one;
  }
  return [low, high];
}
