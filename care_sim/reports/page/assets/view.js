// Episodes from above: lengths come in centimetres, angles in milliradians, y to the left; here metres, y down.

const SVG = "http://www.w3.org/2000/svg";
const VIEW = { behind: 9, ahead: 41, side: 9.5, ring: 1.5 };
const NARROW = { behind: 6, ahead: 26, side: 9.5, ring: 1.5 };
const PATH = 40;
const STATES = ["unseen", "in-view", "found"];

function add(parent, name, attributes = {}, text = "") {
  const element = parent.appendChild(document.createElementNS(SVG, name));
  for (const [key, value] of Object.entries(attributes)) element.setAttribute(key, value);
  if (text) element.textContent = text;
  return element;
}

const degrees = (milliradians) => (-milliradians * 0.18) / Math.PI;
const place = ([x, y, yaw]) => `translate(${x / 100} ${-y / 100}) rotate(${degrees(yaw)})`;
const HALF_TURN = 1000 * Math.PI;
const turn = (from, to) => ((((to - from + HALF_TURN) % (2 * HALF_TURN)) + 2 * HALF_TURN) % (2 * HALF_TURN)) - HALF_TURN;
const mix = ([x, y, yaw], to, share) => [x + share * (to[0] - x), y + share * (to[1] - y), yaw + share * turn(yaw, to[2])];
// No pose: a body that is not there at the moment.
const at = (poses, k, share) => (share && poses[k] && poses[k + 1] ? mix(poses[k], poses[k + 1], share) : poses[k]);
const box = (parent, [length, width], className) =>
  add(parent, "rect", { x: -length / 200, y: -width / 200, width: length / 100, height: width / 100, class: className });
const direction = (milliradians, reach) =>
  `${(reach * Math.cos(milliradians / 1000)).toFixed(2)} ${(-reach * Math.sin(milliradians / 1000)).toFixed(2)}`;
const fan = (from, to, reach) => `M0 0L${direction(from, reach)}L${direction(to, reach)}Z`;

async function unpack(text) {
  const bytes = Uint8Array.from(atob(text), (sign) => sign.charCodeAt(0));
  const stream = new Blob([bytes]).stream().pipeThrough(new DecompressionStream("deflate"));
  return new Response(stream).json();
}

class View {
  // One episode on a stage of its own.
  constructor(root, episode, standing, story) {
    this.story = story;
    this.reach = story.ego.reach / 100;
    this.last = story.time.length - 1;
    this.figure = root.appendChild(document.createElement("figure"));
    this.figure.className = "view";
    const title = this.figure.appendChild(document.createElement("h3"));
    title.textContent = `${episode.policy}, ${episode.setting}, ${episode.where}`;
    this.window = this.windowFor(root.clientWidth);
    this.stage = add(this.figure, "svg", { role: "img", "aria-label": `${title.textContent}, seen from above` });
    this.furnish(standing);
    this.now = this.line("now");
    this.now.setAttribute("aria-live", "polite");
    this.line("tale").textContent = this.tale(episode);
    this.addStrips();
  }

  windowFor(width) {
    return width < 500 ? NARROW : VIEW;
  }

  get start() {
    // The moment to open at: the first detection, or else the first sight.
    const first = (flags) => (flags.includes("1") ? flags.indexOf("1") : 0);
    return first(this.story.found) || first(this.story.in_view);
  }

  frameAt(k) {
    // After the last keyframe there is one moment more.
    return Math.min(k, this.last - 1);
  }

  line(className) {
    const paragraph = this.figure.appendChild(document.createElement("p"));
    paragraph.className = className;
    return paragraph;
  }

