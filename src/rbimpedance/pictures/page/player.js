"use strict";
// Draws the scene that the page carries: an arm, its reference, the wrenches on it, the path of its tool.
// Poses are [x, y, z, qx, qy, qz, qw] in the world, z up. `window.player` is what tests and embedding pages talk to.

const COLORS = { ghost: 0x0072b2, force: 0xd55e00, moment: 0xd55e00, trace: 0x009e73, surface: 0xcc79a7,
  frames: 0x444444, compliance: 0xe69f00 };
const AXES = [0xd62728, 0x2ca02c, 0x1f77b4]; // x, y and z of a frame
const FIELD_OF_VIEW = 32; // degrees, upright
const MARGIN = 0.025; // of the page, on every side
const BAR = 50; // pixels below the picture that the controls take

const bytesOf = (id) => Uint8Array.from(atob(document.getElementById(id).textContent), (c) => c.charCodeAt(0));

async function unzipped(id) {
  const stream = new Blob([bytesOf(id)]).stream().pipeThrough(new DecompressionStream("gzip"));
  return new Response(stream).arrayBuffer();
}

// A scene is the length of its header as a 32-bit number, the header as JSON, and arrays that the header points into.
function unpacked(buffer) {
  const size = new DataView(buffer).getUint32(0, true);
  const start = 4 + size;
  const array = { f4: Float32Array, u1: Uint8Array };
  const header = JSON.parse(new TextDecoder().decode(new Uint8Array(buffer, 4, size)), (key, value) =>
    value && value.dtype ? new array[value.dtype](buffer.slice(start + value.start, start + value.end)) : value);
  return header;
}

class Player {
  constructor(scene, THREE, viewer) {
    Object.assign(this, { scene, THREE, viewer });
    this.root = viewer.scene;
    this.time = 0;
    this.speed = 1;
    this.playing = false;
    this.groups = { arm: new THREE.Group(), ghost: new THREE.Group(), force: new THREE.Group(),
      moment: new THREE.Group(), trace: new THREE.Group(), surface: new THREE.Group(),
      frames: new THREE.Group(), compliance: new THREE.Group() };
    for (const [name, group] of Object.entries(this.groups)) {
      group.name = name;
      this.root.add(group);
    }
    this.setTheStage();
    this.buildArm();
    this.buildGhost();
    this.buildWrenches();
    this.buildTrace();
    this.buildSurfaces();
    this.buildTool();
    this.frameTheArm();
    this.show(scene.now);
  }

  // --- stage ---

  setTheStage() {
    const { THREE, viewer, scene } = this;
    viewer.gui.domElement.style.display = "none";
    viewer.hide_background();
    viewer.renderer.setClearColor(0xffffff, 1);
    for (const path of [["Lights"], ["Grid"], ["Axes"]]) {
      viewer.scene_tree.find(path).object.visible = false;
    }
    const stage = new THREE.Group();
    stage.name = "stage";
    stage.position.set(scene.center[0], scene.center[1], scene.ground);
    const r = scene.radius;
    const sun = new THREE.DirectionalLight(0xffffff, 0.62);
    sun.position.set(-1.2 * r, -1.8 * r, 3.2 * r);
    sun.castShadow = true;
    sun.shadow.mapSize.set(2048, 2048);
    sun.shadow.radius = 4;
    sun.shadow.bias = -0.0005;
    sun.shadow.normalBias = 0.004 * r;
    Object.assign(sun.shadow.camera, { left: -2 * r, right: 2 * r, top: 2 * r, bottom: -2 * r, near: 0.1 * r, far: 9 * r });
    const fill = new THREE.DirectionalLight(0xffffff, 0.22);
    fill.position.set(2 * r, 0.4 * r, r);
    const sky = new THREE.HemisphereLight(0xffffff, 0xc9ced6, 0.5);
    sky.position.set(0, 0, 1);
    const floor = new THREE.Mesh(new THREE.CircleGeometry(6 * r, 64), new THREE.ShadowMaterial({ opacity: 0.13 }));
    floor.receiveShadow = true;
    floor.position.z = -0.002 * r;
    const cell = [0.01, 0.02, 0.05, 0.1, 0.2, 0.5, 1, 2, 5, 10].find((size) => size >= r / 4) || r / 4;
    const grid = new THREE.GridHelper(24 * cell, 24, 0xd3d9df, 0xe6eaee);
    grid.rotation.x = Math.PI / 2;
    grid.position.z = -0.003 * r;
    grid.material.depthWrite = false;
    stage.add(sun, sun.target, fill, fill.target, sky, floor, grid);
    this.root.add(stage);
  }

