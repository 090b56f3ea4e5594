// Mesh and cloud on a plain canvas, farthest first: for browsers without WebGL.

function flatRenderer(canvas, model) {
  const pen = canvas.getContext("2d");
  const light = [-0.4, 0.6, 0.7].map((v) => v / Math.hypot(0.4, 0.6, 0.7));
  const project = (places, rows) => {
    const out = new Float32Array(places.length);
    for (let i = 0; i < places.length; i += 3)
      for (let k = 0; k < 3; k++)
        out[i + k] = places[i] * rows[k][0] + places[i + 1] * rows[k][1] + places[i + 2] * rows[k][2];
    return out;
  };
  return {
    name: "flat",
    draw(camera, show) {
      const rows = camera.rows(),
        { width, height } = canvas,
        factor = (0.95 * camera.zoom * Math.min(width, height)) / 2;
      const px = (view, i) => width / 2 + factor * view[3 * i],
        py = (view, i) => height / 2 - factor * view[3 * i + 1];
      pen.clearRect(0, 0, width, height);
      const things = [];
      if (model.mesh && show.mesh) {
        const view = project(model.mesh.places, rows),
          { faces } = model.mesh;
        for (let f = 0; f < faces.length; f += 3) {
          const [a, b, c] = [faces[f], faces[f + 1], faces[f + 2]];
          things.push([view[3 * a + 2] + view[3 * b + 2] + view[3 * c + 2], () => triangle(view, a, b, c)]);
        }
      }
      if (model.cloud && show.cloud) {
        const view = project(model.cloud.places, rows),
          size = Math.max(1.5, 0.004 * Math.min(width, height));
        for (let i = 0; i < model.cloud.places.length / 3; i++)
          things.push([
            3 * view[3 * i + 2] + 0.01,
            () => {
              pen.fillStyle = `rgb(${[0, 1, 2].map((k) => Math.round(255 * model.cloud.colours[3 * i + k])).join(" ")})`;
              pen.fillRect(px(view, i) - size / 2, py(view, i) - size / 2, size, size);
            },
          ]);
      }
      const triangle = (view, a, b, c) => {
        const edge = (p, q) => [0, 1, 2].map((k) => view[3 * q + k] - view[3 * p + k]);
        let n = cross(edge(a, b), edge(a, c));
        const long = Math.hypot(...n) || 1;
        n = n.map((v) => (n[2] < 0 ? -v : v) / long);
        const shade = 0.42 + 0.55 * Math.max(0, n[0] * light[0] + n[1] * light[1] + n[2] * light[2]);
        pen.fillStyle = pen.strokeStyle = `rgb(${[184, 199, 214].map((v) => Math.round(v * shade)).join(" ")})`;
        pen.beginPath();
        pen.moveTo(px(view, a), py(view, a));
        pen.lineTo(px(view, b), py(view, b));
        pen.lineTo(px(view, c), py(view, c));
        pen.closePath();
        pen.fill();
        pen.stroke();
      };
      things.sort((a, b) => a[0] - b[0]).forEach((thing) => thing[1]());
    },
    close() {},
  };
}

function cross(a, b) {
  return [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]];
}
