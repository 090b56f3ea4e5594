// The data, and which runs are shown: a text filter, brushed ranges, and what colours mean.

const data = JSON.parse(document.getElementById("data").textContent);
const runs = data.runs;
const STATES = ["done", "running", "stale", "pending", "failed"];
const NOT_COMPARED = new Set(["seed", "datamodule.shape", "datamodule.seed"]);

const store = { text: "", brushes: new Map(), colourBy: "", listeners: new Set() };
const byAddress = new Map();
runs.forEach((run, index) => {
  run.index = index;
  const base = run.sweep ? `${run.sweep}/${run.id}` : run.id;
  run.address = byAddress.has(base) ? `${base}~${index}` : base;
  byAddress.set(run.address, run);
});

function asValue(value) {
  if (typeof value === "string" && value.trim() !== "" && Number.isFinite(Number(value))) return Number(value);
  return value;
}

// As the run was asked for: what its sweep varies, else its configuration.
function asked(run, key) {
  if (key === "datamodule.shape") return run.shape || undefined;
  return asValue(run.swept[key] ?? run.config[key]);
}

// As the run was done: what was left open was chosen from the data.
function used(run, key) {
  if (key === "datamodule.shape") return run.shape || undefined;
  return asValue(run.effective[key] ?? run.config[key] ?? run.swept[key]);
}

function value(run, name) {
  return name === "seconds" ? run.seconds : run.values[name];
}

function dimension(run, name) {
  return data.axes.includes(name) ? asked(run, name) : value(run, name);
}

function hasResults(metric) {
  return runs.some((run) => isNumber(value(run, metric)));
}

function varied() {
  return data.axes.filter(
    (key) => new Set(runs.map((run) => asked(run, key)).filter((one) => one !== undefined)).size > 1,
  );
}

function label(run) {
  const keys = Object.keys(run.swept).length ? Object.keys(run.swept) : varied();
  const text = keys
    .filter((key) => asked(run, key) !== undefined && asked(run, key) !== null)
    .map((key) => `${showKey(key)}=${showSetting(asked(run, key))}`)
    .join(" ");
  return text || run.id;
}

// Runs that agree in everything that is compared: repetitions and further shapes. `x` is what they are drawn over. The
// label of a group names what it does not share with all others.
function groupsOf(some, x = "") {
  const keys = data.differing.filter((key) => key !== x && !NOT_COMPARED.has(key) && !isPartOf(key, x));
  const members = [...grouped(some, (run) => JSON.stringify(keys.map((key) => asked(run, key) ?? null))).values()];
  const telling = keys.filter((key) => new Set(members.map((group) => asked(group[0], key))).size > 1);
  const name = (run) =>
    telling
      .filter((key) => asked(run, key) !== undefined)
      .map((key) => `${showKey(key)}=${showSetting(asked(run, key))}`)
      .join(", ");
  return members.map((group) => ({ label: name(group[0]), runs: group }));
}

// No regulariser is the weight 0 of the one that is used.
function isPartOf(key, x) {
  if (x !== "regulariser_weight" || !/^regulariser(\.|$)/.test(key)) return false;
  const kinds = runs.map((run) => used(run, "regulariser.name") ?? used(run, "regulariser"));
  return new Set(kinds.filter((kind) => kind && kind !== "none")).size < 2;
}

function grouped(items, keyOf) {
  const groups = new Map();
  for (const item of items) {
    const key = keyOf(item);
    if (groups.has(key)) groups.get(key).push(item);
    else groups.set(key, [item]);
  }
  return groups;
}

const COMPARISON = /^([\w.\/]+)(<=|>=|=|<|>)(.+)$/;

function isMatch(run, word) {
  const comparison = COMPARISON.exec(word);
  if (comparison) {
    const [, key, sign, text] = comparison;
    const mine = found(run, key);
    if (sign === "=") return String(mine).toLowerCase() === text.toLowerCase() || mine === asValue(text);
    const bound = Number(text);
    if (!isNumber(mine) || Number.isNaN(bound)) return false;
    return { "<": mine < bound, ">": mine > bound, "<=": mine <= bound, ">=": mine >= bound }[sign];
  }
  const text = [run.address, run.state, run.error, label(run), run.config["datamodule.name"]].join(" ").toLowerCase();
  return text.includes(word.toLowerCase());
}

// A setting, else a result: both have a noise.
function found(run, key) {
  if (key === "state" || key === "sweep") return run[key];
  const settings = [key, `datamodule.${key}`, `${key}.name`].map((name) => asked(run, name) ?? used(run, name));
  return settings.find((one) => one !== undefined && one !== null) ?? value(run, key);
}

function isShown(run) {
  const words = store.text.split(/\s+/).filter(Boolean);
  return words.every((word) => isMatch(run, word)) && [...store.brushes.values()].every((inside) => inside(run));
}

function shownRuns() {
  return runs.filter(isShown);
}

function subscribe(listener) {
  store.listeners.add(listener);
  listener();
}

let pending = false;
function changed() {
  if (pending) return;
  pending = true;
  requestAnimationFrame(() => {
    pending = false;
    store.listeners.forEach((listener) => listener());
  });
}

// Colours: a few values get one each, many numbers a ramp.
const COLOURS = 8;

function colouring(key) {
  const values = [...new Set(runs.map((run) => dimension(run, key)).filter((one) => one !== undefined))];
  if (values.length < 2) return { of: () => "var(--c0)", entries: [] };
  const numeric = values.every(isNumber);
  if (numeric && values.length > COLOURS) {
    const low = Math.min(...values),
      high = Math.max(...values);
    const at = (run) => (dimension(run, key) - low) / (high - low || 1);
    return {
      of: (run) => (isNumber(dimension(run, key)) ? ramp(at(run)) : "var(--muted)"),
      entries: [
        [showNumber(low), ramp(0)],
        [showNumber((low + high) / 2), ramp(0.5)],
        [showNumber(high), ramp(1)],
      ],
    };
  }
  values.sort((a, b) => (numeric ? a - b : String(a).localeCompare(String(b))));
  const colour = new Map(values.map((one, index) => [one, index < COLOURS ? `var(--c${index})` : "var(--muted)"]));
  const entries = values.slice(0, COLOURS).map((one) => [showSetting(one), colour.get(one)]);
  if (values.length > COLOURS) entries.push([`${values.length - COLOURS} others`, "var(--muted)"]);
  return { of: (run) => colour.get(dimension(run, key)) ?? "var(--muted)", entries };
}

const RAMP = [
  [68, 85, 170],
  [40, 140, 150],
  [90, 170, 80],
  [230, 165, 30],
  [205, 60, 50],
];

function rampColour(t) {
  const place = Math.min(Math.max(t, 0), 1) * (RAMP.length - 1),
    low = Math.min(Math.floor(place), RAMP.length - 2);
  return RAMP[low].map((channel, i) => channel + (place - low) * (RAMP[low + 1][i] - channel));
}

function ramp(t) {
  return `rgb(${rampColour(t).map(Math.round).join(" ")})`;
}
