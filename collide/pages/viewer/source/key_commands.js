/** Keys, and the list of them. */
import { element, refill } from "./text_nodes.js";

const KEYS = [
  ["j / k", "next / previous row"], ["f", "fit: all bodies, or the selected ones"],
  ["1 2 3 4", "front, side, top, corner"], ["o", "parallel lines or perspective"],
  ["g", "ghost what is not selected"], ["x", "see through the selected bodies"],
  ["w", "wire overlay of the geometry really tested"], ["c", "section plane"],
  ["r", "frames of robots' links, or of the selected bodies"], ["s", "save the scene as a picture"],
  ["[ ]", "state before / after"], ["p", "play or pause the states"], ["h", "hold this state in a picture beside"],
  ["/", "filter by the name of a body"], ["Esc", "select nothing"], ["?", "this list"],
];
const MOUSE = [
  ["arrows, + -", "orbit and zoom, where the scene has the focus; with Shift pan"], ["drag", "orbit"], ["right drag, or with Shift", "pan"], ["wheel, pinch", "zoom"], ["click", "select a body"],
];

/** commands : key to function; `?` opens the list. */
export function listenToKeys(dialog, commands) {
  fillDialog(dialog);
  const all = { ...commands, "?": () => (dialog.open ? dialog.close() : dialog.showModal()) };
  document.addEventListener("keydown", (event) => {
    if (event.ctrlKey || event.metaKey || event.altKey || event.defaultPrevented) return;
    const typing = event.target.matches?.("input[type=search], input[type=number], select, textarea");
    if (typing) {
      if (event.key === "Escape") event.target.blur();
      return;
    }
    if (dialog.open && event.key !== "?") return;
    const command = all[event.key];
    if (!command) return;
    event.preventDefault();
    command();
  });
  return all["?"];
}

function fillDialog(dialog) {
  const list = (rows) => element("dl", {}, ...rows.flatMap(([key, what]) => [element("dt", {}, element("kbd", {}, key)), element("dd", {}, what)]));
  refill(dialog, element("h2", {}, "Keys"), list(KEYS), element("h2", {}, "In the scene"), list(MOUSE),
    element("form", { method: "dialog" }, element("button", { autofocus: true }, "close")));
}
