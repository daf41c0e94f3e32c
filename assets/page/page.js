// Time, keys, and what comes in while an episode runs.

const SECONDS = 1.7;  // that a step takes to play

const page = { time: 0, goal: null, playing: false, dirty: true, changed: null };
const live = document.body.dataset.live === "yes";
let view = null;
try {
  view = new View(byId("view"), () => { page.dirty = true; });
} catch (error) {
  byId("nogl").hidden = false;
}
const panel = new Panel((held) => { if (view) { view.held = held; page.dirty = true; } });
let story = readStory(byId("story").textContent);

function tell(next) {
  story = next;
  panel.tell(story);
  if (view) view.tell(story);
  byId("time").max = story.last;
  byId("ticks").replaceChildren(...story.steps.map((step, index) => make("i", undefined, {
    class: step.new ? "felt" : "", style: { left: `${(100 * index) / Math.max(story.last, 1)}%` },
  })));
  legend();
  page.dirty = true;
}

function legend() {
  const dashed = 'stroke-dasharray="3.5 2.5"';
  const stroke = (colour, more = "") => `<line x1="0" y1="6" x2="18" y2="6" stroke="${colour}" stroke-width="2" ${more}/>`;
  const entries = [
    [`<circle cx="4" cy="6" r="3.4" fill="${CONTACT}"/>${`<path d="M4 6H15M11 2.5L16 6L11 9.5" stroke="${CONTACT}" stroke-width="2" fill="none"/>`}`, "contact, felt normal"],
    [stroke(HIT), "touched"],
    [stroke(MISSED, dashed), "met nothing" + (story.truth === null ? "" : ", or the plane")],
    [`<rect x="2" y="0" width="14" height="12" rx="2" fill="${PALETTE[0]}" opacity=".4"/>`, "rivals, by colour"],
  ];
  if (story.truth !== null) entries.push([`<rect x="2" y="0" width="14" height="12" rx="2" fill="${TRUTH}" stroke="${EDGE}"/>`, "the true object, which palpate is not told"]);
  if (view && view.cell && story.plane !== null) entries.push([stroke("#aab4bc"), `grid ${view.cell}`]);
  byId("legend").replaceChildren(...entries.map(([drawing, text]) => {
    const item = make("li");
    item.innerHTML = `<svg viewBox="0 0 18 12" aria-hidden="true">${drawing}</svg>`;
    item.append(text);
    return item;
  }));
}

function setTime(time) {
  page.time = Math.min(Math.max(time, 0), story.last);
  page.dirty = true;
}

function refresh() {
  const phase = phaseAt(page.time);
  if (view) view.show(phase);
  panel.show(phase.step, phase.share < FELT && phase.step > 0);
  byId("time").value = page.time;
  byId("time").setAttribute("aria-valuetext", story.steps[phase.step].title);
  byId("where").textContent = `${phase.step} / ${story.last}`;
  byId("back").disabled = page.time <= 0;
  byId("on").disabled = page.time >= story.last && !page.playing;
  const play = byId("play");
  play.textContent = page.playing ? "❚❚" : "▶\uFE0E";
  play.setAttribute("aria-label", page.playing ? "Pause" : "Play");
  document.title = `${phase.step} of ${story.last} · ${story.steps[phase.step].title} · palpate`;
  document.body.dataset.step = phase.step;
  document.body.dataset.left = story.steps[phase.step].hypotheses ?? "";
}

let latest = performance.now();
function frame(now) {
  const seconds = (now - latest) / 1000, passed = Math.min(seconds, 0.1);
  latest = now;
  if (page.playing || page.goal !== null) {
    const goal = page.goal ?? story.last;
    setTime(Math.min(page.time + passed / SECONDS, goal));
    if (page.time >= goal) { page.goal = null; page.playing = false; }
  }
  if (page.dirty) {
    page.dirty = false;
    refresh();
    if (view) view.drawMoving(page.changed === null ? 0 : seconds);
    page.changed = now;
  } else if (page.changed !== null && now - page.changed > 150) {
    page.changed = null;
    if (view) view.drawStill();
  }
  requestAnimationFrame(frame);
}

function stepOn() {
  page.playing = false;
  const next = Math.floor(page.time + 1e-6) + 1;
  if (page.goal !== null) setTime(page.goal);
  page.goal = Math.min(page.goal !== null ? page.goal + 1 : next, story.last);
  page.dirty = true;
}

function jump(time) {
  page.playing = false;
  page.goal = null;
  setTime(time);
}

const stepBack = () => jump(Math.ceil(page.time - 1e-6) - 1);

function playOrPause() {
  page.goal = null;
  page.playing = !page.playing;
  if (page.playing && page.time >= story.last) setTime(0);
  page.dirty = true;
}

const KEYS = {
  ArrowRight: stepOn, ArrowLeft: stepBack, " ": playOrPause,
  Home: () => jump(0), End: () => jump(story.last),
  r: () => view?.reset(), 0: () => view?.reset(),
  1: () => view?.look(-90, 0), 2: () => view?.look(0, 0), 3: () => view?.look(-90, 89.9),
  "+": () => view?.zoom(0.85), "=": () => view?.zoom(0.85), "-": () => view?.zoom(1 / 0.85),
  t: () => { if (view) view.showTruth = !view.showTruth; },
  g: () => { if (view) view.showRivals = !view.showRivals; },
};

document.addEventListener("keydown", (event) => {
  if (event.ctrlKey || event.metaKey || event.altKey || event.target.tagName === "SELECT") return;
  const act = KEYS[event.key];
  if (!act || (event.key === " " && event.target.tagName === "BUTTON")) return;
  event.preventDefault();
  act();
  page.dirty = true;
});
byId("back").addEventListener("click", stepBack);
byId("on").addEventListener("click", stepOn);
byId("play").addEventListener("click", playOrPause);
byId("time").addEventListener("input", (event) => jump(Number(event.target.value)));

new ResizeObserver(() => {
  if (view) view.resize();
  panel.showTree();
  refresh();
  if (view) view.draw(view.ratio || view.moving);
}).observe(byId("stage"));

function fromHash() {
  const wanted = /step=([\d.]+)/.exec(location.hash);
  if (wanted) jump(Number(wanted[1]));
  return Boolean(wanted);
}
window.addEventListener("hashchange", fromHash);

function follow() {
  const subtitle = byId("subtitle");
  const fetchStory = async () => {
    const next = readStory(await (await fetch("story.json")).text());
    const followed = page.time >= story.last - 1e-6 || page.goal !== null || page.playing;
    tell(next);
    if (followed && page.time < story.last) { page.playing = true; }
    subtitle.className = next.ending[0] ? "" : "live";
  };
  const events = new EventSource("events");
  events.onmessage = fetchStory;
  events.onerror = () => { subtitle.className = "live lost"; };
  subtitle.className = story.ending[0] ? "" : "live";
}

if (view) view.resize();
tell(story);
if (view) view.reset();
// An episode plays; of a person's own touches the answer is what is looked for.
const plays = !live && story.truth !== null;
if (!fromHash()) setTime(plays ? 0 : story.last);
refresh();
if (plays && !location.hash) page.playing = !window.matchMedia("(prefers-reduced-motion: reduce)").matches;
requestAnimationFrame(frame);
if (live) follow();
