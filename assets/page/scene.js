// The objects in 3-D.

const GONE = new THREE.Color("#9aa5ad");
const SLOW = 1 / 40;  // seconds a picture, above which pictures get coarser
const COARSEST = 0.5;
const UP = new THREE.Vector3(0, 1, 0);

function matrixOf(rows) {
  return new THREE.Matrix4().set(...rows, 0, 0, 0, 1);
}

class View {
  constructor(canvas, changed) {
    // Without a graphics processor smooth edges are dear: then only still pictures have them.
    const soft = drawnInSoftware();
    this.renderer = new THREE.WebGLRenderer({ canvas, antialias: !soft });
    this.renderer.setClearColor(0xf3f6f8);
    const sharp = Math.min(window.devicePixelRatio, 2);
    this.still = soft ? 2 : sharp;
    this.moving = soft ? 1 : sharp;
    this.ratio = 0;
    this.times = [];
    this.scene = new THREE.Scene();
    this.camera = new THREE.PerspectiveCamera(28, 1, 0.001, 100);
    this.camera.up.set(0, 0, 1);
    this.scene.add(new THREE.HemisphereLight(0xffffff, 0xb9c4cc, 2.2));
    this.sun = new THREE.DirectionalLight(0xffffff, 1.6);
    this.camera.add(this.sun);
    this.sun.position.set(-1, 1.5, 2);
    this.scene.add(this.camera);
    this.controls = new THREE.OrbitControls(this.camera, canvas);
    this.controls.addEventListener("change", changed);
    this.world = null;
    this.showTruth = true;
    this.showRivals = true;
    this.held = null;
  }

  // Build everything that a story shows; what is seen of it depends on the time.
  tell(story) {
    const framed = this.world !== null;
    if (this.world) this.discard();
    this.story = story;
    this.world = new THREE.Group();
    this.scene.add(this.world);
    this.measure();
    this.shapes = story.objects.map((object) => (object.vertices ? this.shape(object) : null));
    this.rivals = story.rivals.map((rival) => this.body(rival.object, story.objects[rival.object].colour));
    this.truth = story.truth === null ? null : this.solid(story.truth);
    this.marks();
    if (story.plane !== null) this.grid();
    if (!framed) this.reset();
  }

  discard() {
    this.scene.remove(this.world);
    this.world.traverse((one) => {
      if (one.geometry) one.geometry.dispose();
      if (one.material) one.material.dispose();
    });
  }

  // The middle and the size of what matters.
  measure() {
    const story = this.story, points = [];
    const add = (object, pose, into) => {
      const matrix = matrixOf(pose), vertices = story.objects[object].vertices;
      for (let i = 0; i < vertices.length; i += 3) {
        into.push(new THREE.Vector3(vertices[i], vertices[i + 1], vertices[i + 2]).applyMatrix4(matrix));
      }
    };
    for (const step of story.steps) if (step.truth) add(story.truth, step.truth, points);
    // Of the rivals those that lived longest.
    const lived = (rival) => rival.died ?? Infinity;
    const longest = Math.max(0, ...story.rivals.map(lived));
    const last = story.rivals.filter((rival) => lived(rival) === longest).slice(0, 3);
    if (!points.length) for (const rival of last) add(rival.object, rival.poses.at(-1), points);
    const felt = story.steps.flatMap((step) => step.contacts);
    for (const row of felt) points.push(new THREE.Vector3(row[0], row[1], row[2]));
    const low = new THREE.Vector3(Infinity, Infinity, Infinity), high = low.clone().negate();
    for (const point of points) { low.min(point); high.max(point); }
    if (!points.length) { low.set(-0.05, -0.05, -0.05); high.set(0.05, 0.05, 0.05); }
    this.centre = low.clone().add(high).multiplyScalar(0.5);
    this.radius = Math.max(high.distanceTo(low) / 2, 1e-6);
    if (story.truth !== null) return;
    // Ways that met nothing should be seen, where they aren't too far out.
    let far = this.radius;
    for (const row of story.steps.flatMap((step) => step.ways)) {
      if (row[6] === 0) continue;
      const way = new THREE.Line3(new THREE.Vector3(row[0], row[1], row[2]), new THREE.Vector3(row[3], row[4], row[5]));
      far = Math.max(far, way.closestPointToPoint(this.centre, true, new THREE.Vector3()).distanceTo(this.centre));
    }
    this.radius = Math.min(far, 1.8 * this.radius);
  }