  // --- what is shown ---

  buildArm() {
    const { viewer, scene, groups } = this;
    this.links = scene.nodes.map((node, i) => {
      const path = ["links", String(i)];
      if (node.command) {
        viewer.handle_command_bytearray(node.command); // makes links/i out of meshcat's own message
        node.mesh = viewer.scene_tree.find([...path, "<object>"]).object;
      } else {
        node.mesh = scene.nodes[node.like].mesh.clone();
      }
      const link = new this.THREE.Group();
      link.add(node.mesh);
      groups.arm.add(link);
      node.mesh.castShadow = node.mesh.receiveShadow = true;
      return link;
    });
  }

  buildGhost() {
    const { THREE, scene, groups } = this;
    this.ghosts = [];
    if (!scene.now.ghost) return;
    const behind = { polygonOffset: true, polygonOffsetFactor: 2, polygonOffsetUnits: 2 };
    const outline = new THREE.MeshBasicMaterial({ ...behind, colorWrite: false }); // so that only its front shows
    const material = new THREE.MeshPhongMaterial({ ...behind, color: COLORS.ghost, transparent: true, opacity: 0.32 });
    this.ghosts = scene.nodes.map((node) => {
      const link = new THREE.Group();
      [outline, material].forEach((paint, order) => {
        const mesh = node.mesh.clone();
        mesh.material = paint;
        mesh.renderOrder = 1 + order;
        mesh.castShadow = mesh.receiveShadow = false;
        link.add(mesh);
      });
      groups.ghost.add(link);
      return link;
    });
  }

  // A force is an arrow. A moment is one that turns about its axis by the right-hand rule.
  buildWrenches() {
    const { THREE, scene, groups } = this;
    const material = new THREE.MeshPhongMaterial({ color: COLORS.force });
    const thick = 0.02 * scene.radius;
    const count = scene.now.wrenches.length / 9;
    this.largest = { force: scene.arrows.force.largest, moment: scene.arrows.moment.largest };
    this.curls = Array.from({ length: count }, () => {
      const r = scene.arrows.moment.size;
      const arc = 1.5 * Math.PI;
      const curl = new THREE.Group();
      const shaft = new THREE.Mesh(new THREE.TorusGeometry(r, 0.11 * r, 12, 48, arc), material);
      const head = new THREE.Mesh(new THREE.ConeGeometry(0.28 * r, 0.6 * r, 24), material);
      head.position.set(0.3 * r, -r, 0); // the arc ends at -y, on its way to +x
      head.rotation.z = -Math.PI / 2;
      shaft.castShadow = head.castShadow = true;
      curl.add(shaft, head);
      groups.moment.add(curl);
      return curl;
    });
    this.arrows = Array.from({ length: count }, () => {
      const arrow = new THREE.Group();
      const shaft = new THREE.Mesh(new THREE.CylinderGeometry(thick, thick, 1, 16), material);
      const head = new THREE.Mesh(new THREE.ConeGeometry(2.4 * thick, 6 * thick, 24), material);
      shaft.castShadow = head.castShadow = true;
      arrow.add(shaft, head);
      arrow.head = 6 * thick;
      groups.force.add(arrow);
      return arrow;
    });
  }

  buildTrace() {
    const { THREE, scene, groups } = this;
    const p = scene.trace;
    if (!p) return;
    const points = [];
    this.traced = []; // how long the path is at each frame
    let length = 0;
    for (let i = 0; i < p.length; i += 3) {
      const point = new THREE.Vector3(p[i], p[i + 1], p[i + 2]);
      const step = points.length ? points[points.length - 1].distanceTo(point) : Infinity;
      if (step > 0.004 * scene.radius) {
        points.push(point);
        length += Number.isFinite(step) ? step : 0;
      }
      this.traced.push(length);
    }
    if (points.length < 3) return;
    const curve = new THREE.CatmullRomCurve3(points);
    this.sides = 6;
    this.segments = 2 * points.length;
    const tube = new THREE.TubeGeometry(curve, this.segments, 0.009 * scene.radius, this.sides);
    const paint = { color: COLORS.trace };
    this.past = new THREE.Mesh(tube, new THREE.MeshBasicMaterial(paint));
    const all = new THREE.Mesh(tube.clone(), new THREE.MeshBasicMaterial({ ...paint, transparent: true, opacity: 0.25,
      depthWrite: false }));
    groups.trace.add(this.past, all);
  }

