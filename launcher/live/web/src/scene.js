// The vehicle in space, by three.js: body, rotors with their thrust, path, course, reference and wind.
//
// Everything stands in the group `ned`, whose axes are north, east and down, so that numbers of the flight need no
// conversion; three.js itself has y up.

import * as THREE from 'three';
import { OrbitControls } from 'three/examples/jsm/controls/OrbitControls.js';

const DELAY_S = 0.1; // the picture lags by two rows, between which it moves smoothly
const PATH_POINTS = 20000;
const THRUST_M = 0.5; // length of the arrow for a thrust of a third of the weight [m]
const WIND_M_PER_MPS = 0.15;
const UP = new THREE.Vector3(0, 0, -1);
const VIEWS = { behind: [-1, 0, -0.45], front: [1, 0, -0.3], above: [-0.01, 0, -1], far: [-1, -0.6, -0.8] };

export function scene(element) {
  let renderer;
  try {
    renderer = new THREE.WebGLRenderer({ antialias: true });
  } catch {
    element.innerHTML = '<p class="hint">This browser has no WebGL, so there is no picture of the vehicle.</p>';
    return { begin() {}, add() {}, restart() {}, pace() {} };
  }
  renderer.setPixelRatio(Math.min(devicePixelRatio, 2));
  element.append(renderer.domElement);
  const world = new THREE.Scene();
  const camera = new THREE.PerspectiveCamera(45, 1, 0.05, 2000);
  const controls = new OrbitControls(camera, renderer.domElement);
  controls.enablePan = false;
  world.add(new THREE.HemisphereLight(0xffffff, 0x778899, 2.2));
  const sun = new THREE.DirectionalLight(0xffffff, 1.6);
  sun.position.set(3, 8, 4);
  world.add(sun);
  const ned = new THREE.Group();
  ned.matrixAutoUpdate = false;
  ned.matrix.set(0, 1, 0, 0, 0, 0, -1, 0, -1, 0, 0, 0, 0, 0, 0, 1); // x = east, y = -down, z = -north
  world.add(ned);

  const still = matchMedia('(prefers-reduced-motion: reduce)').matches;
  let parts = null;
  let rows = [];
  let shown = null; // time that the picture shows [s]
  let speed = 1; // speed of playing, as a multiple of real time
  let last = performance.now();

  const colour = name => new THREE.Color(getComputedStyle(document.documentElement).getPropertyValue(`--${name}`).trim());

  function paint() {
    world.background = colour('tint');
    if (!parts) return;
    parts.ground.material.color = colour('muted');
    parts.path.material.color = colour('blue');
    parts.course.material.color = colour('muted');
    parts.point.material.color = colour('green');
    parts.wind.material.color = colour('ink');
    for (const arrow of parts.thrust) arrow.material.color = colour('orange');
    parts.body.traverse(part => { if (part.userData.colour) part.material.color = colour(part.userData.colour); });
  }

  function begin(flight) {
    ned.clear();
    rows = [];
    shown = null;
    parts = build(flight);
    ned.add(parts.ground, parts.course, parts.path, parts.point, parts.body, parts.wind);
    parts.flight = flight;
    paint();
    view('behind');
  }

  function view(name) {
    const [forward, right, down] = VIEWS[name];
    const heading = name === 'far' ? 0 : parts?.body.rotation.z ?? 0;
    const north = forward * Math.cos(heading) - right * Math.sin(heading);
    const east = forward * Math.sin(heading) + right * Math.cos(heading);
    const far = name === 'far' && parts ? parts.extent * 1.6 + 3 : 2.4;
    const target = name === 'far' && parts ? parts.middle : position();
    const away = new THREE.Vector3(east, -down, -north).normalize().multiplyScalar(far);
    controls.target.copy(target);
    camera.position.copy(target).add(away);
    if (parts) parts.follows = name !== 'far';
    controls.update();
  }

  // Returns the position of the vehicle in the axes of three.js.
  function position() {
    const at = parts?.body.position ?? new THREE.Vector3();
    return new THREE.Vector3(at.y, -at.z, -at.x);
  }

  function add(more) {
    const known = more.filter(row => row.x !== null && row.phi !== null && row.omega1 !== null);
    rows = rows.concat(known).slice(-40);
    for (const { x, y, z } of known) addToPath(x, y, z);
  }

  // Forgets the rows and the path, because rows of another time follow.
  function restart() {
    if (!parts) return;
    rows = [];
    shown = null;
    parts.path.count = 0;
    parts.path.geometry.setDrawRange(0, 0);
  }

  function pace(times) {
    speed = times;
  }

  function addToPath(x, y, z) {
    const { path } = parts;
    const place = path.geometry.attributes.position;
    if (path.count === PATH_POINTS) {
      place.array.copyWithin(0, 3 * PATH_POINTS / 2); // the older half is forgotten
      path.count = PATH_POINTS / 2;
    }
    place.setXYZ(path.count++, x, y, z);
    place.needsUpdate = true;
    path.geometry.setDrawRange(0, path.count);
  }

  // Returns the values interpolated between the two rows around the time that is shown.
  function between() {
    const after = rows.findIndex(row => row.time > shown);
    if (after < 0) return rows.at(-1);
    if (after === 0) return rows[0];
    const [a, b] = [rows[after - 1], rows[after]];
    const share = (shown - a.time) / (b.time - a.time);
    const mixed = { ...a };
    for (const name in a) if (a[name] !== null && b[name] !== null) mixed[name] = a[name] + share * (b[name] - a[name]);
    if (Math.abs(b.psi - a.psi) > 3) mixed.psi = b.psi; // the heading jumps from pi to -pi here
    return mixed;
  }

  function frame(now) {
    requestAnimationFrame(frame);
    const passed = Math.min((now - last) / 1000, 0.5);
    last = now;
    if (document.hidden || !resize()) return;
    if (parts && rows.length) {
      const newest = rows.at(-1).time - DELAY_S;
      shown = shown === null || Math.abs(newest - shown) > 0.5 * Math.max(speed, 1) ? newest : Math.min(shown + speed * passed, newest + DELAY_S);
      pose(between(), passed);
    }
    controls.update();
    renderer.render(world, camera);
  }

  function pose(row, passed) {
    const before = position();
    const { body, rotors, thrust, flight } = parts;
    body.position.set(row.x, row.y, row.z);
    body.rotation.set(row.phi, row.theta, row.psi, 'ZYX');
    rotors[0].rotation.x = row.tilt;
    [row.omega1, row.omega2, row.omega3].forEach((omega, i) => {
      if (!still) rotors[i].blades.rotation.z += (i === 1 ? -1 : 1) * omega / 300 * 25 * passed;
      const share = 3 * flight.thrust_factor * omega * omega / flight.weight_n;
      thrust[i].point(UP, THRUST_M * share);
    });
    if (row.x_wanted !== null) parts.point.position.set(row.x_wanted, row.y_wanted, row.z_wanted);
    const wind = new THREE.Vector3(row.mean_wind_north, row.mean_wind_east, row.mean_wind_down);
    parts.wind.visible = wind.length() > 0.05;
    if (parts.wind.visible) {
      parts.wind.position.set(row.x, row.y, row.z - 0.55).addScaledVector(wind, -WIND_M_PER_MPS / 2);
      parts.wind.point(wind.clone().normalize(), wind.length() * WIND_M_PER_MPS);
    }
    if (parts.follows) {
      const moved = position().sub(before);
      camera.position.add(moved);
      controls.target.add(moved);
    }
  }

  function resize() {
    const { clientWidth: width, clientHeight: height } = element;
    if (!width || !height) return false;
    const size = renderer.getSize(new THREE.Vector2());
    if (size.x !== width || size.y !== height) {
      renderer.setSize(width, height);
      camera.aspect = width / height;
      camera.updateProjectionMatrix();
    }
    return true;
  }

  function turn(event) {
    const spherical = new THREE.Spherical().setFromVector3(camera.position.clone().sub(controls.target));
    const steps = { ArrowLeft: [-0.1, 0, 1], ArrowRight: [0.1, 0, 1], ArrowUp: [0, -0.1, 1], ArrowDown: [0, 0.1, 1], '+': [0, 0, 0.85], '-': [0, 0, 1.18] };
    const step = steps[event.key];
    if (!step) return;
    event.preventDefault();
    spherical.theta += step[0];
    spherical.phi = Math.min(Math.max(spherical.phi + step[1], 0.02), Math.PI - 0.02);
    spherical.radius *= step[2];
    camera.position.setFromSpherical(spherical).add(controls.target);
  }

  element.addEventListener('keydown', turn);
  for (const button of document.querySelectorAll('[data-view]')) button.addEventListener('click', () => view(button.dataset.view));
  matchMedia('(prefers-color-scheme: dark)').addEventListener('change', paint);
  paint();
  requestAnimationFrame(frame);
  return { begin, add, restart, pace };
}

