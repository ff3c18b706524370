// Plays of the open loop from above: nothing reacts, and the question is who of the scene is found when.

const AROUND = { behind: 52, ahead: 52, side: 52, ring: 4 };
const STANDINGS = { 0: "mute", 1: "missed", 2: "spotted" };

class SceneView extends View {
  windowFor() {
    this.figure.classList.add("scene");
    return AROUND;
  }

  get start() {
    return this.story.entries.length ? this.story.entries[0][1] : 0;
  }

  frameAt(k) {
    return k;
  }

  ringed() {
    return this.story.entries.map(([n]) => n);
  }

  ringClass(number, frame) {
    // An entry is looked for during so many keyframes.
    const [n, first] = this.story.entries[number];
    const age = frame - first;
    const standing = this.story.states[frame][n];
    if (age < 0 || age >= this.story.censored) return "";
    return { 1: "in-view", 2: "found" }[standing] ?? "";
  }

  addBody(body) {
    if (!body.squares) return super.addBody(body);
    const side = body.side / 100;
    const d = body.squares.map(([x, y]) => `M${x / 100} ${-y / 100}h${side}v${-side}h${-side}z`).join("");
    add(this.world, "path", { d, class: "wall" });
  }

  drawMoment(k, frame) {
    super.drawMoment(k, frame);
    for (const [n, { rect }] of this.bodies) {
      for (const [standing, name] of Object.entries(STANDINGS)) rect.classList.toggle(name, this.story.states[frame][n] === standing);
    }
  }

  on() {
    return false; // of a car that is driven by nobody here there is nothing to tell
  }

  counted(frame) {
    const standings = [...this.story.states[frame]];
    const found = standings.filter((standing) => standing === "2").length;
    const entries = this.story.entries.filter(([, first]) => first === frame);
    const atOnce = entries.filter(([n]) => standings[n] === "2").length;
    return { found, scored: found + standings.filter((standing) => standing === "1").length, entries: entries.length, atOnce };
  }

  sentence(k, frame) {
    const { found, scored, entries, atOnce } = this.counted(frame);
    const news = entries ? `; ${entries} first sighting${entries > 1 ? "s" : ""}, ${atOnce} found` : "";
    return `${(this.story.time[k] / 100).toFixed(1)} s: ${found} of ${scored} objects found${news}.`;
  }

  tale(episode) {
    const { first_sightings: events, first_sighting_recall, ttfd_keyframes, overall_recall } = this.story.outcome;
    const percent = (share) => `${(100 * share).toFixed(1)}%`;
    const all = overall_recall === null ? "Nobody to find" : `${percent(overall_recall)} of all objects found, keyframe by keyframe`;
    const news = events ? `; ${Math.round(events * first_sighting_recall)} of ${events} first sightings found at once, mean TTFD ${ttfd_keyframes.toFixed(2)} keyframes` : "";
    return `${all}${news}.${this.otherwise(episode)}`;
  }

  addStrips() {
    // One bar a keyframe: what is found of all, and of those that appear.
    const counts = this.story.states.map((_, frame) => this.counted(frame));
    const rows = { found: [(each) => each.found, (each) => each.scored], "first sightings": [(each) => each.atOnce, (each) => each.entries] };
    const strips = this.figure.appendChild(document.createElement("div"));
    strips.className = "strips";
    this.heads = Object.entries(rows).map(([label, [part, whole]]) => {
      strips.appendChild(document.createElement("span")).textContent = label;
      const svg = add(strips, "svg", { viewBox: `0 0 ${counts.length} 1`, preserveAspectRatio: "none", "aria-hidden": "true", width: "100%" });
      counts.forEach((each, x) => {
        if (!whole(each)) return;
        const share = part(each) / whole(each);
        add(svg, "rect", { x, y: 0, width: 1, height: 1 - share, class: "bar-in-view" });
        add(svg, "rect", { x, y: 1 - share, width: 1, height: share, class: "bar-found" });
      });
      return add(svg, "rect", { y: 0, width: counts.length / 250, height: 1, class: "playhead" });
    });
  }
}