  buildSurfaces() {
    const { THREE, scene, groups } = this;
    const material = new THREE.MeshPhongMaterial({ color: COLORS.surface, transparent: true, opacity: 0.35,
      side: THREE.DoubleSide, depthWrite: false });
    this.surfaces = scene.surfaces.map((surface) => {
      const side = 1.1 * scene.radius;
      const plane = new THREE.Mesh(new THREE.PlaneGeometry(side, side), material);
      const edge = new THREE.LineSegments(new THREE.EdgesGeometry(plane.geometry),
        new THREE.LineBasicMaterial({ color: COLORS.surface }));
      plane.add(edge);
      const normal = new THREE.Vector3(...surface.normal);
      plane.quaternion.setFromUnitVectors(new THREE.Vector3(0, 0, 1), normal);
      plane.home = new THREE.Vector3(...surface.point);
      plane.normal = normal;
      plane.position.copy(plane.home);
      groups.surface.add(plane);
      return plane;
    });
  }

  // The frame of the tool is short and thick, its reference long and thin: where they are one, both show. They show
  // through the arm, as marks do.
  buildTool() {
    const { THREE, scene, groups } = this;
    this.atTool = [];
    if (!scene.now.tool) return;
    const triad = (length, thick) => {
      const frame = new THREE.Group();
      AXES.forEach((color, i) => {
        const shaft = new THREE.Mesh(new THREE.CylinderGeometry(thick, thick, length, 12),
          new THREE.MeshPhongMaterial({ color, depthTest: false, transparent: true }));
        shaft.renderOrder = 5;
        shaft.position.setComponent(i, length / 2);
        shaft.quaternion.setFromUnitVectors(new THREE.Vector3(0, 1, 0), new THREE.Vector3().setComponent(i, 1));
        frame.add(shaft);
      });
      groups.frames.add(frame);
      return frame;
    };
    const thick = 0.012 * scene.radius;
    this.atTool = [triad(0.7 * scene.triad, thick), triad(scene.triad, 0.4 * thick)];
    const ball = new THREE.Group();
    if (scene.compliance) {
      const skin = new THREE.Mesh(new THREE.SphereGeometry(1, 32, 24), new THREE.MeshPhongMaterial({
        color: COLORS.compliance, transparent: true, opacity: 0.35, depthWrite: false, depthTest: false }));
      skin.renderOrder = 4;
      skin.scale.fromArray(scene.compliance);
      ball.add(skin);
    }
    groups.compliance.add(ball);
    this.atTool.push(ball);
  }

  // --- poses ---

  place(links, poses) {
    links.forEach((link, i) => {
      link.position.fromArray(poses, 7 * i);
      link.quaternion.fromArray(poses, 7 * i + 3);
    });
  }

  // The share of the largest that a vector is; a live page learns what the largest is.
  shareOf(kind, vector) {
    const size = vector.length();
    this.largest[kind] = Math.max(this.largest[kind], size);
    return size > 0 ? size / this.largest[kind] : 0;
  }

  curl(curl, wrenches, at) {
    const { THREE } = this;
    const moment = new THREE.Vector3().fromArray(wrenches, at + 6);
    const share = this.shareOf("moment", moment);
    curl.visible = share > 0.02;
    if (!curl.visible) return;
    curl.scale.setScalar(share);
    curl.position.fromArray(wrenches, at);
    curl.quaternion.setFromUnitVectors(new THREE.Vector3(0, 0, 1), moment.normalize());
  }

  point(arrow, wrenches, at) {
    const { THREE, scene } = this;
    const vector = new THREE.Vector3().fromArray(wrenches, at + 3);
    const length = scene.arrows.force.size * this.shareOf("force", vector);
    arrow.visible = length > 1e-3 * scene.radius;
    if (!arrow.visible) return;
    const [shaft, head] = arrow.children;
    const tip = Math.min(arrow.head, 0.6 * length);
    head.scale.setScalar(tip / arrow.head);
    head.position.y = length - tip / 2;
    shaft.scale.set(1, length - tip, 1);
    shaft.position.y = (length - tip) / 2;
    arrow.position.fromArray(wrenches, at);
    arrow.quaternion.setFromUnitVectors(new THREE.Vector3(0, 1, 0), vector.normalize());
  }