// Makes the parts of the picture, in metres, north, east and down.
function build(flight) {
  const course = flight.course_m.map(([n, e, d]) => new THREE.Vector3(n, e, d));
  const box = new THREE.Box3().setFromPoints(course.concat(new THREE.Vector3()));
  const size = box.getSize(new THREE.Vector3());
  const centre = box.getCenter(new THREE.Vector3());
  const extent = Math.max(size.length(), 2);
  const ground = grid(centre, flight.ground_down_m, Math.max(4, Math.ceil(Math.max(size.x, size.y) / 2) + 3));
  const courseLine = new THREE.Line(new THREE.BufferGeometry().setFromPoints(course), new THREE.LineDashedMaterial({ dashSize: 0.15, gapSize: 0.1 }));
  courseLine.computeLineDistances();
  const points = new THREE.BufferGeometry();
  points.setAttribute('position', new THREE.BufferAttribute(new Float32Array(3 * PATH_POINTS), 3));
  points.setDrawRange(0, 0);
  const path = Object.assign(new THREE.Line(points, new THREE.LineBasicMaterial()), { frustumCulled: false, count: 0 });
  const point = new THREE.Mesh(new THREE.SphereGeometry(0.06, 20, 14), new THREE.MeshLambertMaterial());
  const wind = arrow();
  const { body, rotors, thrust } = vehicle(flight.hubs_m);
  const middle = new THREE.Vector3(centre.y, -centre.z, -centre.x);
  return { ground, course: courseLine, path, point, wind, body, rotors, thrust, extent, middle, follows: true };
}

