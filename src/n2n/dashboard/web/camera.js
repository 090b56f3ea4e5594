// An orbiting view: where pointers, keys and the wheel turn it, and the matrix it means.

class Camera {
  constructor() {
    this.reset();
  }

  reset() {
    this.yaw = -0.6;
    this.pitch = 0.4;
    this.zoom = 1;
  }

  turn(dx, dy) {
    this.yaw -= dx * 0.01;
    this.pitch = Math.max(-1.55, Math.min(1.55, this.pitch + dy * 0.01));
  }

  scale(factor) {
    this.zoom = Math.max(0.3, Math.min(20, this.zoom * factor));
  }

  // Rows: right, up, towards the eye; z points up in the world.
  rows() {
    const [cy, sy, cp, sp] = [Math.cos(this.yaw), Math.sin(this.yaw), Math.cos(this.pitch), Math.sin(this.pitch)];
    return [
      [cy, sy, 0],
      [-sy * sp, cy * sp, cp],
      [sy * cp, -cy * cp, sp],
    ];
  }
}

function control(canvas, camera, draw) {
  const pointers = new Map();
  let spread = 0;
  canvas.addEventListener("pointerdown", (event) => {
    pointers.set(event.pointerId, [event.clientX, event.clientY]);
    canvas.setPointerCapture(event.pointerId);
    canvas.focus({ preventScroll: true });
  });
  canvas.addEventListener("pointermove", (event) => {
    const before = pointers.get(event.pointerId);
    if (!before) return;
    pointers.set(event.pointerId, [event.clientX, event.clientY]);
    if (pointers.size === 1) camera.turn(event.clientX - before[0], event.clientY - before[1]);
    else {
      const [a, b] = [...pointers.values()],
        now = Math.hypot(a[0] - b[0], a[1] - b[1]);
      if (spread) camera.scale(now / spread);
      spread = now;
    }
    draw();
  });
  const release = (event) => {
    pointers.delete(event.pointerId);
    spread = 0;
  };
  canvas.addEventListener("pointerup", release);
  canvas.addEventListener("pointercancel", release);
  // The wheel scrolls the page until the view was chosen by a click or the keyboard.
  canvas.addEventListener(
    "wheel",
    (event) => {
      if (document.activeElement !== canvas) return;
      event.preventDefault();
      camera.scale(Math.exp(-event.deltaY * 0.0015));
      draw();
    },
    { passive: false },
  );
  canvas.addEventListener("dblclick", () => {
    camera.reset();
    draw();
  });
  const keys = {
    ArrowLeft: () => camera.turn(-12, 0),
    ArrowRight: () => camera.turn(12, 0),
    ArrowUp: () => camera.turn(0, -12),
    ArrowDown: () => camera.turn(0, 12),
    "+": () => camera.scale(1.15),
    "=": () => camera.scale(1.15),
    "-": () => camera.scale(1 / 1.15),
    0: () => camera.reset(),
  };
  canvas.addEventListener("keydown", (event) => {
    if (!keys[event.key]) return;
    event.preventDefault();
    keys[event.key]();
    draw();
  });
}