  furnish(standing) {
    const { ego, moving } = this.story;
    const { side } = this.window;
    // What lies in the world, which turns and moves under a car that always points to the right.
    this.world = add(this.stage, "g");
    this.turns = this.story.way !== null;
    const tens = this.turns ? [] : Array.from({ length: 18 }, (_, n) => 10 * n - 20);
    for (const x of tens) add(this.world, "path", { d: `M${x} ${-side}V${side}`, class: "tick" });
    this.sensor = add(this.world, "g");
    this.sectors = [...this.story.rays[0]].map((_, n, all) => {
      const [from, to] = [n, n + 1].map((end) => ((2 * end) / all.length - 1) * Math.PI * 1000);
      return add(this.sensor, "path", { d: fan(from, to, this.reach), class: "ray" });
    });
    this.wedges = add(this.sensor, "g");
    this.bodies = new Map();
    for (const body of [...standing, ...moving]) this.addBody(body);
    for (const x of tens) add(this.world, "text", { x: x + 0.2, y: side - 0.4, class: "metres" }, `${x} m`);
    this.tracks = add(this.world, "g");
    this.rings = this.ringed().map(() => add(this.world, "circle", { r: this.window.ring, class: "ring" }));
    this.ego = add(this.world, "g");
    const wide = ego.size[1] / 100 + 0.6;
    if (this.turns) {
      const way = this.story.way.map(([x, y]) => `${x / 100} ${-y / 100}`).join("L");
      this.world.insertBefore(add(this.world, "path", { d: `M${way}`, class: "way", "stroke-width": wide }), this.sensor);
    } else add(this.ego, "rect", { x: 0, y: -wide / 2, width: PATH, height: wide, class: "path" });
    box(this.ego, ego.size, "ego");
    this.lights = add(this.ego, "rect", { x: -ego.size[0] / 200, y: -ego.size[1] / 200, width: 0.8, height: ego.size[1] / 100, class: "brake" });
  }

  ringed() {
    // The numbers of the bodies in rings.
    return this.story.sought.map(([n]) => n);
  }

  ringClass(number, frame) {
    return STATES[this.story.sought[number][1][frame]];
  }

  addBody(body) {
    const shape = add(this.world, "g", body.pose ? { transform: place(body.pose) } : {});
    const rect = box(shape, body.size, body.sought ? "sought" : body.reported ? "body" : "mute");
    add(rect, "title", {}, body.kind);
    this.bodies.set(body.n, { body, shape, rect });
  }

  addStrips() {
    const strips = this.figure.appendChild(document.createElement("div"));
    strips.className = "strips";
    const rows = { "camera sees it": ["in_view", "bar-in-view"], "LiDAR detects it": ["found", "bar-found"], braking: ["brake", "bar-brake"] };
    this.heads = Object.entries(rows).map(([label, [name, className]]) => {
      strips.appendChild(document.createElement("span")).textContent = label;
      const svg = add(strips, "svg", { viewBox: `0 0 ${this.last} 1`, preserveAspectRatio: "none", "aria-hidden": "true", width: "100%" });
      for (const { index, 0: run } of this.story[name].matchAll(/1+/g)) add(svg, "rect", { x: index, y: 0, width: run.length, height: 1, class: className });
      return add(svg, "rect", { y: 0, width: this.last / 250, height: 1, class: "playhead" });
    });
  }

  tale(episode) {
    const { about, in_view, found, brake, contact, distance, time } = this.story;
    const away = (k) => (distance[k] === null ? "" : ` (${(distance[k] / 100).toFixed(1)} m away)`);
    const when = (k) => `${(time[k] / 100).toFixed(1)} s${away(k)}`;
    const tell = (flags, yes, no) => (flags.includes("1") ? `${yes} at ${when(flags.indexOf("1"))}` : no);
    const actor = [
      tell(in_view, `The ${about} comes into the cameras' view`, `The ${about} is never in the cameras' view`),
      tell(found, "is detected by the LiDAR", "is never detected by the LiDAR"),
    ];
    const parts = [...(about === null ? ["Nobody to meet"] : actor), tell(brake, "the car brakes", "the car never brakes")];
    if (contact !== null) parts.push(`${this.collision()} at ${(time[contact + 1] / 100).toFixed(1)} s`);
    return `${parts.join("; ")}.${this.otherwise(episode)}`;
  }

  otherwise({ differences }) {
    return differences.length ? ` Ends otherwise than in the results: ${differences.join("; ")}.` : "";
  }

