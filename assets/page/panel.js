// What stands beside the picture: the verdict, the rivals, and the tree as it was pruned.

const ROW = 34;
const byId = (id) => document.getElementById(id);

function make(tag, text, attributes = {}) {
  const element = document.createElement(tag);
  if (text !== undefined) element.textContent = text;
  for (const [name, value] of Object.entries(attributes)) {
    if (name === "style") Object.assign(element.style, value);
    else element.setAttribute(name, value);
  }
  return element;
}

const swatch = (colour) => make("i", undefined, { style: { background: colour } });

class Panel {
  constructor(hold) {
    this.hold = hold;
    this.whose = -1;
    byId("whose").addEventListener("change", (event) => {
      this.whose = Number(event.target.value);
      this.showTree();
    });
  }

  tell(story) {
    this.story = story;
    byId("title").textContent = story.title;
    byId("subtitle").textContent = story.subtitle;
    const select = byId("whose");
    select.replaceChildren(make("option", `all ${story.objects.length} objects`, { value: -1 }));
    story.objects.forEach((object, index) => select.append(make("option", object.name, { value: index })));
    select.value = this.whose;
    this.step = null;
  }

  // While a touch is under way (``coming``), what was known before it stands.
  show(step, coming) {
    const known = coming ? step - 1 : step;
    byId("step").textContent = this.story.steps[step].title;
    byId("told").textContent = coming ? "on its way" : this.story.steps[step].told;
    if (known === this.step) return;
    this.step = known;
    const now = this.story.steps[known];
    this.showVerdict(now);
    this.showShares(now);
    this.showRivals();
    this.showTree();
  }

  showVerdict(now) {
    const verdict = byId("verdict"), ended = this.step === this.story.last && this.story.ending[0];
    verdict.replaceChildren(ended ? this.story.ending[0] : said(now));
    const below = ended ? this.story.ending[1] : now.interpretations === null ? "" :
      `${counted(now.interpretations, "interpretation")} of ${counted(now.contacts.length, "contact")}`;
    if (below) verdict.append(make("span", below));
  }

  showShares(now) {
    const most = Math.max(1, ...now.shares.map(([, count]) => count));
    const head = now.shares.length ? [make("small", "object"), make("small"), make("small", "poses · weight")] : [];
    byId("shares").replaceChildren(...head, ...now.shares.flatMap(([index, count, weight]) => {
      const object = this.story.objects[index], bar = make("div");
      bar.append(make("i", undefined, { style: { width: `${(100 * count) / most}%`, background: object.colour } }));
      const told = make("span", `${grouped(count)} · ${percent(weight)}`, { title: `${counted(count, "pose")}, weight ${weight}` });
      return [make("b", object.name), bar, told];
    }));
  }

  showRivals() {
    const step = this.step, story = this.story, list = byId("rivals");
    const there = story.rivals.map((rival, index) => ({ rival, index }))
      .filter(({ rival }) => rival.born <= step && (rival.died === null || rival.died >= step));
    const alive = there.filter(({ rival }) => rival.died !== step);
    list.replaceChildren(...there.map(({ rival, index }) => {
      const dead = rival.died === step, object = story.objects[rival.object];
      const item = make("li", undefined, { tabindex: 0, ...(dead ? { class: "dead" } : {}) });
      const weight = rival.weights[Math.min(step - rival.born, rival.weights.length - 1)];
      const open = rival.open[Math.min(step - rival.born, rival.open.length - 1)];
      item.append(swatch(object.colour), make("span", object.name), make("em", dead ? "ruled out" : percent(weight) + (open && alive.length < 4 ? " · pose open" : "")));
      item.title = dead ? `ruled out by ${story.steps[step].title.toLowerCase()}` :
        open ? "one example: its pose can still shift or turn" : "its pose is fixed";
      for (const [event, held] of [["mouseenter", index], ["focus", index], ["mouseleave", null], ["blur", null]]) {
        item.addEventListener(event, () => this.hold(held));
      }
      return item;
    }));
    const left = story.steps[step].hypotheses;
    byId("rivals-note").textContent = left === null ? "" :
      left > alive.length ? `${alive.length} of ${grouped(left)} left are shown` : `${counted(left, "is", "are")} left`;
  }

