// The story as the page reads it: colours, words, and who is there at a moment.

// Okabe and Ito's palette, which colour-blind readers can tell apart; vermilion is the contacts', and
// their yellow is darker here, to be seen on white.
const PALETTE = ["#e69f00", "#009e73", "#cc79a7", "#0072b2", "#56b4e9", "#b3a100"];
const CONTACT = "#d55e00", TRUTH = "#c9d3da", EDGE = "#18222b", HIT = "#18222b", MISSED = "#8a949c";
const CUT_COLOURS = { kind: "#a9b3bb", distance: "#2f5f8f", angle: "#e3bf62", component: "#b07aa1",
                      tilt: "#7a5c3e", pose: "#d55e00", live: "#18222b" };

// Of objects beyond the palette the colour is darker, then lighter.
function colourOf(index) {
  const base = PALETTE[index % PALETTE.length], round = Math.floor(index / PALETTE.length);
  if (!round) return base;
  const to = round % 2 ? 0 : 255, share = Math.min(0.35 * Math.ceil(round / 2), 0.8);
  const part = (at) => Math.round(parseInt(base.slice(at, at + 2), 16) * (1 - share) + to * share);
  return `rgb(${part(1)},${part(3)},${part(5)})`;
}

function bytesOf(text) {
  const raw = atob(text), bytes = new Uint8Array(raw.length);
  for (let i = 0; i < raw.length; i++) bytes[i] = raw.charCodeAt(i);
  return bytes.buffer;
}

const clamp = (value) => Math.min(Math.max(value, 0), 1);
const smooth = (value) => { const v = clamp(value); return v * v * (3 - 2 * v); };
const grouped = (number) => Math.round(number).toLocaleString("en-GB");
const counted = (number, one, many) => `${grouped(number)} ${number === 1 ? one : many || one + "s"}`;

// Time is a number of steps: at 2 all is as it was after step 2, and from 1 to 2 step 2 happens:
// its ways grow, contacts appear, rivals that it rules out fade, and others take their places.
function phaseAt(time) {
  const step = Math.ceil(time - 1e-6);
  return { step, share: step === 0 ? 1 : clamp(time - (step - 1)) };
}

const WAYS_GROW = 0.5, FELT = 0.62;

function presence(rival, { step, share }) {
  if (step < rival.born || (rival.died !== null && step > rival.died)) return 0;
  if (rival.died === step) return 1 - smooth((share - FELT) / 0.33);
  if (rival.born === step && step > 0) return smooth((share - FELT - 0.13) / 0.25);
  return 1;
}

function poseOf(rival, { step, share }) {
  const at = (share < FELT ? step - 1 : step) - rival.born;
  return rival.poses[Math.min(Math.max(at, 0), rival.poses.length - 1)];
}

function readStory(text) {
  const story = JSON.parse(text);
  story.objects.forEach((object, index) => {
    object.colour = colourOf(index);
    if (!object.vertices) return;
    object.vertices = new Float32Array(bytesOf(object.vertices));
    object.triangles = new Uint32Array(bytesOf(object.triangles));
    object.edges = new Float32Array(bytesOf(object.edges));
  });
  story.last = story.steps.length - 1;
  return story;
}
