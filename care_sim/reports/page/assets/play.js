// The player: one or two episodes under one clock, opened from the list of episodes.

const calm = matchMedia("(prefers-reduced-motion: reduce)");

class Player {
  constructor(root, replays) {
    this.replays = replays;
    this.part = (id) => root.querySelector(`#${id}`);
    this.views = [];
    this.position = 0;
    this.playing = false;
    this.part("play").addEventListener("click", () => this.toggle());
    this.part("back").addEventListener("click", () => this.seek(Math.ceil(this.position) - 1));
    this.part("on").addEventListener("click", () => this.seek(Math.floor(this.position) + 1));
    this.part("moment").addEventListener("input", (event) => this.seek(Number(event.target.value)));
    this.part("beside").addEventListener("change", (event) => this.show(this.number, event.target.value, this.position));
  }

  async open(number, compare = false) {
    // With `compare` the reference, where it has played in the same world, at best at the same budget.
    const own = this.replays.episodes[number];
    const others = this.replays.episodes.map((other, n) => [n, other]).filter(([n, other]) => n !== number && other.world === own.world);
    const name = (other) => (other.setting === own.setting ? other.policy : `${other.policy}, ${other.setting}`);
    this.part("beside").replaceChildren(new Option("nothing", ""), ...others.map(([n, other]) => new Option(name(other), n)));
    const rival = others.find(([, other]) => other.setting === own.setting && other.policy === own.policy.replace(/\S+/, "care"));
    if (compare && rival) this.part("beside").value = rival[0];
    await this.show(number, this.part("beside").value, null);
  }

  async show(number, beside, position) {
    this.stop();
    this.number = number;
    const wish = (this.wish = Symbol());
    const chosen = [number, ...(beside === "" ? [] : [Number(beside)])].map((n) => this.replays.episodes[n]);
    const stories = await Promise.all(chosen.map((episode) => unpack(episode.story)));
    if (wish !== this.wish) return; // another was chosen meanwhile
    this.part("views").replaceChildren();
    this.views = chosen.map((episode, n) => {
      const Kind = stories[n].entries ? SceneView : View;
      return new Kind(this.part("views"), episode, this.replays.bodies[episode.bodies], stories[n]);
    });
    this.last = Math.max(...this.views.map((view) => view.last));
    this.part("moment").max = this.last;
    this.seek(position ?? this.views[0].start);
  }

  seek(position) {
    this.stop();
    this.go(Math.max(0, Math.min(this.last, Math.round(position))));
  }

  go(position) {
    this.position = position;
    const k = Math.floor(position);
    const share = calm.matches ? 0 : position - k;
    this.views.forEach((view) => view.draw(k, share));
    this.part("moment").value = k;
    this.part("moment").setAttribute("aria-valuetext", this.views[0].now.textContent);
  }

  toggle() {
    if (this.playing) return this.stop();
    if (this.position >= this.last) this.go(0);
    this.playing = true;
    this.mark();
    const times = this.views.find((view) => view.last === this.last).story.time;
    const keyframe = (1000 * (times[1] - times[0])) / 100;
    let before = null;
    const step = (now) => {
      if (!this.playing) return;
      const pace = Number(this.part("speed").value) / keyframe;
      this.go(Math.min(this.last, this.position + (before === null ? 0 : (now - before) * pace)));
      before = now;
      if (this.position >= this.last) this.stop();
      else requestAnimationFrame(step);
    };
    requestAnimationFrame(step);
  }

  stop() {
    this.playing = false;
    this.mark();
  }

  mark() {
    this.part("play").textContent = this.playing ? "Pause" : "Play";
    this.part("play").setAttribute("aria-pressed", this.playing);
    this.views.forEach((view) => view.now.setAttribute("aria-live", this.playing ? "off" : "polite"));
  }
}

const stage = document.getElementById("player");
const player = new Player(stage, read("replays"));
const mark = (button) => {
  document.querySelectorAll(".episodes [aria-pressed]").forEach((other) => other.removeAttribute("aria-pressed"));
  button.setAttribute("aria-pressed", "true");
  return Number(button.dataset.episode);
};
for (const button of document.querySelectorAll("[data-episode]")) {
  button.addEventListener("click", async () => {
    await player.open(mark(button));
    stage.scrollIntoView({ behavior: calm.matches ? "auto" : "smooth", block: "start" });
    stage.querySelector("#play").focus({ preventScroll: true });
  });
}
player.open(mark(document.querySelector("[data-episode]")), stage.clientWidth > 700);