  showTree() {
    const trees = this.story.steps[this.step].tree;
    const chosen = (trees || []).map((tree, index) => ({ tree, colour: this.story.objects[index].colour }))
      .filter((_, index) => this.whose < 0 || index === this.whose);
    const sums = sumLevels(chosen.map(({ tree }) => tree), this.story.cuts);
    this.showCuts(sums);
    this.showLevels(sums);
    drawBranches(byId("branches"), chosen, sums, this.story.cuts);
    const note = [];
    if (!trees) note.push(this.step === 0 ? "No contact yet." : "Not known at this step.");
    if (sums.partial) note.push("Some trees have so many branches that they were not counted to the end.");
    if (sums.unseen) note.push(`${counted(sums.unseen, "further level")} not shown.`);
    if (trees && sums.levels.length) note.push("Recounted pair by pair, in the order of the search; the drawing is a sample.");
    byId("tree-note").textContent = note.join(" ");
  }

  showCuts(sums) {
    const rows = [...this.story.cuts, "pose"].filter((name) => sums.total[name] > 0);
    byId("cuts").replaceChildren(...rows.map((name) => {
      const row = make("span", undefined, { title: MEANINGS[name] });
      row.append(swatch(CUT_COLOURS[name]), make("span", NAMES[name]), make("em", `−${grouped(sums.total[name])}`));
      return row;
    }));
  }

  showLevels(sums) {
    const rows = sums.levels.map((level) => {
      const item = make("li");
      item.append(make("b", grouped(level.left)), make("span", ` of ${grouped(level.tried)} · contact ${level.contact + 1}`));
      item.append(mix([...this.story.cuts.map((name) => [level.cut[name], name]), [level.left, "live"]], level.tried));
      return item;
    });
    if (rows.length && !sums.partial) {
      const item = make("li");
      item.append(make("b", grouped(sums.held)), make("span", ` of ${grouped(sums.left)} · a pose fits`));
      item.append(mix([[sums.total.pose, "pose"], [sums.held, "live"]], sums.left));
      rows.push(item);
    }
    if (rows.length) rows.unshift(make("li", "no contact paired"));
    byId("levels").replaceChildren(...rows);
  }
}

const NAMES = { kind: "kind", distance: "distance", angle: "angle", component: "component", tilt: "tilt", pose: "no pose fits" };
const MEANINGS = {
  kind: "a face, where the probe felt an edge or a corner, or the other way round",
  distance: "two contacts are nearer or farther than two points on these faces can be",
  angle: "two normals differ by another angle than these faces do",
  component: "a contact lies higher or lower over another's face than any point of its own",
  tilt: "the line between two contacts leans otherwise",
  pose: "each pair is possible, but no pose puts all contacts on their faces, outside of free space",
};

function said(now) {
  if (now.hypotheses === null) return now.contacts.length ? "Not worked out" : "Nothing touched yet";
  if (now.hypotheses === 0) return "Nothing in the library fits";
  if (now.verdict === "unique") return "Unique";
  return `${counted(now.hypotheses, "rival")} left`;
}

const percent = (weight) => (weight > 0 && weight < 0.01 ? "<1 %" : `${Math.round(100 * weight)} %`);

function mix(parts, whole) {
  const bar = make("div", undefined, { class: "mix" });
  for (const [count, name] of parts) {
    if (!count) continue;
    const width = `max(2px, ${(100 * count) / Math.max(whole, 1)}%)`;
    bar.append(make("i", undefined, { style: { width, background: CUT_COLOURS[name], flex: name === "live" ? "none" : "0 1 auto" }, title: `${NAMES[name] || "live"}: ${grouped(count)}` }));
  }
  return bar;
}