  shape(object) {
    const surface = new THREE.BufferGeometry();
    const corners = new Float32Array(object.triangles.length * 3);
    object.triangles.forEach((vertex, at) => corners.set(object.vertices.subarray(3 * vertex, 3 * vertex + 3), 3 * at));
    surface.setAttribute("position", new THREE.BufferAttribute(corners, 3));
    surface.computeVertexNormals();
    const edges = new THREE.BufferGeometry();
    edges.setAttribute("position", new THREE.BufferAttribute(object.edges, 3));
    return { surface, edges };
  }

  body(object, colour) {
    const { surface, edges } = this.shapes[object];
    const group = new THREE.Group();
    group.matrixAutoUpdate = false;
    const skin = new THREE.MeshLambertMaterial({ color: colour, transparent: true, depthWrite: false,
                                                 polygonOffset: true, polygonOffsetFactor: 1, polygonOffsetUnits: 1 });
    const wire = new THREE.LineBasicMaterial({ color: colour, transparent: true, depthWrite: false });
    group.add(new THREE.Mesh(surface, skin), new THREE.LineSegments(edges, wire));
    group.userData = { skin, wire, colour: new THREE.Color(colour) };
    group.children[0].renderOrder = 1;
    group.children[1].renderOrder = 2;
    this.world.add(group);
    return group;
  }

  solid(object) {
    const { surface, edges } = this.shapes[object];
    const group = new THREE.Group();
    group.matrixAutoUpdate = false;
    const skin = new THREE.MeshLambertMaterial({ color: TRUTH, polygonOffset: true,
                                                 polygonOffsetFactor: 1, polygonOffsetUnits: 1 });
    group.add(new THREE.Mesh(surface, skin),
              new THREE.LineSegments(edges, new THREE.LineBasicMaterial({ color: EDGE })));
    this.world.add(group);
    return group;
  }

  // Contacts, normals and ways: one instanced mesh a kind, filled anew for each picture.
  marks() {
    const most = Math.max(1, ...this.story.steps.map((step) => step.contacts.length));
    const rays = Math.max(1, ...this.story.steps.map((step) => step.ways.length));
    const many = (geometry, material, count) => {
      const mesh = new THREE.InstancedMesh(geometry, material, count);
      mesh.frustumCulled = false;
      mesh.renderOrder = 3;
      this.world.add(mesh);
      return mesh;
    };
    // Drawn as what is transparent is, after the rivals: they don't veil it.
    const felt = new THREE.MeshLambertMaterial({ color: CONTACT, transparent: true });
    const line = (colour) => new THREE.MeshBasicMaterial({ color: colour, transparent: true });
    const rod = () => new THREE.CylinderGeometry(1, 1, 1, 8).translate(0, 0.5, 0);
    this.dots = many(new THREE.SphereGeometry(1, 16, 10), felt, most);
    this.shafts = many(rod(), felt, most);
    this.heads = many(new THREE.ConeGeometry(1, 1, 14).translate(0, 0.5, 0), felt, most);
    this.hits = many(rod(), line(HIT), rays);
    this.misses = many(rod(), line(MISSED), rays * 24);
    this.tips = many(new THREE.SphereGeometry(1, 14, 9), line(HIT), rays);
  }

  grid() {
    const raw = this.radius / 3, power = 10 ** Math.floor(Math.log10(raw / this.story.unit[1]));
    const factor = [5, 2, 1].find((one) => one * power <= raw / this.story.unit[1]);
    const cell = factor * power * this.story.unit[1];
    this.cell = `${factor * power} ${this.story.unit[0]}`;
    const half = Math.ceil((1.7 * this.radius) / cell), ends = [], reach = half * cell;
    const x = Math.round(this.centre.x / cell) * cell, y = Math.round(this.centre.y / cell) * cell;
    for (let i = -half; i <= half; i++) {
      ends.push(x + i * cell, y - reach, 0, x + i * cell, y + reach, 0);
      ends.push(x - reach, y + i * cell, 0, x + reach, y + i * cell, 0);
    }
    const geometry = new THREE.BufferGeometry();
    geometry.setAttribute("position", new THREE.BufferAttribute(new Float32Array(ends), 3));
    const lines = new THREE.LineSegments(geometry, new THREE.LineBasicMaterial({ color: "#aab4bc", transparent: true, opacity: 0.8 }));
    lines.position.z = this.story.plane;
    this.world.add(lines);
  }