  // now: {arm, ghost, wrenches, surfaces, tool}, flat arrays
  show(now) {
    this.place(this.links, now.arm);
    if (now.ghost) this.place(this.ghosts, now.ghost);
    if (now.tool) this.place(this.atTool, now.tool);
    this.arrows.forEach((arrow, i) => this.point(arrow, now.wrenches, 9 * i));
    this.curls.forEach((curl, i) => this.curl(curl, now.wrenches, 9 * i));
    this.surfaces.forEach((plane, i) => plane.position.copy(plane.home).addScaledVector(plane.normal, now.surfaces[i]));
    this.viewer.set_dirty();
  }

  between(frames, width, k, share) {
    const a = frames.subarray(k * width, (k + 1) * width);
    if (share === 0) return a;
    const b = frames.subarray((k + 1) * width, (k + 2) * width);
    return a.map((x, i) => x + share * (b[i] - x));
  }

  posesBetween(frames, n, k, share) {
    const { THREE } = this;
    const poses = this.between(frames, 7 * n, k, share);
    if (share === 0) return poses;
    for (let i = 0; i < n; i++) {
      const [a, b] = [k, k + 1].map((m) => new THREE.Quaternion().fromArray(frames, 7 * (m * n + i) + 3));
      a.slerp(b, share).toArray(poses, 7 * i + 3);
    }
    return poses;
  }

  seek(time) {
    const { frames } = this.scene;
    if (!frames) return;
    const n = this.links.length;
    this.time = Math.min(Math.max(time, 0), this.duration);
    const place = this.time / frames.period;
    const k = Math.min(Math.floor(place), frames.count - 1);
    const share = k === frames.count - 1 ? 0 : place - k;
    this.show({
      arm: this.posesBetween(frames.arm, n, k, share),
      ghost: frames.ghost && this.posesBetween(frames.ghost, n, k, share),
      wrenches: this.between(frames.wrenches, 9 * this.arrows.length, k, share),
      surfaces: this.between(frames.surfaces, this.surfaces.length, k, share),
      tool: frames.tool && this.posesBetween(frames.tool, this.atTool.length, k, share),
    });
    if (this.past) {
      const drawn = Math.round((this.segments * this.traced[k]) / this.traced[this.traced.length - 1]);
      this.past.geometry.setDrawRange(0, 6 * this.sides * drawn);
    }
    this.onTime(this.time);
  }

  onTime() {}

  get duration() {
    const { frames } = this.scene;
    return frames ? (frames.count - 1) * frames.period : 0;
  }

  play() {
    if (this.playing || !this.duration) return;
    this.playing = true;
    if (this.time >= this.duration) this.time = 0;
    let last = performance.now();
    const tick = (now) => {
      const next = this.time + (this.speed * (now - last)) / 1000;
      last = now;
      this.seek(next > this.duration ? 0 : next);
      this.frame = requestAnimationFrame(tick);
    };
    this.frame = requestAnimationFrame(tick);
    this.onPlaying(true);
  }

  pause() {
    this.playing = false;
    cancelAnimationFrame(this.frame); // else a play() before the next frame would run twice as fast
    this.onPlaying(false);
  }

  onPlaying() {}

  toggle(name, visible) {
    this.groups[name].visible = visible;
    this.viewer.set_dirty();
  }

  // --- camera ---

