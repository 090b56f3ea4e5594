// The 3D view: a run's mesh, and its denoised cloud coloured by the distance to the true surface.

let openView = null;

function bytes(text) {
  return Uint8Array.from(atob(text), (letter) => letter.charCodeAt(0));
}

// Coordinates with the scene's middle at 0 and its farthest corner at radius 1.
function unpack(scene) {
  const size = scene.high.map((high, k) => high - scene.low[k]),
    radius = Math.hypot(...size) / 2 || 1;
  const places = (text) => {
    const steps = new Uint16Array(bytes(text).buffer),
      out = new Float32Array(steps.length);
    for (let i = 0; i < steps.length; i++) out[i] = ((steps[i] / 65535 - 0.5) * size[i % 3]) / radius;
    return out;
  };
  const model = {};
  if (scene.vertices) {
    const mesh = { places: places(scene.vertices), faces: new Uint16Array(bytes(scene.faces).buffer) };
    model.mesh = { ...mesh, normals: vertexNormals(mesh) };
  }
  if (scene.points) {
    const cloud = places(scene.points),
      colours = new Float32Array(cloud.length);
    const error = scene.error ? bytes(scene.error) : null;
    for (let i = 0; i < cloud.length / 3; i++)
      colours.set(
        (error ? rampColour(error[i] / 255) : [41, 107, 168]).map((v) => v / 255),
        3 * i,
      );
    model.cloud = { places: cloud, colours };
  }
  return model;
}

function vertexNormals({ places, faces }) {
  const normals = new Float32Array(places.length);
  const at = (i) => [places[3 * i], places[3 * i + 1], places[3 * i + 2]];
  for (let f = 0; f < faces.length; f += 3) {
    const [a, b, c] = [at(faces[f]), at(faces[f + 1]), at(faces[f + 2])];
    const n = cross(
      b.map((v, k) => v - a[k]),
      c.map((v, k) => v - a[k]),
    );
    for (let j = 0; j < 3; j++) for (let k = 0; k < 3; k++) normals[3 * faces[f + j] + k] += n[k];
  }
  return normals;
}

// Browsers keep only a few WebGL contexts alive, so one view is open at a time; opening another closes it.
function sceneView(run) {
  openView?.close();
  const model = unpack(run.scene);
  const camera = new Camera();
  const show = { mesh: Boolean(model.mesh), cloud: Boolean(model.cloud) };
  let canvas = sceneCanvas(run);
  let renderer = webglRenderer(canvas, model);
  // A canvas that was asked for WebGL gives no other context.
  if (!renderer) {
    canvas = sceneCanvas(run);
    renderer = flatRenderer(canvas, model);
  }
  const draw = () => requestAnimationFrame(() => renderer.draw(camera, show));
  const box = h("div", { class: "view", "data-renderer": renderer.name }, canvas);
  whenSized(box, (width) => {
    const dense = Math.min(devicePixelRatio || 1, 2);
    canvas.width = Math.round(width * dense);
    canvas.height = Math.round(canvas.clientHeight * dense);
    draw();
  });
  control(canvas, camera, draw);
  const whole = h("div", {}, box, viewControls(run.scene, model, show, camera, draw), viewNote(run.scene));
  openView = {
    close() {
      renderer.close();
      whole.replaceChildren(button("Open 3D view", () => whole.replaceWith(sceneView(run))));
    },
  };
  return whole;
}

function viewControls(scene, model, show, camera, draw) {
  const toggle = (part, text) => {
    const box = h("input", { type: "checkbox", checked: true });
    box.addEventListener("change", () => {
      show[part] = box.checked;
      draw();
    });
    return h("label", { class: "choice" }, box, text);
  };
  const reset = () => {
    camera.reset();
    draw();
  };
  return h(
    "div",
    { class: "choices" },
    model.mesh && toggle("mesh", "mesh"),
    model.cloud && toggle("cloud", "denoised points"),
    button("Reset view", reset),
    scene.error &&
      h(
        "span",
        { class: "ramp-legend" },
        "0",
        h("i", { class: "ramp" }),
        `${showNumber(scene.top, 3)} from the true surface`,
      ),
  );
}

function viewNote(scene) {
  const { faces, points } = scene.counts;
  const notes = [
    "Drag or arrow keys turn, wheel (after a click), pinch or + and − zoom, 0 resets.",
    faces && `Shown: ${shownOf(faces, "triangles")}.`,
    points && `Shown: ${shownOf(points, "points")}.`,
    points && !scene.error && "The true surface is not known here, so the points have one colour.",
  ];
  return h("p", { class: "hint" }, notes.filter(Boolean).join(" "));
}

function shownOf([shown, all], noun) {
  return shown === all ? `${showNumber(all)} ${noun}` : `${showNumber(shown)} of ${showNumber(all)} ${noun}`;
}

function sceneCanvas(run) {
  return h("canvas", {
    class: "scene",
    tabindex: 0,
    role: "img",
    "aria-label": `3D view of ${label(run)}; arrow keys turn, plus and minus zoom`,
  });
}
