// Puts the page together and follows its address: #/ is the overview, #/run/NAME one run.

const PANELS = {
  cards: cardsPanel,
  versus: versusPanel,
  curve: curvePanel,
  ablation: ablationPanel,
  explore: explorePanel,
  parallel: parallelPanel,
  runs: runsPanel,
  shapes: shapesPanel,
  scene: scenePanel,
  states: statesPanel,
  failures: failuresPanel,
  rates: ratesPanel,
};

store.colourBy = varied().find((key) => !NOT_COMPARED.has(key)) ?? varied()[0] ?? "state";

function header() {
  const box = h("input", {
    type: "search",
    id: "filter",
    placeholder: "filter: text, seed=1, noise<0.02, state=failed",
    "aria-label": "filter runs",
    oninput: () => {
      store.text = box.value;
      changed();
    },
  });
  const tally = h("span", { class: "tally", "aria-live": "polite" });
  const legend = h("div", { class: "colours" });
  subscribe(() => {
    const shown = shownRuns().length;
    tally.textContent = shown === runs.length ? count(runs.length, "run") : `${shown} of ${runs.length} runs`;
    legend.replaceChildren(
      legendList(colouring(store.colourBy).entries.map(([text, colour]) => [text, colour, "solid"])),
    );
  });
  const choices = varied().map((key) => [key, showKey(key)]);
  return h(
    "div",
    { class: "toolbar" },
    box,
    tally,
    choices.length
      ? selectBox("colour", choices, store.colourBy, (key) => {
          store.colourBy = key;
          changed();
        })
      : null,
    choices.length ? legend : null,
  );
}

function overviewPage() {
  if (!runs.length)
    return h(
      "main",
      {},
      h(
        "div",
        { class: "welcome" },
        h("h2", {}, "No runs yet"),
        h("p", {}, "Fit something, then make this page again:"),
        h("pre", {}, "n2n fit -m seed=0,1,2\nn2n dashboard"),
      ),
    );
  const nav = h(
    "nav",
    { "aria-label": "sections" },
    data.sections.map((section) => h("a", { href: `#/${section.key}` }, section.title)),
  );
  const sections = data.sections.map((section) => {
    const panels = section.panels.map((panel) => PANELS[panel.kind]?.(panel)).filter(Boolean);
    const body = panels.length
      ? panels
      : [panelBox(section.title, empty("none of these runs has logged anything; logger=csv keeps the curves"))];
    return h(
      "section",
      { class: "part-of-page", id: `section-${section.key}`, tabindex: -1, "aria-label": section.title },
      h("h2", {}, section.title),
      h("div", { class: "panels" }, body),
    );
  });
  return h("main", {}, nav, header(), sections);
}

const app = document.getElementById("app");
const overview = overviewPage();
const one = h("div");
app.replaceChildren(
  h(
    "header",
    { class: "top" },
    h("h1", {}, h("a", { href: "#/" }, "n2n dashboard")),
    h("p", {}, `made ${data.made} · n2n ${data.version}`),
  ),
  overview,
  one,
  tip,
  h(
    "footer",
    {},
    `Curves show at most ${data.curvePoints} points each, lowest and highest of every stretch kept. Results are raw unless a scale is given.`,
  ),
);

let reading = 0;

function follow() {
  hideTip();
  const address = location.hash.startsWith("#/run/") ? decodeAddress(location.hash.slice(6)) : null;
  if (address !== null) {
    if (!overview.hidden) reading = scrollY;
    overview.hidden = true;
    one.replaceChildren(runPage(address));
    scrollTo(0, 0);
    return;
  }
  const wasHidden = overview.hidden;
  overview.hidden = false;
  if (one.hasChildNodes()) {
    openView?.close();
    openView = null;
    one.replaceChildren();
  }
  const section = document.getElementById(`section-${location.hash.slice(2)}`);
  if (section) {
    section.scrollIntoView();
    section.focus({ preventScroll: true });
  } else if (wasHidden) scrollTo(0, reading);
}

function decodeAddress(text) {
  try {
    return decodeURIComponent(text);
  } catch {
    return text;
  }
}

addEventListener("hashchange", follow);
follow();