  // The nearest place along the line of sight from which every point of the arm's motion lies in the free part of the page.
  frameTheArm() {
    const { THREE, viewer, scene } = this;
    const [w, h] = [viewer.dom_element.offsetWidth || 1, window.innerHeight || 1];
    const bar = scene.frames ? BAR : 0;
    const t = Math.tan((FIELD_OF_VIEW * Math.PI) / 360);
    const side = t * (w / h) * (1 - 2 * MARGIN);
    const top = t * (1 - 2 * MARGIN);
    const bottom = t * (1 - 2 * MARGIN - (2 * bar) / h);
    const out = new THREE.Vector3(...scene.from);
    const right = new THREE.Vector3(0, 0, 1).cross(out).normalize();
    const up = out.clone().cross(right);
    const low = [Infinity, Infinity];
    const high = [-Infinity, -Infinity];
    const p = new THREE.Vector3();
    for (let i = 0; i < scene.outline.length; i += 3) {
      p.fromArray(scene.outline, i);
      const z = p.dot(out);
      [[p.dot(right), side, side], [p.dot(up), top, bottom]].forEach(([x, above, below], k) => {
        high[k] = Math.max(high[k], x + above * z);
        low[k] = Math.min(low[k], x - below * z);
      });
    }
    const spans = [2 * side, top + bottom];
    const away = Math.max(...spans.map((span, k) => (high[k] - low[k]) / span));
    const middle = (k, above, below) => (high[k] - above * away + low[k] + below * away) / 2;
    const eye = right.multiplyScalar(middle(0, side, side)).addScaledVector(up, middle(1, top, bottom));
    eye.addScaledVector(out, away);
    const depth = away - new THREE.Vector3(...scene.center).dot(out);
    const target = eye.clone().addScaledVector(out, -depth);
    const { camera, controls } = viewer;
    camera.fov = FIELD_OF_VIEW;
    camera.near = depth / 200;
    camera.far = depth * 40;
    camera.position.set(eye.x, eye.z, -eye.y); // meshcat keeps its camera in a frame whose y axis is up
    controls.target.set(target.x, target.z, -target.y);
    camera.updateProjectionMatrix();
    controls.update();
    viewer.set_dirty();
  }
}

function connectControls(player) {
  const at = (id) => document.getElementById(id);
  const { scene } = player;
  const title = document.createElement("strong");
  title.textContent = scene.title;
  at("legend").append(title);
  const shown = { ghost: scene.now.ghost, force: player.arrows.length, moment: player.largest.moment > 0,
    trace: player.past, surface: scene.surfaces.length, frames: scene.now.tool, compliance: scene.compliance };
  for (const [name, text] of Object.entries(scene.legend)) {
    if (!shown[name]) continue;
    const box = Object.assign(document.createElement("input"), { type: "checkbox", checked: true, id: `show-${name}` });
    box.style.accentColor = "#" + COLORS[name].toString(16).padStart(6, "0");
    box.onchange = () => player.toggle(name, box.checked);
    const label = document.createElement("label");
    label.append(box, text);
    at("legend").append(label);
  }
  let touched = false;
  player.viewer.controls.addEventListener("start", () => (touched = true));
  window.addEventListener("resize", () => touched || player.frameTheArm());
  if (!scene.frames) return;
  at("bar").hidden = false;
  at("bar").onsubmit = (event) => event.preventDefault();
  at("time").max = player.duration;
  const clock = (t) => `${t.toFixed(2)} / ${player.duration.toFixed(2)} s`;
  player.onTime = (t) => {
    at("time").value = t;
    at("clock").textContent = clock(t);
  };
  player.onPlaying = (playing) => (at("play").textContent = playing ? "❚❚" : "▶");
  at("play").onclick = () => (player.playing ? player.pause() : player.play());
  at("time").oninput = () => {
    player.pause();
    player.seek(Number(at("time").value));
  };
  at("speed").onchange = () => (player.speed = Number(at("speed").value));
  window.addEventListener("keydown", (event) => {
    if (["SELECT", "BUTTON"].includes(event.target.tagName)) return;
    if (event.key === " ") at("play").onclick();
    else if (event.key === "ArrowLeft") player.seek(player.time - scene.frames.period);
    else if (event.key === "ArrowRight") player.seek(player.time + scene.frames.period);
    else return;
    event.preventDefault();
  });
  player.seek(0);
  player.play();
}

function listen(player) {
  const events = new EventSource(`events?${player.scene.live}`);
  events.onmessage = (event) => {
    const news = JSON.parse(event.data);
    if (news.reload) location.reload();
    else player.show(news);
  };
}

async function main() {
  const message = document.getElementById("message");
  try {
    const [code, buffer] = await Promise.all([unzipped("bundle"), unzipped("scene")]);
    const script = document.createElement("script");
    script.textContent = new TextDecoder().decode(code);
    document.head.append(script);
    const viewer = new MeshCat.Viewer(document.getElementById("pane"));
    viewer.set_3d_pane_size();
    const player = new Player(unpacked(buffer), MeshCat.THREE, viewer);
    connectControls(player);
    if (player.scene.live) listen(player);
    message.textContent = "";
    window.player = player;
  } catch (error) {
    message.textContent = `This picture needs a browser of 2023 or later with WebGL (${error.message}).`;
    throw error;
  }
}

main();