// The numbers of several trees together, level by level.
function sumLevels(trees, cuts) {
  const levels = [], total = Object.fromEntries([...cuts, "pose"].map((name) => [name, 0]));
  const partial = trees.some((tree) => !tree.whole);
  const sum = (name) => trees.reduce((all, tree) => all + tree[name], 0);
  for (const tree of trees) {
    tree.levels.forEach(([contact, tried, ...rest], at) => {
      const level = levels[at] || (levels[at] = { contact, tried: 0, left: 0, cut: Object.fromEntries(cuts.map((name) => [name, 0])) });
      level.tried += tried;
      level.left += rest.at(-1);
      cuts.forEach((name, index) => { level.cut[name] += rest[index]; total[name] += rest[index]; });
    });
  }
  const left = sum("left"), held = sum("held");
  if (!partial) total.pose = Math.max(left - held, 0);
  return { levels, total, partial, left, held, unseen: Math.max(0, ...trees.map((tree) => tree.unseen)) };
}

// A row a level; each dot a branch, the line up to its parent, a tick where all of it was cut.
function drawBranches(canvas, chosen, sums, cuts) {
  const rows = sums.levels.length ? sums.levels.length + 1 : 0;
  const width = canvas.clientWidth, height = rows * ROW;
  const scale = Math.min(window.devicePixelRatio || 1, 2);
  canvas.style.height = `${height}px`;
  canvas.width = Math.max(width * scale, 1);
  canvas.height = Math.max(height * scale, 1);
  if (!rows) return;
  const pen = canvas.getContext("2d");
  pen.scale(scale, scale);
  const levels = sums.levels.map((_, at) => chosen.flatMap(({ tree, colour }, owner) => {
    const [parents, endings] = tree.drawn[at] || [[], []];
    return parents.map((parent, index) => ({ owner, parent, ending: endings[index], colour, index }));
  }));
  const root = { x: width / 2, y: ROW / 2 };
  levels.forEach((nodes, at) => nodes.forEach((node, place) => {
    node.x = 4 + ((place + 0.5) / nodes.length) * (width - 8);
    node.y = (at + 1) * ROW + ROW / 2;
    node.above = at === 0 ? root : levels[at - 1].find((one) => one.owner === node.owner && one.index === node.parent);
  }));
  const deepest = levels.at(-1) || [];
  for (const node of deepest) if (node.ending === -1) for (let one = node; one && one !== root; one = one.above) one.lasting = true;
  const all = levels.flat().filter((node) => node.above);
  const line = (node) => {
    pen.beginPath();
    pen.moveTo(node.above.x, node.above.y);
    pen.bezierCurveTo(node.above.x, node.above.y + ROW / 2, node.x, node.y - ROW / 2, node.x, node.y);
    pen.stroke();
  };
  pen.lineWidth = 0.6;
  pen.globalAlpha = 0.55;
  pen.strokeStyle = "#b4bdc4";
  for (const node of all) if (!node.lasting) line(node);
  pen.globalAlpha = 1;
  for (const node of all) {
    if (node.ending < 0) continue;
    pen.strokeStyle = CUT_COLOURS[node.ending < cuts.length ? cuts[node.ending] : "pose"];
    pen.lineWidth = 1.6;
    pen.beginPath();
    pen.moveTo(node.x, node.y + 1);
    pen.lineTo(node.x, node.y + 7);
    pen.stroke();
  }
  const crowd = deepest.filter((node) => node.lasting).length;
  pen.lineWidth = Math.min(Math.max(30 / Math.max(crowd, 1), 0.9), 2.2);
  for (const node of all) if (node.lasting) { pen.strokeStyle = node.colour; line(node); }
  const dot = (node, radius, colour) => {
    pen.fillStyle = colour;
    pen.beginPath();
    pen.arc(node.x, node.y, radius, 0, 2 * Math.PI);
    pen.fill();
  };
  for (const node of all) if (!node.lasting) dot(node, 1.1, "#9aa5ad");
  for (const node of all) if (node.lasting) dot(node, crowd > 30 ? 1.8 : 3, node.colour);
  dot(root, 3.5, EDGE);
}