  // Everything as it is at a moment.
  show(phase) {
    const { step, share } = phase, now = this.story.steps[step];
    const before = this.story.steps[Math.max(step - 1, 0)];
    const there = this.story.rivals.map((rival) => presence(rival, phase));
    const crowd = there.reduce((sum, one) => sum + (one > 0.05), 0);
    // The last one left is solid, unless it would hide the truth.
    const alone = crowd <= 1, solid = alone && !(this.truth && this.showTruth);
    const base = solid ? 0.94 : alone ? 0.4 : Math.max(0.09, 0.42 / Math.sqrt(crowd));
    this.story.rivals.forEach((rival, index) => {
      const group = this.rivals[index], { skin, wire, colour } = group.userData;
      const held = this.held === null ? 1 : this.held === index ? 2.4 : 0.3;
      group.visible = this.showRivals && there[index] > 0.004;
      if (!group.visible) return;
      group.matrix.copy(matrixOf(poseOf(rival, phase)));
      skin.opacity = Math.min(base * there[index] * held, solid ? 1 : 0.85);
      skin.depthWrite = solid;
      // Where it all but lies on the truth it is seen whole; alone, its edges are.
      skin.polygonOffsetFactor = skin.polygonOffsetUnits = solid ? 1 : -3;
      wire.opacity = Math.min((alone ? 0.95 : 0.8) * there[index] * Math.min(held, 1.6), 1);
      skin.color.copy(colour);
      wire.color.copy(colour).multiplyScalar(solid ? 0.45 : 0.8);
      if (rival.died !== step) return;
      const gone = smooth((share - FELT + 0.1) / 0.2);
      for (const one of [skin, wire]) one.color.lerp(GONE, gone);
    });
    if (this.truth) {
      this.truth.visible = this.showTruth;
      this.truth.matrix.copy(matrixOf((share < FELT ? before : now).truth));
    }
    this.showContacts(share < WAYS_GROW ? { contacts: before.contacts, new: 0 } : now, smooth((share - WAYS_GROW) / 0.14));
    this.showWays(now.ways, smooth(share / WAYS_GROW));
  }

  showContacts({ contacts, new: fresh }, growth) {
    const size = this.radius * (contacts.length > 15 ? 0.014 : 0.019), length = this.radius * 0.2;
    let arrows = 0;
    contacts.forEach((row, index) => {
      const grown = index >= contacts.length - fresh ? growth : 1;
      const at = new THREE.Vector3(row[0], row[1], row[2]), along = new THREE.Vector3(row[3], row[4], row[5]);
      const none = new THREE.Quaternion();
      this.dots.setMatrixAt(index, compose(at, none, size * grown, size * grown));
      if (along.lengthSq() < 0.5) return;
      const turn = new THREE.Quaternion().setFromUnitVectors(UP, along.normalize());
      const tip = at.clone().addScaledVector(along, 0.72 * length * grown);
      this.shafts.setMatrixAt(arrows, compose(at, turn, 0.34 * size * grown, 0.74 * length * grown));
      this.heads.setMatrixAt(arrows, compose(tip, turn, 0.95 * size * grown, 0.28 * length * grown));
      arrows++;
    });
    fill(this.dots, contacts.length);
    fill(this.shafts, arrows);
    fill(this.heads, arrows);
  }