  draw(k, share) {
    // Moment k, and bodies a share of the way to the next one. What a keyframe tells holds until the next.
    k = Math.min(k, this.last);
    const { story } = this;
    const { behind, ahead, side } = this.window;
    const frame = this.frameAt(k);
    const pose = at(story.place, k, share);
    this.stage.setAttribute("viewBox", `${-behind} ${-side} ${behind + ahead} ${2 * side}`);
    this.world.setAttribute("transform", `rotate(${-degrees(pose[2])}) translate(${-pose[0] / 100} ${pose[1] / 100})`);
    this.ego.setAttribute("transform", place(pose));
    for (const { body, shape } of this.bodies.values()) if (body.poses) this.move(shape, at(body.poses, k, share));
    this.ringed().forEach((n, number) => {
      const { body } = this.bodies.get(n);
      const pose = body.poses ? at(body.poses, k, share) : body.pose;
      this.move(this.rings[number], pose && [pose[0], pose[1], 0]);
    });
    if (this.drawn !== k) this.drawMoment(k, frame);
    this.drawn = k;
    this.heads.forEach((head) => head.setAttribute("x", Math.min(k + share, this.last) - this.last / 500));
  }

  move(shape, pose) {
    shape.style.visibility = pose ? "visible" : "hidden";
    if (pose) shape.setAttribute("transform", place(pose));
  }

  drawMoment(k, frame) {
    const { story } = this;
    const [x, y, yaw] = story.place[k];
    const [ahead, left] = story.ego.sensor;
    const [cos, sin] = [Math.cos(yaw / 1000), Math.sin(yaw / 1000)];
    this.sensor.setAttribute("transform", place([x + ahead * cos - left * sin, y + ahead * sin + left * cos, yaw]));
    this.sectors.forEach((sector, n) => sector.setAttribute("fill-opacity", (0.75 * (parseInt(story.rays[frame][n], 36) / 35) ** 0.7).toFixed(3)));
    this.wedges.replaceChildren();
    for (const [left, right, known] of story.camera[k]) add(this.wedges, "path", { d: fan(left, right, this.reach), class: known ? "explained" : "unexplained" });
    for (const [n, { rect }] of this.bodies) rect.classList.toggle("seen", story.seen[k][n] === "1");
    this.tracks.replaceChildren();
    for (const [id, tx, ty, heading, vx, vy, coasting] of story.tracks[k]) {
      const [kind, ...size] = story.tracked[id];
      const shape = add(this.tracks, "g", { transform: place([tx, ty, heading]) });
      add(box(shape, size, coasting ? "track coasting" : "track"), "title", {}, `track of a ${kind}`);
      add(this.tracks, "path", { d: `M${tx / 100} ${-ty / 100}l${vx / 100} ${-vy / 100}`, class: "track" });
    }
    this.rings.forEach((ring, number) => ring.setAttribute("class", `ring ${this.ringClass(number, frame)}`));
    this.lights.style.visibility = this.on("brake", frame) ? "visible" : "hidden";
    this.now.textContent = this.sentence(k, frame);
  }

  on(name, frame) {
    return this.story[name][frame] === "1";
  }

  collision() {
    const { kind, at_front, speed } = this.story.hit;
    return at_front ? `the car hits the ${kind} with ${(speed / 100).toFixed(1)} m/s` : `the ${kind} hits the car`;
  }

  sentence(k, frame) {
    const on = (name) => this.on(name, frame);
    const { about, time, speed, distance, contact } = this.story;
    const now = `${(time[k] / 100).toFixed(1)} s, ${(speed[k] / 100).toFixed(1)} m/s`;
    if (k === this.last) return `${now}${contact !== null ? `: ${this.collision()}` : ""}.`; // after the last keyframe
    const braking = on("brake") ? ", braking" : "";
    if (about === null) return `${now}${braking}.`;
    const away = `, ${about} ${(distance[frame] / 100).toFixed(1)} m away`;
    const state = on("found") ? "detected" : on("in_view") ? "in the cameras' view, not detected" : "not in the cameras' view, not detected";
    return `${now}${away}: ${state}${braking}.`;
  }
}
