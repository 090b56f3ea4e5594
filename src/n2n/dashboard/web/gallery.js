// Pictures of all runs, and the 3D view of one of them.

const PICTURES_AT_FIRST = 12;

function scenePanel(panel) {
  const parts = [leftOutNote(), viewChooser(), gallery()].filter(Boolean);
  return widePanel(panel.title, parts.length ? parts : empty(panel.empty));
}

function leftOutNote() {
  const { pictures, scenes } = data.leftOut;
  if (!pictures && !scenes) return null;
  const room = `${showNumber(data.mediaBytes / 1e6)} MB`;
  return empty(
    `Left out of this page: ${count(scenes, "3D view")} and ${count(pictures, "picture")}. ` +
      `It has room for ${room} of them; n2n dashboard --media MB gives more.`,
  );
}

function viewChooser() {
  const scenes = runs.filter((run) => run.scene);
  if (!scenes.length) return null;
  let chosen = scenes[0].address;
  const view = h("div");
  const open = () => view.replaceChildren(sceneView(byAddress.get(chosen)));
  view.append(button("Open 3D view", open));
  const names = scenes.map((run) => [run.address, `${label(run)} (${run.id})`]);
  const choice = selectBox("run", names, chosen, (address) => {
    chosen = address;
    open();
  });
  return h("div", {}, h("div", { class: "choices" }, choice), view);
}

function gallery() {
  const pictures = runs.filter((run) => run.picture);
  if (!pictures.length) return null;
  let limit = PICTURES_AT_FIRST;
  const grid = h("div", { class: "gallery" });
  const fill = () => {
    const shown = pictures.filter(isShown);
    grid.replaceChildren(...shown.slice(0, limit).map(thumbnail));
    more.hidden = shown.length <= limit;
  };
  const more = button("Show all pictures", () => {
    limit = Infinity;
    fill();
  });
  subscribe(fill);
  return h("div", {}, grid, more);
}

function thumbnail(run) {
  const picture = h("img", { src: run.picture, alt: `level sets of ${label(run)}` });
  return h("a", { href: runAddress(run), class: "thumb" }, picture, h("span", {}, label(run)));
}
