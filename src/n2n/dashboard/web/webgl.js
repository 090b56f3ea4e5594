// Mesh and cloud drawn by WebGL.

const VERTEX = `
attribute vec3 place; attribute vec3 normal; attribute vec3 colour;
uniform vec3 right, up, eye, scale; uniform float size, nearer;
varying vec3 lit; varying vec3 tint;
void main() {
  vec3 view = vec3(dot(place, right), dot(place, up), dot(place, eye));
  gl_Position = vec4(view.xy * scale.xy, -view.z * scale.z - nearer, 1.0);
  gl_PointSize = size;
  lit = vec3(dot(normal, right), dot(normal, up), dot(normal, eye));
  tint = colour;
}`;
const FRAGMENT = `
precision mediump float;
varying vec3 lit; varying vec3 tint; uniform float round;
void main() {
  vec3 n;
  if (round > 0.5) {
    vec2 p = 2.0 * gl_PointCoord - 1.0;
    float r = dot(p, p);
    if (r > 1.0) discard;
    n = vec3(p.x, -p.y, sqrt(1.0 - r));
  } else {
    n = normalize(lit);
    if (n.z < 0.0) n = -n;
  }
  float light = 0.42 + 0.50 * max(dot(n, normalize(vec3(-0.4, 0.6, 0.7))), 0.0) + 0.14 * max(dot(n, vec3(0.7, -0.2, 0.6)), 0.0);
  gl_FragColor = vec4(tint * light, 1.0);
}`;

function webglRenderer(canvas, model) {
  const gl = canvas.getContext("webgl", { antialias: true, alpha: true });
  if (!gl) return null;
  const program = gl.createProgram();
  for (const [kind, source] of [
    [gl.VERTEX_SHADER, VERTEX],
    [gl.FRAGMENT_SHADER, FRAGMENT],
  ]) {
    const shader = gl.createShader(kind);
    gl.shaderSource(shader, source);
    gl.compileShader(shader);
    gl.attachShader(program, shader);
  }
  gl.linkProgram(program);
  if (!gl.getProgramParameter(program, gl.LINK_STATUS)) return null;
  gl.useProgram(program);
  gl.enable(gl.DEPTH_TEST);
  const uniform = (name) => gl.getUniformLocation(program, name);
  const load = (kind, array) => {
    const buffer = gl.createBuffer();
    gl.bindBuffer(kind, buffer);
    gl.bufferData(kind, array, gl.STATIC_DRAW);
    return buffer;
  };
  const mesh = model.mesh && {
    place: load(gl.ARRAY_BUFFER, model.mesh.places),
    normal: load(gl.ARRAY_BUFFER, model.mesh.normals),
    faces: load(gl.ELEMENT_ARRAY_BUFFER, model.mesh.faces),
    count: model.mesh.faces.length,
  };
  const cloud = model.cloud && {
    place: load(gl.ARRAY_BUFFER, model.cloud.places),
    colour: load(gl.ARRAY_BUFFER, model.cloud.colours),
    count: model.cloud.places.length / 3,
  };
  const bind = (name, buffer, fixed) => {
    const place = gl.getAttribLocation(program, name);
    if (place < 0) return;
    if (!buffer) {
      gl.disableVertexAttribArray(place);
      gl.vertexAttrib3f(place, ...fixed);
      return;
    }
    gl.bindBuffer(gl.ARRAY_BUFFER, buffer);
    gl.enableVertexAttribArray(place);
    gl.vertexAttribPointer(place, 3, gl.FLOAT, false, 0, 0);
  };
  return {
    name: "webgl",
    draw(camera, show) {
      const [right, up, eye] = camera.rows(),
        short = Math.min(canvas.width, canvas.height);
      gl.viewport(0, 0, canvas.width, canvas.height);
      gl.clearColor(0, 0, 0, 0);
      gl.clear(gl.COLOR_BUFFER_BIT | gl.DEPTH_BUFFER_BIT);
      gl.uniform3f(uniform("right"), ...right);
      gl.uniform3f(uniform("up"), ...up);
      gl.uniform3f(uniform("eye"), ...eye);
      const zoom = 0.95 * camera.zoom;
      gl.uniform3f(uniform("scale"), (zoom * short) / canvas.width, (zoom * short) / canvas.height, 0.5);
      gl.uniform1f(uniform("size"), Math.max(2, short * 0.008 * Math.sqrt(camera.zoom)));
      if (mesh && show.mesh) {
        gl.uniform1f(uniform("round"), 0);
        gl.uniform1f(uniform("nearer"), 0);
        bind("place", mesh.place);
        bind("normal", mesh.normal);
        bind("colour", null, [0.72, 0.78, 0.84]);
        gl.bindBuffer(gl.ELEMENT_ARRAY_BUFFER, mesh.faces);
        gl.drawElements(gl.TRIANGLES, mesh.count, gl.UNSIGNED_SHORT, 0);
      }
      if (cloud && show.cloud) {
        // Points on the surface are not to be hidden by it.
        gl.uniform1f(uniform("round"), 1);
        gl.uniform1f(uniform("nearer"), 0.004);
        bind("place", cloud.place);
        bind("normal", null, [0, 0, 1]);
        bind("colour", cloud.colour);
        gl.drawArrays(gl.POINTS, 0, cloud.count);
      }
    },
    // Browsers keep only a few contexts alive.
    close() {
      gl.getExtension("WEBGL_lose_context")?.loseContext();
    },
  };
}