  showWays(ways, growth) {
    const thick = this.radius * (ways.length > 30 ? 0.002 : 0.0045), none = new THREE.Quaternion();
    let hits = 0, misses = 0;
    ways.forEach((row, index) => {
      const from = new THREE.Vector3(row[0], row[1], row[2]), to = new THREE.Vector3(row[3], row[4], row[5]);
      const along = to.clone().sub(from), length = along.length() * growth;
      const turn = new THREE.Quaternion().setFromUnitVectors(UP, along.normalize());
      this.tips.setMatrixAt(index, compose(from.clone().addScaledVector(along, length), none, 2.6 * thick, 2.6 * thick));
      if (row[6] === 0) {
        this.hits.setMatrixAt(hits++, compose(from, turn, thick, length));
        return;
      }
      // What touched nothing is dashed, so that it differs in more than its colour.
      const pieces = 12, dash = along.clone().multiplyScalar(length / pieces);
      for (let i = 0; i < pieces; i++) {
        this.misses.setMatrixAt(misses++, compose(from.clone().addScaledVector(dash, i), turn, thick, (0.55 * length) / pieces));
      }
    });
    fill(this.hits, hits);
    fill(this.misses, misses);
    fill(this.tips, ways.length);
  }

  // Look at everything from a heading and a height, degrees.
  look(azimuth, elevation) {
    const a = (azimuth * Math.PI) / 180, e = (elevation * Math.PI) / 180;
    const half = (this.camera.fov * Math.PI) / 360;
    const narrow = Math.atan(Math.tan(half) * Math.min(this.camera.aspect, 1));
    const far = (1.22 * this.radius) / Math.sin(narrow);
    this.controls.target.copy(this.centre);
    this.camera.position.set(Math.cos(e) * Math.cos(a), Math.cos(e) * Math.sin(a), Math.sin(e)).multiplyScalar(far).add(this.centre);
    this.camera.near = far / 100;
    this.camera.far = far * 20;
    this.camera.updateProjectionMatrix();
    this.controls.update();
  }

  // From the side on which most was felt.
  reset() {
    const felt = this.story.steps.at(-1).contacts;
    const x = felt.reduce((sum, row) => sum + row[3], 0), y = felt.reduce((sum, row) => sum + row[4], 0);
    const clear = Math.hypot(x, y) > 0.15 * felt.length;
    this.look(clear ? (Math.atan2(y, x) * 180) / Math.PI + 20 : -60, 26);
  }

  zoom(factor) {
    this.camera.position.sub(this.controls.target).multiplyScalar(factor).add(this.controls.target);
    this.controls.update();
  }

  resize() {
    const { clientWidth: width, clientHeight: height } = this.renderer.domElement;
    if (!width || !height) return;
    this.renderer.setSize(width, height, false);
    this.camera.aspect = width / height;
    this.camera.updateProjectionMatrix();
  }

  // In motion coarser, if need be, to keep up; ``passed`` are the seconds since the last picture.
  drawMoving(passed) {
    this.times.push(passed);
    if (this.times.length >= 5) {
      const median = this.times.sort((a, b) => a - b)[2];
      // The time goes with the number of pixels, at most.
      if (median > SLOW) this.moving = Math.max(Math.sqrt(SLOW / median) * this.moving, COARSEST);
      this.times = [];
    }
    this.draw(this.moving);
  }

  drawStill() {
    this.times = [];
    this.draw(this.still);
  }

  draw(ratio) {
    if (ratio !== this.ratio) {
      this.ratio = ratio;
      this.renderer.setPixelRatio(ratio);
      this.resize();
    }
    this.renderer.render(this.scene, this.camera);
  }
}

function drawnInSoftware() {
  const pen = document.createElement("canvas").getContext("webgl");
  const told = pen && pen.getExtension("WEBGL_debug_renderer_info");
  const name = told ? pen.getParameter(told.UNMASKED_RENDERER_WEBGL) : "";
  if (pen) pen.getExtension("WEBGL_lose_context")?.loseContext();
  return /swiftshader|llvmpipe|software|basic render/i.test(name);
}

function compose(at, turn, thick, length) {
  return new THREE.Matrix4().compose(at, turn, new THREE.Vector3(Math.max(thick, 1e-9), Math.max(length, 1e-9), Math.max(thick, 1e-9)));
}

function fill(mesh, count) {
  mesh.count = count;
  mesh.visible = count > 0;
  mesh.instanceMatrix.needsUpdate = true;
}
