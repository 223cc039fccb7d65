/**
 * A page that follows a World: the program that serves it sends what changed, the page takes it over.
 *
 * Without the block `live` the page connects to nothing, and its policy would not let it. Bodies move with every event,
 * tables are made anew now and then: nobody reads them thirty times a second.
 */
import { readBlock } from "./page_data.js";
import { printable } from "./text_nodes.js";

const TABLES_EVERY = 250; // ms
const CAMERA = `collide camera ${location.pathname}`;
const WORDS = {
  open: "● live", lost: "○ connection lost, trying again", closed: "■ no longer live: the program that showed this has ended",
};

/** Whether the page follows a program. */
export function isLive() {
  return document.getElementById("live") !== null;
}

/**
 * nodes : {mark, state, label, problem}.
 * take : {bodies(update), tables(), reload()}: at once, now and then, before the page is loaded again.
 */
export function followLive(nodes, take) {
  const block = readBlock("live");
  if (!block) return;
  const tell = (state) => {
    nodes.mark.hidden = false;
    if (nodes.mark.dataset.live === state) return;
    nodes.mark.dataset.live = state;
    nodes.state.textContent = WORDS[state];
  };
  const tables = nowAndThen(take.tables);
  const source = new EventSource(block.events);
  const on = (name, action) => source.addEventListener(name, (event) => action(JSON.parse(event.data)));
  source.onopen = () => tell("open");
  source.onerror = () => tell(source.readyState === EventSource.CLOSED ? "closed" : "lost");
  on("update", (update) => {
    nodes.label.textContent = update.label === null ? "" : printable(update.label);
    take.bodies(update);
    tables();
  });
  on("reload", () => {
    take.reload();
    location.reload();
  });
  on("problem", ({ text }) => {
    nodes.problem.hidden = text === null;
    nodes.problem.textContent = text === null ? "" : printable(text);
  });
  on("closed", () => {
    source.close(); // a page that went on asking could meet another program at this address
    tell("closed");
  });
}

/** Calls `action` soon after each call, but not more often than tables may change. */
function nowAndThen(action) {
  let [timer, last] = [0, -TABLES_EVERY];
  return () => {
    if (timer) return;
    timer = setTimeout(() => {
      timer = 0;
      last = performance.now();
      action();
    }, Math.max(0, last + TABLES_EVERY - performance.now()));
  };
}

/** Keeps a camera, plain data, in the browser's tab while the page is loaded again. */
export function keepCamera(camera) {
  try {
    sessionStorage.setItem(CAMERA, JSON.stringify(camera));
  } catch {
    // a frame may have no storage: the camera begins anew
  }
}

/** The camera that was kept, once; null where none was. */
export function takeKeptCamera() {
  try {
    const text = sessionStorage.getItem(CAMERA);
    sessionStorage.removeItem(CAMERA);
    return text === null ? null : JSON.parse(text);
  } catch {
    return null;
  }
}