// Makes a grid of squares of 1 m at height zero, whose coordinate is `down`.
function grid(centre, down, half) {
  const corners = [];
  const [n0, e0] = [Math.round(centre.x), Math.round(centre.y)];
  for (let i = -half; i <= half; i++) {
    for (let j = -half; j < half; j++) {
      corners.push(new THREE.Vector3(n0 + i, e0 + j, down), new THREE.Vector3(n0 + i, e0 + j + 1, down));
      corners.push(new THREE.Vector3(n0 + j, e0 + i, down), new THREE.Vector3(n0 + j + 1, e0 + i, down));
    }
  }
  return new THREE.LineSegments(new THREE.BufferGeometry().setFromPoints(corners), new THREE.LineBasicMaterial({ transparent: true, opacity: 0.35 }));
}

// Makes body, arms and rotors in the body frame: forward, right, down. The front rotor tilts about the forward axis.
function vehicle(hubs) {
  const body = new THREE.Group();
  const mesh = (geometry, colour, more) => {
    const part = new THREE.Mesh(geometry, new THREE.MeshLambertMaterial(more));
    part.userData.colour = colour;
    return part;
  };
  body.add(mesh(new THREE.BoxGeometry(0.2, 0.12, 0.07), 'muted'));
  const thrust = [];
  const rotors = hubs.map((hub, i) => {
    const at = new THREE.Vector3(...hub);
    const arm = mesh(new THREE.BoxGeometry(at.length(), 0.025, 0.025), i === 0 ? 'orange' : 'muted');
    arm.position.copy(at).multiplyScalar(0.5);
    arm.quaternion.setFromUnitVectors(new THREE.Vector3(1, 0, 0), at.clone().normalize());
    const rotor = new THREE.Group();
    rotor.position.copy(at);
    const radius = at.length() * 0.55;
    const disc = mesh(new THREE.CylinderGeometry(radius, radius, 0.006, 40), i === 0 ? 'orange' : 'blue', { transparent: true, opacity: 0.3 });
    disc.rotation.x = Math.PI / 2;
    disc.position.z = -0.05;
    const mast = mesh(new THREE.CylinderGeometry(0.012, 0.012, 0.06, 12), 'muted');
    mast.rotation.x = Math.PI / 2;
    mast.position.z = -0.025;
    const blades = mesh(new THREE.BoxGeometry(2 * radius, 0.03, 0.008), i === 0 ? 'orange' : 'blue');
    blades.position.z = -0.055;
    thrust[i] = arrow();
    thrust[i].position.z = -0.06;
    rotor.add(mast, disc, blades, thrust[i]);
    rotor.blades = blades;
    body.add(arm, rotor);
    return rotor;
  });
  return { body, rotors, thrust };
}

// Makes an arrow, which `point` gives a direction and a length.
function arrow() {
  const group = new THREE.Group();
  const material = new THREE.MeshBasicMaterial();
  const shaft = new THREE.Mesh(new THREE.CylinderGeometry(0.011, 0.011, 1, 12), material);
  const head = new THREE.Mesh(new THREE.ConeGeometry(0.035, 0.1, 18), material);
  group.add(shaft, head);
  group.material = material;
  group.point = (direction, length) => {
    const stem = Math.max(length - 0.1, 0.001);
    shaft.scale.y = stem;
    shaft.position.y = stem / 2;
    head.position.y = stem + 0.05;
    group.quaternion.setFromUnitVectors(new THREE.Vector3(0, 1, 0), direction);
  };
  return group;
}
